#include "core/rbf/kernel_sum.h"

#include <algorithm>
#include <cmath>

#include "core/errors.h"
#include "core/large_matrix.h"
#include "core/parallel.h"

namespace cadmorph {
namespace {

// Of points, whose coordinates the sums hold in arrays: fields have 2 or 3.
constexpr int kMaxDimension = 8;
constexpr Index kTargetBlock = 256;   // output stays in the first-level cache
constexpr Index kSourceBlock = 1024;  // sources and weights stay in the second-level cache

simd::Form form_of(const Kernel& kernel, double log_scale) {
  switch (kernel.kind) {
    case KernelKind::Gaussian:
      return simd::Form::Gaussian;
    case KernelKind::Multiquadric:
      return simd::Form::Multiquadric;
    case KernelKind::InverseMultiquadric:
      return simd::Form::InverseMultiquadric;
    case KernelKind::WendlandC2:
      return simd::Form::WendlandC2;
    case KernelKind::WendlandC4:
      return simd::Form::WendlandC4;
    case KernelKind::Polyharmonic:
      break;
  }
  const int exponent = 2 * kernel.order - kernel.dimension;
  if (kernel.dimension % 2 == 1) return exponent == 3 ? simd::Form::Cubic : simd::Form::OddPower;
  return exponent == 2 && log_scale == 0 ? simd::Form::ThinPlate : simd::Form::EvenPowerLog;
}

// The sum of two doubles, and what its rounding leaves out (Knuth).
void add_with_error(double& sum, double& low, double value) {
  const double before = sum;
  sum += value;
  const double added = sum - before;
  low += (before - (sum - added)) + (value - added);
}

}  // namespace

MatrixPair& MatrixPair::operator+=(const MatrixPair& other) {
  for (Index i = 0; i < high.size(); ++i)
    add_with_error(high.data()[i], low.data()[i], other.high.data()[i]);
  low += other.low;
  return *this;
}

MatrixPair& MatrixPair::operator-=(const MatrixPair& other) {
  for (Index i = 0; i < high.size(); ++i)
    add_with_error(high.data()[i], low.data()[i], -other.high.data()[i]);
  low -= other.low;
  return *this;
}

const char* name(InstructionSet set) {
  switch (set) {
    case InstructionSet::Avx512:
      return "AVX-512";
    case InstructionSet::Avx2:
      return "AVX2";
    case InstructionSet::Baseline:
      break;
  }
  return "baseline";
}

KernelSum::KernelSum(const Kernel& kernel, double log_scale, InstructionSet set)
    : kernel_(kernel), log_scale_(log_scale), set_(std::min(set, simd::best())) {
  if (kernel.kind == KernelKind::Polyharmonic &&
      (kernel.dimension < 1 || 2 * kernel.order <= kernel.dimension))
    throw InvalidInputError("polyharmonic kernel of order " + std::to_string(kernel.order) +
                            " in dimension " + std::to_string(kernel.dimension) +
                            " is singular at its centre; use an order above half the dimension");
  if (kernel.kind != KernelKind::Polyharmonic && !(kernel.shape > 0 && std::isfinite(kernel.shape)))
    throw InvalidInputError("kernel shape parameter " + std::to_string(kernel.shape) +
                            " is not positive");
}

simd::SumTask KernelSum::task(const ColumnsView& targets, const ColumnsView& sources,
                              const ColumnsView& weights) const {
  if (targets.cols() > kMaxDimension)
    throw InvalidInputError("kernel sums in more than 8 dimensions are not supported");
  return {.form = form_of(kernel_, log_scale_),
          .exponent = 2 * kernel_.order - kernel_.dimension,
          .log_shift = log_scale_,
          .shape = kernel_.shape,
          .dimension = static_cast<int>(targets.cols()),
          .columns = static_cast<int>(weights.cols()),
          .targets = nullptr,
          .target_stride = targets.outerStride(),
          .target_count = 0,
          .sources = nullptr,
          .source_stride = sources.outerStride(),
          .source_count = 0,
          .weights = nullptr,
          .weight_stride = weights.outerStride(),
          .out = nullptr,
          .out_stride = 0};
}

void KernelSum::add(const ColumnsView& targets, const ColumnsView& sources,
                    const ColumnsView& weights, Eigen::Ref<Eigen::MatrixXd> out) const {
  simd::SumTask part = task(targets, sources, weights);
  part.out_stride = out.outerStride();
  const auto run = simd::functions(set_).sum;
  for (Index i = 0; i < targets.rows(); i += kTargetBlock) {
    part.targets = targets.data() + i;
    part.target_count = std::min(kTargetBlock, targets.rows() - i);
    part.out = out.data() + i;
    for (Index j = 0; j < sources.rows(); j += kSourceBlock) {
      part.sources = sources.data() + j;
      part.weights = weights.data() + j;
      part.source_count = std::min(kSourceBlock, sources.rows() - j);
      run(part);
    }
  }
}

MatrixPair KernelSum::pairs(const ColumnsView& targets, const ColumnsView& sources,
                            const MatrixPair& weights) const {
  MatrixPair result(Eigen::MatrixXd::Zero(targets.rows(), weights.high.cols()));
  const auto run = simd::functions(set_).sum_pairs;
  parallel_for(targets.rows(), kTargetBlock, [&](Index begin, Index end) {
    simd::SumTask part = task(targets, sources, weights.high);
    part.targets = targets.data() + begin;
    part.target_count = end - begin;
    part.out = result.high.data() + begin;
    part.low_out = result.low.data() + begin;
    part.out_stride = result.high.outerStride();
    for (Index j = 0; j < sources.rows(); j += kSourceBlock) {
      part.sources = sources.data() + j;
      part.weights = weights.high.data() + j;
      part.low_weights = weights.low.data() + j;
      part.source_count = std::min(kSourceBlock, sources.rows() - j);
      run(part);
    }
  });
  return result;
}

Eigen::MatrixXd KernelSum::operator()(const ColumnsView& targets, const ColumnsView& sources,
                                      const ColumnsView& weights) const {
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(targets.rows(), weights.cols());
  parallel_for(targets.rows(), kTargetBlock, [&](Index begin, Index end) {
    add(targets.middleRows(begin, end - begin), sources, weights,
        out.middleRows(begin, end - begin));
  });
  return out;
}

Eigen::MatrixXd KernelSum::matrix(const ColumnsView& points) const {
  const Index n = points.rows();
  const Eigen::MatrixXd one = Eigen::MatrixXd::Ones(1, 1);
  Eigen::MatrixXd result = large_matrix(n, n);
  parallel_for(n, 32, [&](Index begin, Index end) {
    for (Index j = begin; j < end; ++j) {
      result.col(j).setZero();
      add(points, points.middleRows(j, 1), one, result.col(j));
    }
  });
  return result;
}

}  // namespace cadmorph
