#pragma once

#include <memory>
#include <string>
#include <vector>

#include "cad/brep.h"
#include "cad/topology_match.h"
#include "core/boundary.h"
#include "core/mesh.h"
#include "core/progress.h"

namespace cadmorph {

/// What to do with the part of the mesh's surface that lies on no CAD face (far field, symmetry plane).
enum class UnmatchedPolicy {
  Auto,   ///< planar patches slide where they touch moved surface, all else stays fixed
  Error,  ///< refuse
  Fix,    ///< keep in place
  Slide,  ///< slide in their plane; refuse patches that are not planar
};

struct SurfaceMorphOptions {
  /// Largest distance of a surface node from the CAD, in units of its shortest incident mesh edge.
  double tolerance = 0.1;
  /// Puts nodes exactly on the variant CAD instead of carrying their offset from the base CAD.
  bool snap = false;
  UnmatchedPolicy unmatched = UnmatchedPolicy::Auto;
  /// Millimetres per mesh unit; 0: detect (1, 10, 1000, 25.4, 304.8).
  double mesh_unit_mm = 0;
  Progress progress;
};

/// The CAD entity a surface node lies on.
enum class CadDimension : std::int8_t { None = -1, Vertex = 0, Edge = 1, Face = 2 };

/// Where each surface node lies on the base CAD, and how well. Rows follow Boundary::nodes.
struct Association {
  std::vector<CadDimension> dimension;
  std::vector<int> entity;                         ///< vertex, edge or face id of the base model; -1
  Eigen::Matrix<double, Eigen::Dynamic, 2, Eigen::RowMajor> uv;  ///< face: (u, v); edge: (t, 0)
  Eigen::VectorXd distance;                        ///< to that entity, millimetres
  Index vertex_nodes = 0, edge_nodes = 0, face_nodes = 0, unmatched_nodes = 0;
  double max_distance = 0;                         ///< millimetres
  double mean_distance = 0;
  double mesh_unit_mm = 1;                         ///< millimetres per mesh unit, given or detected
};

/// The surface of one variant. Rows follow Boundary::nodes.
struct SurfaceMorphResult {
  Points positions;                   ///< new node positions, in the mesh's unit
  double max_distance = 0;            ///< to the matched variant entity, millimetres
  double mean_distance = 0;
  std::vector<std::string> warnings;  ///< folded faces, fallbacks, sliding patches: one line each
};

/// Moves the surface nodes of a mesh from a base CAD model to its variants (Sieger et al. 2013,
/// sect. 4). Holds everything that depends on the base alone: association, sampled wires, and the
/// factorisations of the parameter warps.
class SurfaceMorph {
 public:
  /// Associates the mesh's surface with the base CAD. Throws AssociationError when it does not lie
  /// on it.
  SurfaceMorph(std::shared_ptr<const CadModel> base, const Mesh& mesh, const Boundary& boundary,
               SurfaceMorphOptions options = {});
  ~SurfaceMorph();
  SurfaceMorph(SurfaceMorph&&) noexcept;

  const Association& association() const;

  /// Computes the surface node positions on `variant`. `match` maps base to variant entities (see
  /// match_topology).
  SurfaceMorphResult morph(const CadModel& variant, const TopologyMatch& match) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace cadmorph
