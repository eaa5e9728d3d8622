#pragma once

#include <array>
#include <span>
#include <vector>

#include "volume/free_nodes.h"
#include "volume/node_blocks.h"

namespace cadmorph {

/// How far triangles of the surface with nodes that slide are from their shapes of reference: with
/// F the map from there and r = |F|^2 / (2 det F), which is 1 where F keeps all angles (the inverse
/// mean ratio; Knupp, Algebraic mesh quality metrics, 2001), the sum of 16 r^p. Tetrahedra may have
/// good shapes where it is large. (Of hexahedra and wedges the scaled Jacobian has the angles of
/// their facets.)
class TriangleShape {
 public:
  /// Of the `triangles`, ids, with a node that moves; `reference`: N x 3.
  TriangleShape(std::span<const std::array<Index, 3>> triangles, const Points& reference,
                const FreeNodes& free);

  bool is_empty() const { return triangles_.empty(); }

  /// The sum at `positions` (N x 3), for p = 2^doublings; O(triangles), as the others are.
  /// Infinite where one is flat.
  double evaluate(const Points& positions, int doublings);
  /// Adds `factor` times the slopes there by the unknowns, over p.
  void add_slopes(const FreeNodes& free, double factor, Eigen::VectorXd& gradient) const;
  /// Adds a guess of the second derivatives of log(sum) / p there, where `sum` has all summands.
  void add_blocks(const FreeNodes& free, double sum, std::vector<NodeBlocks::Block>& blocks) const;

 private:
  struct Triangle {
    std::array<Index, 3> nodes;
    Eigen::Matrix2d metric;  ///< inverse of that of two edges in the reference
    double area;             ///< twice the triangle's there
    double summand = 0;
    /// Of the logarithm of the summand over p, by the nodes' positions: columns.
    Eigen::Matrix3d slopes = Eigen::Matrix3d::Zero();
    /// One over the heights over the other two nodes, squared.
    Eigen::Vector3d squares = Eigen::Vector3d::Zero();
  };
  std::vector<Triangle> triangles_;
  double power_ = 1;  ///< p
};

}  // namespace cadmorph
