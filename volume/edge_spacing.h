#pragma once

#include <span>
#include <vector>

#include "volume/free_nodes.h"
#include "volume/node_blocks.h"

namespace cadmorph {

/// How uneven nodes that slide along edges are spaced: with r the length of a segment over what it
/// was to start with, the sum of ((r^2 + 1 / r^2) / 2)^2p. Cells may have good shapes where it is
/// large: rims become polygons, blocks thin slices.
class EdgeSpacing {
 public:
  /// Of the `segments` with an end that slides.
  EdgeSpacing(std::span<const EdgeSegment> segments, const FreeNodes& free);

  bool is_empty() const { return segments_.empty(); }

  /// The sum at `positions` (N x 3), for p = 2^doublings; O(segments), as the others are.
  double evaluate(const Points& positions, int doublings);
  /// Adds `factor` times the slopes there by the unknowns, over p.
  void add_slopes(const FreeNodes& free, double factor, Eigen::VectorXd& gradient) const;
  /// Adds a guess of the second derivatives of log(sum) / p there, where `sum` has all summands.
  void add_blocks(const FreeNodes& free, double sum, std::vector<NodeBlocks::Block>& blocks) const;

 private:
  struct Segment {
    EdgeSegment ends;
    double summand = 0;
    Eigen::Vector3d slope =
        Eigen::Vector3d::Zero();  ///< of the logarithm of the summand over p, by the position of b
    double square = 0;            ///< one over its length now
  };
  std::vector<Segment> segments_;
  double power_ = 1;  ///< p
};

}  // namespace cadmorph
