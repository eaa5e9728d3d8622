#pragma once

#include <vector>

#include "core/types.h"

namespace cadmorph {

/// Points from coarse to fine.
struct PointOrder {
  std::vector<Index> rows;         ///< a permutation of the points
  std::vector<double> separation;  ///< distance of each to those before it; infinite for the first

  template <class Archive>
  void serialize(Archive& archive) {
    archive(rows, separation);
  }
};

/// Orders points so that each is the farthest from those before it (Gonzalez 1985). Exact;
/// O(N log N) in practice. `separation` does not increase.
PointOrder farthest_point_order(const Points& points);

/// Reorders points that are in farthest-point order, for the sparse factor: a maximal simplex of
/// `simplex` points (at most 4) first; then leaders, whose separation is at least half the distance
/// to their third nearest neighbour, each with its followers directly behind it, closest first. On
/// two sheets with a gap far below their node spacing the second sheet follows the first, so that
/// the difference across the gap is ordered from coarse to fine too. Returns the new order of the
/// rows.
std::vector<Index> leader_follower_order(const Points& points,
                                         const std::vector<double>& separation, int simplex);

}  // namespace cadmorph
