#pragma once

#include <utility>

#include "core/rbf/kernel.h"
#include "core/rbf/simd.h"
#include "core/types.h"

namespace cadmorph {

/// Rows of a column-major matrix, without a copy.
using ColumnsView = Eigen::Ref<const Eigen::MatrixXd>;

using simd::InstructionSet;

/// Name as printed in reports: "baseline", "AVX2", "AVX-512".
const char* name(InstructionSet set);

/// A matrix in twice the precision: as rounded, and what that leaves out.
struct MatrixPair {
  Eigen::MatrixXd high, low;

  MatrixPair() = default;
  explicit MatrixPair(Eigen::MatrixXd values)
      : high(std::move(values)), low(Eigen::MatrixXd::Zero(high.rows(), high.cols())) {}

  Eigen::MatrixXd rounded() const { return high + low; }
  MatrixPair& operator+=(const MatrixPair& other);
  MatrixPair& operator-=(const MatrixPair& other);
};

/// Sums of a kernel over sources, for points in coordinates of about unit size (polyharmonic values
/// below r = 1e-100 count as zero).
class KernelSum {
 public:
  /// `log_scale` is added to the logarithm of even polyharmonics: of r in units of exp(-log_scale).
  /// Throws InvalidInputError for a polyharmonic kernel with 2 k <= d, which is singular at 0, and
  /// for a shape that is not positive.
  explicit KernelSum(const Kernel& kernel, double log_scale = 0, InstructionSet set = simd::best());

  /// out(i, c) += sum_j weights(j, c) phi(|targets(i) - sources(j)|): T x D, S x D, S x M, T x M.
  /// Serial; D at most 8.
  void add(const ColumnsView& targets, const ColumnsView& sources, const ColumnsView& weights,
           Eigen::Ref<Eigen::MatrixXd> out) const;

  /// Returns the sums, T x M, computed on all threads. The result does not depend on their number.
  Eigen::MatrixXd operator()(const ColumnsView& targets, const ColumnsView& sources,
                             const ColumnsView& weights) const;

  /// Returns the sums in twice the precision, T x M, on all threads: weights may be large and
  /// cancel. The kernel's values are doubles, the same when targets and sources change places, so
  /// that sums over the ones at the others are those of a matrix and its transpose.
  MatrixPair pairs(const ColumnsView& targets, const ColumnsView& sources,
                   const MatrixPair& weights) const;

  /// Returns phi(|x_i - x_j|), N x N, on all threads.
  Eigen::MatrixXd matrix(const ColumnsView& points) const;

 private:
  simd::SumTask task(const ColumnsView& targets, const ColumnsView& sources,
                     const ColumnsView& weights) const;

  Kernel kernel_;
  double log_scale_;
  InstructionSet set_;
};

}  // namespace cadmorph
