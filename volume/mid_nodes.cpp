#include "volume/mid_nodes.h"

#include <algorithm>
#include <array>
#include <optional>
#include <utility>

#include "core/cell_topology.h"
#include "core/least_squares.h"

namespace cadmorph {
namespace {

// Of an edge: what the node amid a straight one may be off. Where a circle has 100 edges it is
// 8e-3.
constexpr double kStraight = 1e-3;

// Of row vectors: the one nearest to the motion of these nodes, both N x 3.
Eigen::Matrix3d affine_map(std::span<const Index> nodes, const Points& from, const Points& to) {
  Eigen::RowVector3d centre = Eigen::RowVector3d::Zero(), centre_to = centre;
  for (const Index node : nodes) {
    centre += from.row(node) / double(nodes.size());
    centre_to += to.row(node) / double(nodes.size());
  }
  Eigen::Matrix3d square = Eigen::Matrix3d::Zero(), product = square;
  for (const Index node : nodes) {
    const Eigen::RowVector3d d = from.row(node) - centre;
    square += d.transpose() * d;
    product += d.transpose() * (to.row(node) - centre_to);
  }
  return small_least_squares(square, product);
}

}  // namespace

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

bool MidNodes::is_amid(Index i, const Points& positions) const {
  const double size = (positions.row(corners(i).front()) - positions.row(corners(i).back())).norm();
  return (positions.row(nodes_[i]) - middle(i, positions)).norm() <= kStraight * size;
}

Points MidNodes::carried(const Mesh& mesh, const Points& positions) const {
  std::vector<Index> number(std::size_t(mesh.node_count()), -1);
  for (Index i = 0; i < count(); ++i) number[nodes_[i]] = i;
  Points offsets = Points::Zero(count(), 3);
  std::vector<int> cells(std::size_t(count()), 0);
  const int highest = dimension(mesh);
  for (Index c = 0; c < mesh.cell_count(); ++c) {
    const CellInfo& info = info_of(mesh.types[c]);
    if (info.mid_nodes == 0 || info.dimension < highest) continue;
    const auto nodes = mesh.cell(c), corners = nodes.first(std::size_t(info.corners));
    const Eigen::Matrix3d map = affine_map(corners, mesh.points, positions);
    for (const Index node : nodes.subspan(corners.size())) {
      const Index i = number[node];
      offsets.row(i) += offset(i) * map;
      ++cells[std::size_t(i)];
    }
  }
  Points result(count(), 3);
  for (Index i = 0; i < count(); ++i)
    result.row(i) = middle(i, positions) + offsets.row(i) / std::max(cells[std::size_t(i)], 1);
  return result;
}

MidNodes::Follower MidNodes::follower(Index i, const SlidingNodes* sliding) const {
  Follower result{i};
  result.slide = find_slider(sliding, nodes_[i]);
  if (result.slide >= 0)
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

Mesh with_linear_cells(const Mesh& mesh, const MidNodes& mid_nodes, const Points& start,
                       const Points& now, const std::function<bool(Index node)>& may_bend) {
  std::vector<char> is_straight(std::size_t(mesh.node_count()), 1);
  for (Index i = 0; i < mid_nodes.count(); ++i) {
    const Index node = mid_nodes.node(i);
    is_straight[node] =
        !(may_bend && may_bend(node)) && mid_nodes.is_amid(i, start) && mid_nodes.is_amid(i, now);
  }
  Mesh result = mesh;
  keep_corners(result.types, result.offsets, result.connectivity, [&](Index c) {
    return std::ranges::all_of(mesh.cell(c), [&](Index node) { return is_straight[node]; });
  });
  return result;
}

Orientation orientation_of_corners(const Mesh& mesh, const Orientation& orientation) {
  Orientation result = orientation;
  for (const CellType type : mesh.types)
    result[std::size_t(linear_type(type))] = orientation[std::size_t(type)];
  return result;
}

void lay_mid_nodes(const Mesh& mesh, const std::vector<char>& is_fixed, const SlidingNodes& sliding,
                   const Points& plain, Points& positions, RowMatrix& slides) {
  const MidNodes mid_nodes(mesh, mesh.points);
  const Points places = mid_nodes.carried(mesh, positions);
  for (Index i = 0; i < mid_nodes.count(); ++i) {
    const Index node = mid_nodes.node(i), row = mid_nodes.follower(i, &sliding).slide;
    if (row < 0) {
      positions.row(node) = is_fixed[node] ? plain.row(node) : places.row(i);
      continue;
    }
    const Eigen::Vector2d slide =
        slide_below(sliding, row, slides.row(row).transpose(), places.row(i).transpose());
    if (slide.allFinite() && sliding.is_within(row, slide)) slides.row(row) = slide.transpose();
    positions.row(node) = sliding.at(row, slides.row(row).transpose()).point.transpose();
  }
}

}  // namespace cadmorph
