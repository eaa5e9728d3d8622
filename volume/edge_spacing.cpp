#include "volume/edge_spacing.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace cadmorph {
namespace {

// Of a segment's length: the farthest that an end goes at once, so that half of it is left where
// both come towards each other.
constexpr double kReach = 0.25;

}  // namespace

EdgeSpacing::EdgeSpacing(std::span<const EdgeSegment> segments, const FreeNodes& free) {
  for (const EdgeSegment& segment : segments)
    if ((free.contains(segment.a) || free.contains(segment.b)) && segment.length > 0)
      segments_.push_back({segment});
}

double EdgeSpacing::evaluate(const Points& positions, int doublings) {
  power_ = double(1 << doublings);
  double sum = 0;
  for (Segment& segment : segments_) {
    const Eigen::Vector3d way = positions.row(segment.ends.b) - positions.row(segment.ends.a);
    const double square = way.squaredNorm(), start = segment.ends.length * segment.ends.length;
    const double r = square / start, measure = (r + 1 / r) / 2;
    segment.summand = std::pow(measure, 2 * power_);
    segment.slope = 2 * (1 - 1 / (r * r)) / (start * measure) * way;
    segment.square = 1 / square;
    sum += segment.summand;
  }
  return sum;
}

void EdgeSpacing::add_slopes(const FreeNodes& free, double factor,
                             Eigen::VectorXd& gradient) const {
  for (const Segment& segment : segments_) {
    const Eigen::Vector3d slope = factor * segment.summand * segment.slope;
    if (free.contains(segment.ends.a))
      free.add_slope(free.place_of(segment.ends.a), -slope, gradient);
    if (free.contains(segment.ends.b))
      free.add_slope(free.place_of(segment.ends.b), slope, gradient);
  }
}

void EdgeSpacing::add_blocks(const FreeNodes& free, double sum,
                             std::vector<NodeBlocks::Block>& blocks) const {
  for (const Segment& segment : segments_) {
    const double share = segment.summand / sum;
    // 8 / length^2: the second derivative of the logarithm of a summand over p, where r is 1.
    const Eigen::Matrix3d hessian = share * (power_ * segment.slope * segment.slope.transpose() +
                                             8 * segment.square * Eigen::Matrix3d::Identity());
    for (const Index node : {segment.ends.a, segment.ends.b}) {
      if (!free.contains(node)) continue;
      NodeBlocks::Block& block = blocks[std::size_t(free.place_of(node))];
      block.hessian += hessian;
      block.reach = std::min(block.reach, kReach / std::sqrt(segment.square));
    }
  }
}

}  // namespace cadmorph
