#include "volume/node_blocks.h"

#include <Eigen/LU>
#include <algorithm>

#include "core/parallel.h"

namespace cadmorph {
namespace {

using Eigen::Matrix3d;
using Eigen::VectorXd;

constexpr Index kGrain = 1024;  // nodes a task
// Parts that make blocks invertible: of the largest block where no energy holds a node, of a node's
// own where it has no way across, as on an edge. The gradient vanishes there, too, so that any part
// does that is small and far above rounding.
constexpr double kLeastOfAll = 1e-9;
constexpr double kLeastOfOwn = 1e-6;

}  // namespace

NodeBlocks::NodeBlocks(const FreeNodes& free, const std::vector<Block>& blocks)
    : nodes_(blocks.size()) {
  double most = 0;
  for (const Block& block : blocks) most = std::max(most, block.hessian.trace());
  parallel_for(std::ssize(blocks), kGrain, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) {
      Matrix3d hessian = free.by_unknowns(i, blocks[i].hessian);
      const int count = free.unknowns_of(i);
      auto own = hessian.topLeftCorner(count, count);
      own.diagonal().array() += kLeastOfOwn * own.trace() + kLeastOfAll * most;
      nodes_[i] = {free.first_unknown(i), count, blocks[i].reach, Matrix3d::Zero()};
      if (count == 3)
        nodes_[i].inverse = hessian.inverse();
      else
        nodes_[i].inverse.topLeftCorner<2, 2>() = hessian.topLeftCorner<2, 2>().inverse();
    }
  });
}

VectorXd NodeBlocks::solve(const VectorXd& vector) const {
  VectorXd result(vector.size());
  parallel_for(std::ssize(nodes_), kGrain, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) {
      const auto& [first, count, reach, inverse] = nodes_[i];
      if (count == 3)
        result.segment<3>(first) = inverse * vector.segment<3>(first);
      else
        result.segment<2>(first) = inverse.topLeftCorner<2, 2>() * vector.segment<2>(first);
    }
  });
  return result;
}

void NodeBlocks::shorten(VectorXd& step) const {
  for (const Inverse& node : nodes_) {
    auto own = step.segment(node.first, node.count);
    const double length = own.norm();
    if (length > node.reach) own *= node.reach / length;
  }
}

}  // namespace cadmorph
