#include "volume/mid_nodes.h"

#include <algorithm>
#include <array>
#include <optional>
#include <utility>

#include "core/cell_topology.h"

namespace cadmorph {
MidNodes::MidNodes(const Mesh& mesh, const Points& start) {
  std::array<std::optional<std::vector<LocalMidNode>>, 256> of_type;
  for (Index c = 0; c < mesh.cell_count(); ++c) {
    auto& local = of_type[static_cast<std::size_t>(mesh.types[c])];
    if (!local) local = mid_nodes_of(mesh.types[c]);
    const auto nodes = mesh.cell(c);
    for (const LocalMidNode& mid : *local) {
      const Index node = nodes[std::size_t(mid.node)];
      if (is_mid_.empty()) is_mid_.assign(std::size_t(mesh.node_count()), 0);
      if (std::exchange(is_mid_[node], 1)) continue;
      nodes_.push_back(node);
      for (const int corner : mid.corners) corners_.push_back(nodes[std::size_t(corner)]);
      first_.push_back(std::ssize(corners_));
    }
  }
  for (Index i = 0; i < count(); ++i) {
    start_.emplace_back(start.row(nodes_[i]));
    corner_start_.push_back(middle(i, start));
  }
}

Eigen::RowVector3d MidNodes::middle(Index i, const Points& positions) const {
  const auto nodes = corners(i);
  Eigen::RowVector3d sum = Eigen::RowVector3d::Zero();
  for (const Index node : nodes) sum += positions.row(node);
  return sum / double(nodes.size());
}

MidNodes::Follower MidNodes::follower(Index i, const SlidingNodes* sliding) const {
  Follower result{i};
  if (!sliding) return result;
  const auto found = std::ranges::lower_bound(sliding->nodes, nodes_[i]);
  if (found == sliding->nodes.end() || *found != nodes_[i]) return result;
  result.slide = found - sliding->nodes.begin();
  result.tangents =
      sliding->at(result.slide, sliding->slides.row(result.slide).transpose()).tangents;
  return result;
}

Eigen::Matrix3d MidNodes::follow(const Follower& follower, const SlidingNodes* sliding,
                                 Points& positions, RowMatrix& slides) const {
  const Index i = follower.mid;
  const Eigen::RowVector3d way = middle(i, positions) - corner_start_[i];
  if (follower.slide < 0) {
    positions.row(nodes_[i]) = start_[i] + way;
    return Eigen::Matrix3d::Identity();
  }
  slides.row(follower.slide) = sliding->slides.row(follower.slide) + way * follower.tangents;
  const SlidePlace place = sliding->at(follower.slide, slides.row(follower.slide).transpose());
  positions.row(nodes_[i]) = place.point.transpose();
  return place.tangents * follower.tangents.transpose();
}

}  // namespace cadmorph
