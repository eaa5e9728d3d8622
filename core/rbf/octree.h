#pragma once

#include <vector>

#include "core/types.h"

namespace cadmorph {

/// An octree over points in space. Nodes are stored level by level, the children of a node
/// together.
struct Octree {
  struct Node {
    Index begin, end;           ///< range of tree positions
    int parent;                 ///< -1 for the root
    int first_child;            ///< node number
    int child_count;            ///< 0 for leaves
    Eigen::RowVector3d centre;  ///< middle of the bounding box of the points
    double radius;              ///< of the ball about the centre that holds the points

    bool is_leaf() const { return child_count == 0; }

    template <class Archive>
    void serialize(Archive& archive) {
      archive(begin, end, parent, first_child, child_count, centre, radius);
    }
  };

  std::vector<Node> nodes;
  std::vector<int> level_begin;  ///< first node of each level, and the number of nodes
  std::vector<Index> rows;       ///< row of the given points at each tree position
  Eigen::MatrixXd points;        ///< in tree order, N x 3

  int level_count() const { return static_cast<int>(level_begin.size()) - 1; }

  template <class Archive>
  void serialize(Archive& archive) {
    archive(nodes, level_begin, rows, points);
  }
};

/// Builds the tree over N x 3 points, splitting nodes of more than `leaf_size` points.
Octree build_octree(const Eigen::Ref<const Eigen::MatrixXd>& points, Index leaf_size);

}  // namespace cadmorph
