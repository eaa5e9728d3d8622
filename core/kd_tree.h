#pragma once

#include <memory>
#include <vector>

#include "core/types.h"

namespace cadmorph {

/// A point found by a KdTree query.
struct Neighbour {
  Index index;              ///< row of the tree's points
  double squared_distance;  ///< squared Euclidean distance to the query point
};

/// A kd-tree over fixed points (nanoflann). Queries are thread-safe.
class KdTree {
 public:
  /// Builds the tree over N x D points, D >= 1, N >= 1; keeps its own copy. O(N log N).
  /// Throws InvalidInputError on an empty or non-finite set.
  explicit KdTree(const RowMatrix& points);
  ~KdTree();
  KdTree(KdTree&&) noexcept;
  KdTree& operator=(KdTree&&) noexcept;

  /// Returns the min(k, N) nearest points to `query` (D values), closest first; equal distances in
  /// the order of their index.
  std::vector<Neighbour> nearest(const double* query, Index k) const;

  /// Returns all points within `radius` (not squared) of `query`, closest first.
  std::vector<Neighbour> within(const double* query, double radius) const;

  Index size() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// The square of the spacing of a tree's points at one of them (D values): the distance to its
/// third neighbour, for the nearest may lie across a thin gap.
double squared_spacing(const KdTree& tree, const double* point);

/// Returns the distance (not squared) of each point to its nearest other one, for at least two
/// points (N x D); parallel.
Eigen::VectorXd nearest_distances(const RowMatrix& points);

}  // namespace cadmorph
