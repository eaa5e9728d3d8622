#include "volume/loose_nodes.h"

#include <Eigen/Dense>
#include <Eigen/SparseCholesky>
#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "core/kd_tree.h"
#include "core/least_squares.h"

namespace cadmorph {
namespace {

using Eigen::Matrix3d;
using Eigen::RowVector3d;

// Of the inverse distance, so that the nearest nodes alone count: all round a hole seen from near
// its middle; from far off no more than what lies an edge of the mesh behind the nearest.
constexpr double kPower = 32;
constexpr Index kRing = 7;           // a node and those an edge from it
constexpr double kNoWeight = 3e-3;   // nodes that weigh less are left out
constexpr double kRounding = 1e-12;  // of the mesh's size
// Of the mesh's size: what a map fitted to the motion may miss.
constexpr double kAffine = 1e-7;
// Of the spread of what is fitted: directions in which it has none do not turn.
constexpr double kFlat = 1e-9;
// Of the distance's square: with less spread in a direction, as across the plane of a ring, the
// nodes' motion is taken for a rigid one there.
constexpr double kRigid = 3e-3;

struct AffineMap {
  Matrix3d linear = Matrix3d::Identity();
  RowVector3d shift = RowVector3d::Zero();
  RowVector3d operator()(const RowVector3d& x) const { return x * linear + shift; }
};

class LooseNodes {
 public:
  LooseNodes(const Mesh& mesh, const Boundary& boundary, Points surface, Points& positions)
      : mesh_(mesh), boundary_(boundary), positions_(positions), after_(std::move(surface)) {}

  void carry() {
    find_loose();
    if (nodes_.empty()) return;
    before_ = mesh_.points(boundary_.nodes, Eigen::all);
    tree_.emplace(RowMatrix(before_));
    leave_inner();
    if (nodes_.empty()) return;
    at_rest_ = kRounding * (before_.colwise().maxCoeff() - before_.colwise().minCoeff()).norm();
    whole_ = affine_map();
    find_lines();
    Points moves(std::ssize(nodes_), 3);  // beyond the field's
    for (std::size_t i = 0; i < nodes_.size(); ++i)
      if (is_end_[i])
        moves.row(i) = carried(mesh_.points.row(nodes_[i])) - positions_.row(nodes_[i]);
    spread_along_lines(moves);
    for (std::size_t i = 0; i < nodes_.size(); ++i) positions_.row(nodes_[i]) += moves.row(i);
  }

 private:
  void find_loose() {
    number_.assign(static_cast<std::size_t>(mesh_.node_count()), -1);
    std::vector<char> is_used(static_cast<std::size_t>(mesh_.node_count()), 0);
    for (Index c = 0; c < mesh_.cell_count(); ++c)
      if (dimension(mesh_.types[c]) >= 2)
        for (const Index node : mesh_.cell(c)) is_used[node] = 1;
    for (Index n = 0; n < mesh_.node_count(); ++n)
      if (!is_used[n]) nodes_.push_back(n);
  }

  // Within solids the field holds: bars in concrete.
  void leave_inner() {
    Points normals = Points::Zero(mesh_.node_count(), 3);
    for (Index f = 0; f < boundary_.facet_count(); ++f) {
      if (boundary_.neighbour[f] >= 0 || dimension(mesh_.types[boundary_.cell[f]]) < 3) continue;
      const auto facet = boundary_.facet(f);
      const int corners = corner_count(boundary_.types[f], std::ssize(facet));
      RowVector3d area = RowVector3d::Zero();
      for (int i = 1; i + 1 < corners; ++i)
        area += (mesh_.points.row(facet[i]) - mesh_.points.row(facet[0]))
                    .cross(mesh_.points.row(facet[i + 1]) - mesh_.points.row(facet[0]));
      for (int i = 0; i < corners; ++i) normals.row(facet[i]) += area;
    }
    std::erase_if(nodes_, [&](Index node) {
      const RowVector3d x = mesh_.points.row(node);
      const Index row = tree_->nearest(x.data(), 1)[0].index;
      return normals.row(boundary_.nodes[row]).dot(x - before_.row(row)) < 0;
    });
    for (std::size_t i = 0; i < nodes_.size(); ++i) number_[nodes_[i]] = static_cast<Index>(i);
  }

  AffineMap affine_map() const {
    const RowVector3d from = before_.colwise().mean(), to = after_.colwise().mean();
    const Points x = before_.rowwise() - from, y = after_.rowwise() - to;
    const double spread = x.squaredNorm();
    // Across a plane it is the identity.
    const Matrix3d square = x.transpose() * x + kFlat * spread * Matrix3d::Identity();
    AffineMap map;
    map.linear = square.ldlt().solve(x.transpose() * y + kFlat * spread * Matrix3d::Identity());
    map.shift = to - from * map.linear;
    const double missed = (x * map.linear - y).rowwise().norm().maxCoeff();
    return missed <= kAffine * std::sqrt(spread) ? map : AffineMap();
  }

  // Where the surface's nodes nearest to a place carry it. What they do beyond a translation counts
  // as far as they reach themselves, and fades beyond with the square of the distance.
  RowVector3d carried(const RowVector3d& x) const {
    const Neighbour first = tree_->nearest(x.data(), 1)[0];
    const double nearest = std::sqrt(first.squared_distance);
    const RowVector3d foot = before_.row(first.index);
    const double edge = std::sqrt(tree_->nearest(foot.data(), kRing).back().squared_distance);
    const double power = edge > 0 ? std::max(kPower, nearest / edge) : kPower;
    const std::vector<Neighbour> near =
        tree_->within(x.data(), nearest * std::pow(kNoWeight, -1 / power));
    const bool is_at_rest = std::ranges::all_of(near, [&](const Neighbour& one) {
      return (after_.row(one.index) - before_.row(one.index)).norm() <= at_rest_;
    });
    if (is_at_rest) return x;
    if (nearest == 0) return after_.row(first.index);
    double sum = 0;
    RowVector3d from = RowVector3d::Zero(), to = RowVector3d::Zero();
    const auto weight = [&](const Neighbour& one) {
      return std::pow(nearest / std::sqrt(one.squared_distance), power);
    };
    for (const Neighbour& one : near) {
      const double w = weight(one);
      sum += w;
      from += w * whole_(before_.row(one.index));
      to += w * after_.row(one.index);
    }
    from /= sum;
    to /= sum;
    Matrix3d spread = Matrix3d::Zero(), product = Matrix3d::Zero();
    for (const Neighbour& one : near) {
      const RowVector3d way = whole_(before_.row(one.index)) - from;
      spread += weight(one) * way.transpose() * way;
      product += weight(one) * way.transpose() * (after_.row(one.index) - to);
    }
    const double size = sum * nearest * nearest;
    // Of row vectors.
    const Matrix3d covariance = product + kFlat * size * Matrix3d::Identity();
    const Matrix3d turn = fit_rotation(covariance.transpose()).rotation.transpose();
    // A ring that grows keeps its middle, but what is above it comes no nearer.
    const Matrix3d map = (spread + kRigid * size * Matrix3d::Identity())
                             .ldlt()
                             .solve(product + kRigid * size * turn);
    const RowVector3d lever = whole_(x) - from;
    const double share = std::min(1.0, spread.trace() / sum / lever.squaredNorm());
    return to + lever + share * lever * (map - Matrix3d::Identity());
  }

  // Neighbours along lines; a node of none, or at the end of one, is an end.
  void find_lines() {
    std::vector<int> degree(nodes_.size(), 0);
    for (Index c = 0; c < mesh_.cell_count(); ++c) {
      if (dimension(mesh_.types[c]) != 1) continue;
      const auto nodes = mesh_.cell(c);
      const auto link = [&](Index a, Index b) {
        if (number_[a] < 0) std::swap(a, b);
        if (number_[a] < 0 || a == b) return;
        links_.emplace_back(number_[a], number_[b]);
        ++degree[number_[a]];
        if (number_[b] >= 0) ++degree[number_[b]];
      };
      if (mesh_.types[c] == CellType::QuadraticEdge) {
        link(nodes[0], nodes[2]);
        link(nodes[2], nodes[1]);
      } else {
        for (std::size_t i = 1; i < nodes.size(); ++i) link(nodes[i - 1], nodes[i]);
      }
    }
    is_end_.resize(nodes_.size());
    for (std::size_t i = 0; i < nodes_.size(); ++i) is_end_[i] = degree[i] <= 1;
  }

  void spread_along_lines(Points& moves) const {
    const Index n = std::ssize(nodes_);
    std::vector<Eigen::Triplet<double>> entries;
    Points right = Points::Zero(n, 3);
    for (Index i = 0; i < n; ++i) {
      // What neither ends nor touches the surface stays with the field.
      entries.emplace_back(i, i, is_end_[i] ? 1 : kFlat);
      if (is_end_[i]) right.row(i) = moves.row(i);
    }
    for (const auto& [a, b] : links_) {
      const bool is_a_open = !is_end_[a], is_b_open = b >= 0 && !is_end_[b];
      if (is_a_open) entries.emplace_back(a, a, 1);
      if (is_b_open) entries.emplace_back(b, b, 1);
      if (is_a_open && is_b_open) {
        entries.emplace_back(a, b, -1);
        entries.emplace_back(b, a, -1);
      } else if (b >= 0 && is_a_open) {
        right.row(a) += moves.row(b);
      } else if (is_b_open) {
        right.row(b) += moves.row(a);
      }
    }
    Eigen::SparseMatrix<double> matrix(n, n);
    matrix.setFromTriplets(entries.begin(), entries.end());
    const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver(matrix);
    moves = solver.solve(right);
  }

  const Mesh& mesh_;
  const Boundary& boundary_;
  Points& positions_;
  Points after_;               ///< of the surface
  std::vector<Index> nodes_;   ///< loose ones
  std::vector<Index> number_;  ///< of each node in these, -1
  Points before_;              ///< of the surface
  std::optional<KdTree> tree_;
  double at_rest_ = 0;  ///< motion that is none
  AffineMap whole_;
  std::vector<std::pair<Index, Index>> links_;  ///< the second may be a node of the surface: -1
  std::vector<char> is_end_;
};

}  // namespace

void carry_loose_nodes(const Mesh& mesh, const Boundary& boundary, const Points& surface,
                       Points& positions) {
  LooseNodes(mesh, boundary, surface, positions).carry();
}

}  // namespace cadmorph
