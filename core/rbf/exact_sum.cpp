// Compiled without contraction of products and sums (see CMakeLists.txt).

#include "core/rbf/exact_sum.h"

#include <algorithm>
#include <cmath>

#include "core/rbf/tile_sum.h"

namespace cadmorph {
namespace {

// r^(2 factors + 1), of all sources.
struct OddPower {
  Index count;
  int factors;

  Index source_count() const { return count; }
  Index source(Index i) const { return i; }

  template <class Vec>
  CADMORPH_INLINE void evaluate(Vec& value) const {
    const Vec r2 = value;
    take_root(value);
    for (int i = 0; i < factors; ++i) value *= r2;
  }
};

bool is_odd_power(const Kernel& kernel) {
  return kernel.kind == KernelKind::Polyharmonic && kernel.dimension % 2 == 1;
}

void add_other(const Kernel& kernel, const Eigen::Ref<const Eigen::MatrixXd>& targets,
               const Eigen::Ref<const Eigen::MatrixXd>& sources,
               const Eigen::Ref<const Eigen::MatrixXd>& weights, Eigen::Ref<Eigen::MatrixXd> out) {
  for (Index i = 0; i < targets.rows(); ++i)
    for (Index j = 0; j < sources.rows(); ++j) {
      double r2 = 0;
      for (int d = 0; d < 3; ++d) {
        const double difference = targets(i, d) - sources(j, d);
        r2 += difference * difference;
      }
      const double value = kernel(std::sqrt(r2));
      for (Index m = 0; m < out.cols(); ++m) out(i, m) += value * weights(j, m);
    }
}

}  // namespace

ExactSum::ExactSum(const Kernel& kernel, simd::InstructionSet set)
    : kernel_(kernel), set_(std::min(set, simd::best())) {}

void ExactSum::add(const Eigen::Ref<const Eigen::MatrixXd>& targets,
                   const Eigen::Ref<const Eigen::MatrixXd>& sources,
                   const Eigen::Ref<const Eigen::MatrixXd>& weights,
                   Eigen::Ref<Eigen::MatrixXd> out) const {
  if (!is_odd_power(kernel_)) return add_other(kernel_, targets, sources, weights, out);
  const OddPower kernel{sources.rows(), (2 * kernel_.order - kernel_.dimension - 1) / 2};
  const WeightedPoints from{sources.data(), sources.outerStride(), weights.data(),
                            weights.outerStride()};
  Eigen::MatrixXd values(kTile, out.cols());
  for (Index begin = 0; begin < targets.rows(); begin += kTile) {
    const TargetTile tile(targets, begin);
    sum_tile(set_, kernel, from, tile, out.cols(), values.data());
    out.middleRows(begin, tile.count) += values.topRows(tile.count);
  }
}

Eigen::MatrixXd exact_linear(const Eigen::MatrixXd& a,
                             const Eigen::Ref<const Eigen::MatrixXd>& points) {
  Eigen::MatrixXd result(points.rows(), a.cols());
  for (Index m = 0; m < a.cols(); ++m)
    for (Index i = 0; i < points.rows(); ++i) {
      double value = a(0, m);
      for (int d = 0; d < 3; ++d) value += points(i, d) * a(1 + d, m);
      result(i, m) = value;
    }
  return result;
}

}  // namespace cadmorph
