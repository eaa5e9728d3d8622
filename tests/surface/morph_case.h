#pragma once

#include <string>

#include "cad_variants.h"
#include "core/boundary.h"
#include "core/mesh.h"
#include "surface/surface_morph.h"

namespace cadmorph::testing {

/// A mesh and its base CAD.
struct MorphCase {
  std::shared_ptr<const CadModel> base;
  Mesh mesh;
  Boundary boundary;
  double diagonal = 0;  ///< of the base CAD
};

/// A shape of models/shapes by its name, or another pair of files below models/.
MorphCase shape_case(const std::string& name);
MorphCase file_case(const std::string& step, const std::string& vtu);
MorphCase model_case(CadModel base, const std::string& vtu);
MorphCase mesh_case(CadModel base, Mesh mesh);

/// New positions of all nodes and what the surface morph reports.
struct Morphed {
  Points points;  ///< all nodes of the mesh
  SurfaceMorphResult surface;
};

/// The two morphs one after the other, as the pipeline runs them, in one step.
Morphed morph(const MorphCase& c, const CadModel& variant, const SurfaceMorphOptions& options = {});

/// The surface morph alone.
SurfaceMorphResult morph_surface(const MorphCase& c, const CadModel& variant,
                                 const SurfaceMorphOptions& options = {});

/// Largest distance between rows.
double largest_difference(const Points& a, const Points& b);

/// Where `map` puts each node.
Points images(const Points& points,
              const std::function<Eigen::Vector3d(const Eigen::Vector3d&)>& map);

/// Positions of the boundary's nodes.
Points surface_points(const Boundary& boundary, const Points& points);

/// Facets (on the outside) whose normal makes more than a right angle with that of the same facet
/// at `expected`.
Index folded_facets(const Boundary& boundary, const Points& points, const Points& expected);

/// All small shapes whose mesh is bounded by their CAD, with all sorts of faces.
const std::vector<std::string>& all_shapes();

}  // namespace cadmorph::testing
