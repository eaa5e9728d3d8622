#pragma once

#include <span>
#include <vector>

#include "volume/free_nodes.h"
#include "volume/node_blocks.h"

namespace cadmorph {

/// How far facets with nodes that slide are from their shapes of reference: with F the map of a
/// corner's two edges from there and r = |F|^2 / (2 det F), which is 1 where F keeps all angles,
/// the sum of the means over a facet's corners of 16 r^p. Where it is large, cells may have good
/// shapes on a surface whose facets have none.
class FacetShape {
 public:
  /// Of the `corners` of facets with a node that slides; `reference`: N x 3.
  FacetShape(std::span<const FacetCorner> corners, const Points& reference, const FreeNodes& free);

  bool is_empty() const { return corners_.empty(); }

  /// The sum at `positions` (N x 3), for p = 2^doublings; O(corners), as the others are. Infinite
  /// where a corner is flat.
  double evaluate(const Points& positions, int doublings);
  /// Adds `factor` times the slopes there by the unknowns, over p.
  void add_slopes(const FreeNodes& free, double factor, Eigen::VectorXd& gradient) const;
  /// Adds a guess of the second derivatives of log(sum) / p there, where `sum` has all summands.
  void add_blocks(const FreeNodes& free, double sum, std::vector<NodeBlocks::Block>& blocks) const;

 private:
  struct Corner {
    FacetCorner of;
    Eigen::Matrix2d metric;  ///< inverse of that of the two edges in the reference
    double area;             ///< that they span there
    double summand = 0;
    /// Of the logarithm of the summand over p, by the positions of the three nodes: columns.
    Eigen::Matrix3d slopes = Eigen::Matrix3d::Zero();
    /// One over the heights of the triangle of the three nodes, squared.
    Eigen::Vector3d squares = Eigen::Vector3d::Zero();
  };
  std::vector<Corner> corners_;
  double power_ = 1;  ///< p
};

}  // namespace cadmorph
