#pragma once

#include "core/rbf/kernel.h"
#include "core/rbf/simd.h"
#include "core/types.h"

namespace cadmorph {

/// Sums of a kernel over sources in space whose result for a target is the same to the last bit
/// whatever targets are beside it and whatever vector instructions the processor has: IEEE
/// operations alone, in the order of the sources, no fused ones. Slower than KernelSum. Kernels
/// with an exponential or a logarithm are as reproducible as the C library.
class ExactSum {
 public:
  /// `kernel` in the unit of the coordinates.
  explicit ExactSum(const Kernel& kernel, simd::InstructionSet set = simd::best());

  /// out(i, c) += sum_j weights(j, c) phi(|targets(i) - sources(j)|): T x 3, S x 3, S x M, T x M.
  /// Serial.
  void add(const Eigen::Ref<const Eigen::MatrixXd>& targets,
           const Eigen::Ref<const Eigen::MatrixXd>& sources,
           const Eigen::Ref<const Eigen::MatrixXd>& weights, Eigen::Ref<Eigen::MatrixXd> out) const;

 private:
  Kernel kernel_;
  simd::InstructionSet set_;
};

/// Returns the linear function with constant a(0, :) and slopes a(1..3, :) at T x 3 points, T x M,
/// as reproducible as an ExactSum.
Eigen::MatrixXd exact_linear(const Eigen::MatrixXd& a,
                             const Eigen::Ref<const Eigen::MatrixXd>& points);

}  // namespace cadmorph
