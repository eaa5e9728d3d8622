#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <functional>
#include <vector>

#include "core/mesh.h"

namespace cadmorph {

/// Where a node that slides has come to.
struct SlidePlace {
  Eigen::Vector3d point;                 ///< in the mesh's unit
  Eigen::Matrix<double, 3, 2> tangents;  ///< derivatives of the point by the two coordinates
};

/// Two nodes next to each other on an edge.
struct EdgeSegment {
  Index a, b;     ///< ids, a < b
  double length;  ///< where they start
};

/// Nodes that may slide along surfaces. Each has two coordinates of its own, lengths in the mesh's
/// unit: (0, 0) is where the node starts, where its tangents are orthonormal.
struct SlidingNodes {
  std::vector<Index> nodes;  ///< ids, ascending
  RowMatrix slides;          ///< K x 2: the coordinates where they are now

  /// The place of nodes[i] at `slide`; of any number of threads at once.
  std::function<SlidePlace(Index i, const Eigen::Vector2d& slide)> at;

  /// The parameters of nodes[i] on its surface there, (u, v), or on its edge, (t, 0).
  std::function<Eigen::Vector2d(Index i, const Eigen::Vector2d& slide)> parameters;

  /// Whether nodes[i] is still within its surface's bounds there.
  std::function<bool(Index i, const Eigen::Vector2d& slide)> is_within;

  std::vector<EdgeSegment> segments;  ///< of the edges with nodes that slide
  /// Of the surface, with corners that slide: ids.
  std::vector<std::array<Index, 3>> triangles;

  /// The i of a node's nodes[i]; -1 where it does not slide.
  Index find(Index node) const {
    const auto found = std::ranges::lower_bound(nodes, node);
    return found != nodes.end() && *found == node ? found - nodes.begin() : -1;
  }
};

/// The same; -1 where none slides, which null says.
inline Index find_slider(const SlidingNodes* sliding, Index node) {
  return sliding ? sliding->find(node) : -1;
}

/// The coordinates of nodes[i] at the foot of the perpendicular from `point` to its surface or
/// edge, by Newton's method from `slide` on.
Eigen::Vector2d slide_below(const SlidingNodes& sliding, Index i, Eigen::Vector2d slide,
                            const Eigen::Vector3d& point);

}  // namespace cadmorph
