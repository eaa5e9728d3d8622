#pragma once

#include <vector>

#include "core/rbf/kernel.h"
#include "core/types.h"

namespace cadmorph {

/// A level of compactly supported functions (see MultiscaleCorrection).
struct CorrectionLevel {
  double support = 0;
  RowMatrix points, coefficients;

  template <class Archive>
  void serialize(Archive& archive) {
    archive(support, points, coefficients);
  }
};

/// A tree over centres in which far nodes act through the points of their skeletons.
struct SourceTree {
  struct Node {
    Eigen::RowVector3d centre;  ///< of the ball that holds the node's centres
    double radius;
    int first_child, child_count;        ///< none: a leaf
    Index begin, end;                    ///< range of centres
    Index skeleton_begin, skeleton_end;  ///< range of skeleton points; empty: none

    template <class Archive>
    void serialize(Archive& archive) {
      archive(centre, radius, first_child, child_count, begin, end, skeleton_begin, skeleton_end);
    }
  };
  std::vector<Node> nodes;  ///< the root first; empty: direct sums
  double separation = 0;    ///< a node is far when radius <= separation * distance
  Eigen::MatrixXd skeleton_points, skeleton_weights;

  template <class Archive>
  void serialize(Archive& archive) {
    archive(nodes, separation, skeleton_points, skeleton_weights);
  }
};

/// All numbers of an interpolant in space: what it takes to evaluate it elsewhere. Coordinates x
/// count as (x - origin) / unit throughout.
struct FieldTerms {
  Eigen::RowVector3d origin = Eigen::RowVector3d::Zero();
  double unit = 1;
  Kernel kernel;                     ///< of distances in units
  Eigen::MatrixXd centres, weights;  ///< N x 3, N x M
  Eigen::MatrixXd linear;            ///< 4 x M: constant, slopes
  SourceTree tree;
  std::vector<CorrectionLevel> correction;  ///< to be added

  template <class Archive>
  void serialize(Archive& archive) {
    archive(origin, unit, kernel, centres, weights, linear, tree, correction);
  }
};

}  // namespace cadmorph
