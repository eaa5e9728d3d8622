#pragma once

#include <optional>
#include <span>
#include <vector>

#include "core/boundary.h"
#include "core/kd_tree.h"

namespace cadmorph {

/// The mean of some nodes' positions.
Eigen::Vector3d centre_of(std::span<const Index> nodes, const Points& positions);

/// Finds the CAD face nearest to a point: the one that the facet with the nearest centre lies on.
class NearestFace {
 public:
  /// `facet_face`: see Association; `positions` (N x 3) of the mesh's nodes.
  NearestFace(const Boundary& boundary, const std::vector<int>& facet_face,
              const Points& positions);

  /// The number of the face in `facet_face`; -1 where no facet lies on any.
  int operator()(const Eigen::Vector3d& x) const;

 private:
  std::vector<int> faces_;  // one a facet in the tree
  std::optional<KdTree> tree_;
};

}  // namespace cadmorph
