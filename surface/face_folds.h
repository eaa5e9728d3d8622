#pragma once

#include <vector>

#include "cad/brep.h"
#include "surface/association.h"
#include "surface/surface_mesh.h"

namespace cadmorph {

/// A face with the parameters of its nodes, and the positions of all rows of the surface mesh.
struct FaceSide {
  const CadModel& model;
  FaceId face;
  const Parameters& uv;
  const Points& points;
};

/// Tells the folds that moved nodes make of a face, by how its facets look before: found once for
/// all motions.
class FaceFolds {
 public:
  FaceFolds() = default;
  /// `facets` of the face, `rows` of the nodes that lie on it, ascending.
  FaceFolds(const SurfaceMesh& surface, const std::vector<FacetId>& facets,
            const std::vector<RowId>& rows, const FaceSide& before);

  /// Facets that look to the wrong side of the surface, or turn a corner inwards, `after` and not
  /// before; ascending. `surface` as before.
  std::vector<FacetId> find(const SurfaceMesh& surface, const FaceSide& after) const;

 private:
  /// A node by which a facet is judged.
  struct Witness {
    int node = 0;  ///< of the face's
    bool looks_out = false;
  };
  struct Facet {
    FacetId facet;
    int inward_corners = 0;
    int first = 0;  ///< of its witnesses, which follow each other up to those of the next
  };
  std::vector<Facet> facets_;
  std::vector<Witness> witnesses_;
};

}  // namespace cadmorph
