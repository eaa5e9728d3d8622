#pragma once

#include <vector>

#include "cad/brep.h"
#include "surface/association.h"
#include "surface/surface_mesh.h"

namespace cadmorph {

/// A face with the parameters of its nodes, and the positions of all rows of the surface mesh.
struct FaceSide {
  const CadModel& model;
  int face;
  const Parameters& uv;
  const Points& points;
};

/// Facets of a face that look to the wrong side of its surface, or turn a corner inwards, `after`
/// and not `before`; ascending. `rows`: of the nodes that lie on the face, ascending.
std::vector<Index> find_folds(const SurfaceMesh& surface, const std::vector<int>& facets,
                              const std::vector<int>& rows, const FaceSide& before,
                              const FaceSide& after);

}  // namespace cadmorph
