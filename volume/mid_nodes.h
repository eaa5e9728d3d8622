#pragma once

#include <functional>
#include <span>
#include <vector>

#include "core/mesh.h"
#include "core/quality.h"
#include "core/sliding_nodes.h"

namespace cadmorph {

/// Nodes of second-order cells that are no corners. Those that follow their corners go by the mean
/// of the ways of the corners of their edge, face or cell, so that an edge stays as straight as it
/// came; on a surface they go by what of that lies in the surface.
class MidNodes {
 public:
  MidNodes() = default;
  /// All of a mesh; `start` (N x 3): where ways begin.
  MidNodes(const Mesh& mesh, const Points& start);

  bool contains(Index node) const { return !is_mid_.empty() && is_mid_[node]; }

  Index count() const { return std::ssize(nodes_); }
  Index node(Index i) const { return nodes_[i]; }
  std::span<const Index> corners(Index i) const {
    return std::span(corners_).subspan(std::size_t(first_[i]),
                                       std::size_t(first_[i + 1] - first_[i]));
  }
  /// Mean of the positions (N x 3) of its corners.
  Eigen::RowVector3d middle(Index i, const Points& positions) const;

  /// Whether its edge, face or cell is straight there (N x 3), to a thousandth of an edge.
  bool is_amid(Index i, const Points& positions) const;

  /// Where each node (count() x 3) is with the corners at `positions` (N x 3): off their middle by
  /// what the affine maps of its cells, the mean of them, make of that at the start, which is
  /// `mesh.points`.
  Points carried(const Mesh& mesh, const Points& positions) const;

  /// How node i follows.
  struct Follower {
    Index mid;                                  ///< i
    Index slide = -1;                           ///< its row of SlidingNodes; -1: in space
    Eigen::Matrix<double, 3, 2> tangents = {};  ///< where it started
  };
  Follower follower(Index i, const SlidingNodes* sliding) const;
  /// Puts it where the positions (N x 3) of its corners carry it; sets its row of `slides`. Returns
  /// the derivative of its place by that way.
  Eigen::Matrix3d follow(const Follower& follower, const SlidingNodes* sliding, Points& positions,
                         RowMatrix& slides) const;

 private:
  Eigen::RowVector3d offset(Index i) const { return start_[i] - corner_start_[i]; }

  std::vector<char> is_mid_;  ///< of all nodes; empty where there are none
  std::vector<Index> nodes_;
  std::vector<Index> first_ = {0}, corners_;
  std::vector<Eigen::RowVector3d> start_;         ///< of each node
  std::vector<Eigen::RowVector3d> corner_start_;  ///< mean of its corners
};

/// The mesh with linear cells in place of those of second order whose edges are straight at `start`
/// and at `now` (N x 3) and stay so: the same maps of fewer nodes. Cells that have a node which
/// `may_bend` tells stay as they are. Cells keep their numbers.
Mesh with_linear_cells(const Mesh& mesh, const MidNodes& mid_nodes, const Points& start,
                       const Points& now, const std::function<bool(Index node)>& may_bend = {});

/// Puts the nodes amid edges where the corners at `positions` (N x 3) have them (MidNodes::carried,
/// from `mesh.points` on): those that slide at the place of their surface or edge below, their rows
/// of `slides` with them, others that are fixed (`is_fixed`, N) at `plain` (N x 3).
void lay_mid_nodes(const Mesh& mesh, const std::vector<char>& is_fixed, const SlidingNodes& sliding,
                   const Points& plain, Points& positions, RowMatrix& slides);

/// With the types of corners_alone oriented as those that they are in place of.
Orientation orientation_of_corners(const Mesh& mesh, const Orientation& orientation);

}  // namespace cadmorph
