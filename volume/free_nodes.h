#pragma once

#include <vector>

#include "core/mesh.h"
#include "core/sliding_nodes.h"
#include "volume/mid_nodes.h"

namespace cadmorph {

/// The unknowns of a repair: three coordinates of each node that moves freely, two of each that
/// slides. Nodes in the middle of others may follow these.
class FreeNodes {
 public:
  /// `nodes`: ids, ascending; `sliding`, where not null, tells which of them slide.
  FreeNodes(Index node_count, const std::vector<Index>& nodes, const SlidingNodes* sliding);

  /// Has `followers`, as numbers of `mid_nodes`, none of `nodes`, follow their corners.
  void let_follow(const MidNodes& mid_nodes, const std::vector<Index>& followers);
  bool has_followers() const { return !followers_.empty(); }
  bool follows(Index node) const { return local_[node] <= kFollows; }
  /// Of an energy's slope by the position of a node that follows, that by the mean of its corners.
  Eigen::RowVector3d by_corners(Index node, const Eigen::RowVector3d& slope) const {
    return slope * carried_[kFollows - local_[node]];
  }

  Index count() const { return static_cast<Index>(nodes_.size()); }
  Index node(Index i) const { return nodes_[i].id; }
  bool contains(Index node) const { return local_[node] >= 0; }
  /// i of node(i).
  Index place_of(Index node) const { return local_[node]; }

  /// What slides; null where nothing does.
  const SlidingNodes* sliding() const { return sliding_; }

  /// The unknowns at `positions` (N x 3) and `slides` (a row for each of SlidingNodes::nodes).
  Eigen::VectorXd start(const Points& positions, const RowMatrix& slides) const;

  /// Puts the nodes where the unknowns say, and those that follow.
  void move(const Eigen::VectorXd& x, Points& positions);

  /// Reads the sliding nodes' coordinates from the unknowns.
  void read_slides(const Eigen::VectorXd& x, RowMatrix& slides) const;

  /// Adds to the derivative by the unknowns of node(i) that by its position, where it was last
  /// moved to.
  void add_slope(Index i, const Eigen::Vector3d& slope, Eigen::VectorXd& gradient) const;

  /// Second derivatives by the position of node(i), where it was last moved to, as those by its
  /// unknowns_of(i) unknowns, the first of which is first_unknown(i): in the first rows and
  /// columns.
  Eigen::Matrix3d by_unknowns(Index i, const Eigen::Matrix3d& hessian) const;
  int unknowns_of(Index i) const { return nodes_[i].slide < 0 ? 3 : 2; }
  Index first_unknown(Index i) const { return nodes_[i].first; }

  Index unknowns() const { return unknowns_; }

 private:
  struct Node {
    Index id, first;  ///< its unknowns start at `first`
    Index slide;      ///< row of SlidingNodes::nodes; -1: moves freely
  };

  static constexpr Index kFollows = -2;

  const SlidingNodes* sliding_;
  const MidNodes* mid_nodes_ = nullptr;
  std::vector<MidNodes::Follower> followers_;
  std::vector<Eigen::Matrix3d> carried_;  ///< what MidNodes::follow returned of each
  RowMatrix slides_;                      ///< rows of the followers that slide
  std::vector<Node> nodes_;
  std::vector<Index> local_;  ///< row of nodes_, of a mesh node; kFollows - i for a follower i
  std::vector<Eigen::Matrix<double, 3, 2>> tangents_;
  Index unknowns_ = 0;
};

}  // namespace cadmorph
