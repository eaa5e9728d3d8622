#include "volume/loose_nodes.h"

#include <Eigen/Dense>
#include <Eigen/SparseCholesky>
#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "core/kd_tree.h"
#include "core/least_squares.h"

namespace cadmorph {
namespace {

using Eigen::Matrix3d;
using Eigen::RowVector3d;

// The power of the inverse distance that nodes weigh by, so that the nearest alone count: nodes 1.2
// times as far as the nearest weigh 0.003. From near the middle of a hole that is all of its rim;
// from far off a larger power counts what lies up to an edge of the mesh behind the nearest.
constexpr double kPower = 32;
constexpr Index kRing = 7;           // a node and those an edge from it: six amid triangles
constexpr double kNoWeight = 3e-3;   // nodes that weigh less are left out
constexpr double kRounding = 1e-12;  // of the mesh's size: less is no motion
// Of the mesh's size: what a map fitted to the motion may miss.
constexpr double kAffine = 1e-7;
// Of the spread of what is fitted: directions in which it has none, to rounding, do not turn.
constexpr double kFlat = 1e-9;
// Of the distance's square: with less spread in a direction, as across the plane of a ring, the
// nodes' motion is taken for a rigid one there. In its plane a ring seen from its middle has 0.5.
// The tests pass with a tenth and ten times as much, and with 4 or 14 for kRing.
constexpr double kRigid = 3e-3;

struct AffineMap {
  Matrix3d linear = Matrix3d::Identity();
  RowVector3d shift = RowVector3d::Zero();
  RowVector3d operator()(const RowVector3d& x) const { return x * linear + shift; }
};

// Of least squares, from the rows of `from` to those of `to`; that of the smallest turn, where
// several are.
AffineMap rigid_map(const Points& from, const Points& to) {
  const RowVector3d from_middle = from.colwise().mean(), to_middle = to.colwise().mean();
  const Points x = from.rowwise() - from_middle, y = to.rowwise() - to_middle;
  AffineMap map;
  if (from.rows() > 1) {
    const RotationFit fit = fit_rotation(y.transpose() * x);
    const double flat = kFlat * x.squaredNorm();
    if (fit.singular_values(1) > flat)
      map.linear = fit.rotation.transpose();
    else if (fit.singular_values(0) > flat)
      map.linear = rotation_between(fit.from, fit.to).transpose();
  }
  map.shift = to_middle - from_middle * map.linear;
  return map;
}

class LooseNodes {
 public:
  LooseNodes(const Mesh& mesh, const Boundary& boundary, Points surface, Points& positions)
      : mesh_(mesh), boundary_(boundary), positions_(positions), after_(std::move(surface)) {}

  void carry() {
    find_loose();
    if (nodes_.empty()) return;
    before_ = mesh_.points(boundary_.nodes, Eigen::all);
    tree_.emplace(RowMatrix(before_));
    at_rest_ = kRounding * (before_.colwise().maxCoeff() - before_.colwise().minCoeff()).norm();
    find_inner();
    find_ties();
    if (nodes_.empty()) return;
    whole_ = affine_map();
    find_lines();
    Points moves(std::ssize(nodes_), 3);  // beyond the field's
    for (std::size_t i = 0; i < nodes_.size(); ++i) {
      const auto tied = tied_.find(nodes_[i]);
      if (tied != tied_.end())
        moves.row(i) = tied->second - positions_.row(nodes_[i]);
      else if (is_end_[i])
        moves.row(i) = carried(mesh_.points.row(nodes_[i])) - positions_.row(nodes_[i]);
    }
    spread_along_lines(moves);
    for (std::size_t i = 0; i < nodes_.size(); ++i) positions_.row(nodes_[i]) += moves.row(i);
    tie_to_loose();
    for (const auto& [node, position] : tied_) positions_.row(node) = position;
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
    for (std::size_t i = 0; i < nodes_.size(); ++i) number_[nodes_[i]] = static_cast<Index>(i);
  }

  void find_inner() {
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
    is_inner_.assign(number_.size(), 0);
    for (const Index node : nodes_) {
      const RowVector3d x = mesh_.points.row(node);
      const Index row = tree_->nearest(x.data(), 1)[0].index;
      is_inner_[node] = normals.row(boundary_.nodes[row]).dot(x - before_.row(row)) < 0;
    }
  }

  // Within solids the field holds: bars in concrete. But for some nodes.
  template <class IsKept>
  void leave_inner(const IsKept& is_kept) {
    std::erase_if(nodes_, [&](Index node) { return is_inner_[node] && !is_kept(node); });
    std::ranges::fill(number_, -1);
    for (std::size_t i = 0; i < nodes_.size(); ++i) number_[nodes_[i]] = static_cast<Index>(i);
  }

  // Those that hang on the surface, or on what moves with the field.
  void find_ties() {
    std::vector<const Tie*> ties;
    for (const Tie& tie : mesh_.ties)
      if (std::ranges::any_of(tie.others, [&](Index other) { return other != tie.node; }))
        ties.push_back(&tie);
    for (const Tie* tie : ties)
      if (number_[tie->node] >= 0) ties_[tie->node].own.push_back(tie);
    leave_inner([&](Index node) { return ties_.contains(node); });
    std::set<Index> waiting;
    for (const Tie* tie : ties) {
      const auto add = [&](Index node) {
        if (number_[node] < 0) return;
        waiting.insert(node);
        std::vector<const Tie*>& all = ties_[node].all;
        if (all.empty() || all.back() != tie) all.push_back(tie);
      };
      add(tie->node);
      std::ranges::for_each(tie->others, add);
    }
    follow_ties(std::move(waiting));
    leave_inner([&](Index node) { return tied_.contains(node); });
  }

  // Places one after another the nodes whose ties lead to nodes that do not wait.
  void follow_ties(std::set<Index> waiting) {
    const auto is_known = [&](Index node) { return !waiting.contains(node); };
    const auto is_ready = [&](Index node) {
      const std::vector<const Tie*>& own = ties_[node].own;
      return !own.empty() && std::ranges::all_of(own, [&](const Tie* tie) {
        return std::ranges::all_of(tie->others,
                                   [&](Index other) { return other == node || is_known(other); });
      });
    };
    while (!waiting.empty()) {
      std::vector<Index> next;
      std::ranges::copy_if(waiting, std::back_inserter(next), is_ready);
      // What is tied is a body: where some of it is known the rest goes along.
      const bool is_stuck = next.empty();
      if (is_stuck) next.assign(waiting.begin(), waiting.end());
      std::map<std::vector<const Tie*>, std::optional<AffineMap>> maps;
      std::vector<std::pair<Index, RowVector3d>> placed;
      for (const Index node : next) {
        const std::vector<const Tie*>& ties = is_stuck ? ties_[node].all : ties_[node].own;
        const auto [map, is_new] = maps.try_emplace(ties);
        if (is_new) map->second = motion_of(ties, is_known);
        if (map->second) placed.emplace_back(node, (*map->second)(mesh_.points.row(node)));
      }
      if (placed.empty()) return;
      for (const auto& [node, position] : placed) {
        tied_[node] = position;
        waiting.erase(node);
      }
    }
  }

  // Of the nodes of ties that are known, none where no such is.
  template <class IsKnown>
  std::optional<AffineMap> motion_of(const std::vector<const Tie*>& ties,
                                     const IsKnown& is_known) const {
    std::vector<Index> nodes;
    for (const Tie* tie : ties) {
      if (is_known(tie->node)) nodes.push_back(tie->node);
      std::ranges::copy_if(tie->others, std::back_inserter(nodes), is_known);
    }
    if (nodes.empty()) return {};
    std::ranges::sort(nodes);
    nodes.erase(std::ranges::unique(nodes).begin(), nodes.end());
    const Points from = mesh_.points(nodes, Eigen::all);
    Points to(std::ssize(nodes), 3);
    for (std::size_t i = 0; i < nodes.size(); ++i) to.row(i) = position_of(nodes[i]);
    const bool is_at_rest = (to - from).rowwise().norm().maxCoeff() <= at_rest_;
    return is_at_rest ? AffineMap() : rigid_map(from, to);
  }

  RowVector3d position_of(Index node) const {
    if (const auto tied = tied_.find(node); tied != tied_.end()) return tied->second;
    const auto row = std::ranges::lower_bound(boundary_.nodes, node);
    if (row != boundary_.nodes.end() && *row == node)
      return after_.row(row - boundary_.nodes.begin());
    return positions_.row(node);
  }

  // Those that hang on nothing but loose nodes, which are placed by now.
  void tie_to_loose() {
    std::set<Index> waiting;
    for (std::size_t i = 0; i < nodes_.size(); ++i) {
      const auto ties = ties_.find(nodes_[i]);
      if (ties != ties_.end() && !ties->second.own.empty() && !tied_.contains(nodes_[i]) &&
          !is_on_line_[i])
        waiting.insert(nodes_[i]);
    }
    follow_ties(std::move(waiting));
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

  // Neighbours along lines; a node of none, at the end of one, or placed by a tie, is an end.
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
    is_on_line_.resize(nodes_.size());
    for (std::size_t i = 0; i < nodes_.size(); ++i) {
      is_end_[i] = degree[i] <= 1 || tied_.contains(nodes_[i]);
      is_on_line_[i] = degree[i] > 0;
    }
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
  Points after_;                ///< of the surface
  std::vector<Index> nodes_;    ///< loose ones
  std::vector<Index> number_;   ///< of each node in these, -1
  std::vector<char> is_inner_;  ///< of each node
  Points before_;               ///< of the surface
  std::optional<KdTree> tree_;
  double at_rest_ = 0;  ///< motion that is none
  AffineMap whole_;
  std::vector<std::pair<Index, Index>> links_;  ///< the second may be a node of the surface: -1
  std::vector<char> is_end_, is_on_line_;

  struct Ties {
    std::vector<const Tie*> own, all;  ///< whose node one is, and those that name it
  };
  std::map<Index, Ties> ties_;         ///< of loose nodes
  std::map<Index, RowVector3d> tied_;  ///< where ties put nodes
};

}  // namespace

void carry_loose_nodes(const Mesh& mesh, const Boundary& boundary, const Points& surface,
                       Points& positions) {
  LooseNodes(mesh, boundary, surface, positions).carry();
}

}  // namespace cadmorph
