#include "volume/free_nodes.h"

#include <algorithm>

#include "core/parallel.h"

namespace cadmorph {

using Eigen::VectorXd;

FreeNodes::FreeNodes(Index node_count, const std::vector<Index>& nodes, const SlidingNodes* sliding)
    : sliding_(sliding), local_(node_count, -1), tangents_(nodes.size()) {
  for (const Index node : nodes) {
    local_[node] = static_cast<Index>(nodes_.size());
    const Index slide = find_slider(sliding, node);
    nodes_.push_back({node, unknowns_, slide});
    unknowns_ += slide < 0 ? 3 : 2;
  }
}

void FreeNodes::let_follow(const MidNodes& mid_nodes, const std::vector<Index>& followers) {
  mid_nodes_ = &mid_nodes;
  if (sliding_) slides_ = sliding_->slides;
  for (const Index i : followers) {
    local_[mid_nodes.node(i)] = kFollows - std::ssize(followers_);
    followers_.push_back(mid_nodes.follower(i, sliding_));
  }
  carried_.assign(followers_.size(), Eigen::Matrix3d::Identity());
}

VectorXd FreeNodes::start(const Points& positions, const RowMatrix& slides) const {
  VectorXd x(unknowns_);
  for (const Node& node : nodes_)
    if (node.slide < 0)
      x.segment<3>(node.first) = positions.row(node.id).transpose();
    else
      x.segment<2>(node.first) = slides.row(node.slide).transpose();
  return x;
}

void FreeNodes::move(const VectorXd& x, Points& positions) {
  parallel_for(static_cast<Index>(nodes_.size()), 256, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) {
      const Node& node = nodes_[i];
      if (node.slide < 0) {
        positions.row(node.id) = x.segment<3>(node.first).transpose();
        continue;
      }
      const SlidePlace place = sliding_->at(node.slide, x.segment<2>(node.first));
      positions.row(node.id) = place.point.transpose();
      tangents_[i] = place.tangents;
    }
  });
  parallel_for(std::ssize(followers_), 256, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i)
      carried_[i] = mid_nodes_->follow(followers_[i], sliding_, positions, slides_);
  });
}

void FreeNodes::read_slides(const VectorXd& x, RowMatrix& slides) const {
  for (const Node& node : nodes_)
    if (node.slide >= 0) slides.row(node.slide) = x.segment<2>(node.first).transpose();
  for (const MidNodes::Follower& follower : followers_)
    if (follower.slide >= 0) slides.row(follower.slide) = slides_.row(follower.slide);
}

void FreeNodes::add_slope(Index i, const Eigen::Vector3d& slope, VectorXd& gradient) const {
  if (nodes_[i].slide < 0)
    gradient.segment<3>(nodes_[i].first) += slope;
  else
    gradient.segment<2>(nodes_[i].first) += tangents_[i].transpose() * slope;
}

Eigen::Matrix3d FreeNodes::by_unknowns(Index i, const Eigen::Matrix3d& hessian) const {
  if (nodes_[i].slide < 0) return hessian;
  Eigen::Matrix3d result = Eigen::Matrix3d::Zero();
  result.topLeftCorner<2, 2>() = tangents_[i].transpose() * hessian * tangents_[i];
  return result;
}

}  // namespace cadmorph
