#pragma once

#include <memory>
#include <vector>

#include "core/rbf/box_tree.h"
#include "core/rbf/simd.h"
#include "core/types.h"

namespace cadmorph {

/// Sums of Wendland's C2 function (1 - r)^4 (4 r + 1), r = |x - x_j| / support < 1, over points in
/// space. The sum at a target is the same to the last bit whatever targets are beside it, on any
/// number of threads and any processor, as those of ExactSum are.
class CompactSum {
 public:
  /// `points`: N x 3, N >= 1.
  CompactSum(const Points& points, double support, simd::InstructionSet set = simd::best());

  /// The sums over the same points with another support.
  CompactSum with_support(double support) const;

  double support() const { return support_; }

  /// Returns the sums at T x 3 targets, T x M, for coefficients N x M. Parallel; costs what lies
  /// within the support, and least where targets close together follow each other
  /// (spatial_order).
  Eigen::MatrixXd operator()(const Eigen::Ref<const Eigen::MatrixXd>& targets,
                             const Eigen::Ref<const Eigen::MatrixXd>& coefficients) const;

 private:
  friend class CompactMatrix;
  template <class Near>
  Eigen::MatrixXd sum(const Eigen::Ref<const Eigen::MatrixXd>& targets,
                      const Eigen::MatrixXd& weights, const Near& near) const;
  Eigen::MatrixXd in_tree_order(const Eigen::Ref<const Eigen::MatrixXd>& rows) const;

  std::shared_ptr<const BoxTree> tree_;
  std::shared_ptr<const Eigen::MatrixXd> points_;  // in the order of the tree
  double support_;
  simd::InstructionSet set_;
};

/// The matrix of such sums at the points themselves, for many products: remembers which points lie
/// near each other.
class CompactMatrix {
 public:
  /// `sum` must outlive it.
  explicit CompactMatrix(const CompactSum& sum);

  /// Returns the products with N x M coefficients, to the last bit those of the sum.
  Eigen::MatrixXd operator*(const Eigen::Ref<const Eigen::MatrixXd>& coefficients) const;

 private:
  const CompactSum& sum_;
  std::vector<std::vector<Index>> near_;  // sources of each tile of points
};

/// Returns the rows of points (T x 3) along a curve that keeps neighbours together. O(T log T).
std::vector<Index> spatial_order(const Eigen::Ref<const Eigen::MatrixXd>& points);

}  // namespace cadmorph
