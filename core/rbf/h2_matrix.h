#pragma once

#include <vector>

#include "core/archive.h"
#include "core/rbf/cluster_skeleton.h"
#include "core/rbf/kernel_sum.h"
#include "core/rbf/octree.h"

namespace cadmorph {

struct H2Options {
  Index leaf_size = 300;  ///< points in a leaf at most
  /// Balls interact by skeletons from a distance of r_a / separation + r_b on, r_a the larger.
  double separation = 0.6;
  double accuracy = 1e-6;  ///< tolerance at a node of radius R is accuracy * (h_min / R)^3
};

/// The matrix r^3 between N points in space as a nested low-rank (H2) form, kernel-independent. Its
/// error is absolute at each node, below what the local node spacing h can bear: preconditioning
/// amplifies rough errors by (R / h)^3. Made of the points alone; O(N) memory and time a product.
class H2Matrix {
 public:
  /// `spacing`: distance of each point to its nearest neighbour (or a shorter length to resolve).
  H2Matrix(const Eigen::Ref<const Eigen::MatrixXd>& points, const Eigen::VectorXd& spacing,
           H2Options options = {});

  /// The matrix that was stored.
  explicit H2Matrix(InputArchive& archive);
  void store(OutputArchive& archive) const;

  /// Returns A W for N x M weights; rows in the order of the given points. A column comes out the
  /// same whatever the others and the number of threads are.
  Eigen::MatrixXd multiply(const Eigen::MatrixXd& weights) const;

  /// Weights carried to the skeletons of all nodes, beside the weights in tree order: what targets
  /// elsewhere see of them.
  struct Sources {
    Eigen::MatrixXd weights;    ///< N x M, tree order
    Eigen::MatrixXd skeletons;  ///< skeleton points x M
  };
  Sources compress(const Eigen::MatrixXd& weights) const;

  const Octree& tree() const { return tree_; }
  const KernelSum& kernel() const { return sum_; }

  /// Skeleton rows of a node: [skeleton_begin, skeleton_begin + rank); rank 0: no skeleton.
  Index skeleton_begin(int node) const { return skeleton_begin_[node]; }
  Index rank(int node) const { return skeleton_begin_[node + 1] - skeleton_begin_[node]; }
  const Eigen::MatrixXd& skeleton_points() const { return skeleton_points_; }

 private:
  void find_interactions(int a, int b, double separation);
  void find_skeletons(const Eigen::VectorXd& spacing, const H2Options& options);
  void expand(Eigen::MatrixXd& potentials, Eigen::MatrixXd& result) const;
  Index candidate_begin(int node) const;
  Index candidate_count(int node) const;

  Octree tree_;
  KernelSum sum_{Kernel::triharmonic_3d()};
  std::vector<std::vector<int>> far_;   // nodes seen through skeletons
  std::vector<std::vector<int>> near_;  // leaves summed directly
  std::vector<ClusterSkeleton> skeletons_;
  std::vector<Index> skeleton_begin_;
  Eigen::MatrixXd skeleton_points_;
};

}  // namespace cadmorph
