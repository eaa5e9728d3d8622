#pragma once

#include <optional>
#include <span>
#include <vector>

#include "cad/ids.h"
#include "core/boundary.h"
#include "core/kd_tree.h"
#include "surface/ids.h"

namespace cadmorph {

/// The mean of some nodes' positions.
Eigen::Vector3d centre_of(std::span<const Index> nodes, const Points& positions);

/// Finds the CAD face nearest to a point: the one that the facet with the nearest centre lies on.
class NearestFace {
 public:
  /// `facet_face`: see Association; `positions` (N x 3) of the mesh's nodes.
  NearestFace(const Boundary& boundary, const IdVector<FacetId, FaceId>& facet_face,
              const Points& positions);

  /// The face in `facet_face`; none where no facet lies on any.
  FaceId operator()(const Eigen::Vector3d& x) const;

 private:
  std::vector<FaceId> faces_;  // one a facet in the tree
  std::optional<KdTree> tree_;
};

}  // namespace cadmorph
