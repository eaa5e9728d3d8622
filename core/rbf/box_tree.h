#pragma once

#include <array>
#include <vector>

#include "core/kd_tree.h"
#include "core/types.h"

namespace cadmorph {

/// A kd-tree over points in space with its boxes laid open: for searches that `KdTree` does not
/// offer.
class BoxTree {
 public:
  struct Node {
    std::array<double, 3> low, high;  ///< bounding box of the points below
    Index begin, end;                 ///< range of positions
    int left, right;                  ///< children, or -1 in leaves
  };

  /// Builds the tree over the first `count` >= 1 points.
  BoxTree(const Points& points, Index count);

  const std::vector<Node>& nodes() const { return nodes_; }  ///< root first
  Index row(Index position) const { return rows_[position]; }
  const double* point(Index position) const { return points_.row(position).data(); }
  Index size() const { return points_.rows(); }

  /// Returns the min(k, available) nearest points with a row below `limit`, closest first, equal
  /// distances in the order of their rows.
  std::vector<Neighbour> nearest_before(const double* query, Index k, Index limit) const;

 private:
  int build(const Points& points, Index begin, Index end);
  struct Search;
  void search(int node, double squared_distance, Search& state) const;

  std::vector<Node> nodes_;
  std::vector<Index> rows_;
  Points points_;
};

/// Squared distance of a point to a node's box.
double squared_distance(const BoxTree::Node& node, const double* point);

}  // namespace cadmorph
