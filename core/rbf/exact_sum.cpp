// Compiled without contraction of products and sums (see CMakeLists.txt).

#include "core/rbf/exact_sum.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "core/rbf/register.h"

namespace cadmorph {
namespace {

constexpr int kTile = 16;  // targets that are summed together

struct Task {
  const double* sources;
  Index source_stride, source_count;
  const double* weights;
  Index weight_stride;
  int factors;  // the kernel is r^(2 factors + 1)
};

// Sums for one tile of targets x (3 x kTile) and M columns into out (M x kTile).
template <int Bytes, int M>
CADMORPH_INLINE void sum_tile(const Task& t, const double* x, const double* weights, double* out) {
  using Vec = typename Register<Bytes>::Vec;
  constexpr int kLanes = Register<Bytes>::kLanes, kUnroll = kTile / kLanes;
  Vec place[kUnroll][3], sum[kUnroll][M];
  for (int u = 0; u < kUnroll; ++u) {
    for (int d = 0; d < 3; ++d) std::memcpy(&place[u][d], x + d * kTile + u * kLanes, sizeof(Vec));
    for (int m = 0; m < M; ++m) sum[u][m] = Vec{};
  }
  for (Index j = 0; j < t.source_count; ++j)
    for (int u = 0; u < kUnroll; ++u) {
      const Vec dx = place[u][0] - t.sources[j];
      const Vec dy = place[u][1] - t.sources[j + t.source_stride];
      const Vec dz = place[u][2] - t.sources[j + 2 * t.source_stride];
      const Vec r2 = dx * dx + dy * dy + dz * dz;
      Vec value = r2;
      take_root(value);
      for (int i = 0; i < t.factors; ++i) value *= r2;
      for (int m = 0; m < M; ++m) sum[u][m] += value * weights[m * t.weight_stride + j];
    }
  for (int m = 0; m < M; ++m)
    for (int u = 0; u < kUnroll; ++u)
      std::memcpy(out + m * kTile + u * kLanes, &sum[u][m], sizeof(Vec));
}

template <int Bytes>
CADMORPH_INLINE void sum_columns(const Task& t, const double* x, Index columns, double* out) {
  Index m = 0;
  for (; m + 3 <= columns; m += 3)
    sum_tile<Bytes, 3>(t, x, t.weights + m * t.weight_stride, out + m * kTile);
  for (; m < columns; ++m)
    sum_tile<Bytes, 1>(t, x, t.weights + m * t.weight_stride, out + m * kTile);
}

void sum_plain(const Task& t, const double* x, Index columns, double* out) {
  sum_columns<16>(t, x, columns, out);
}

using TileSum = void (*)(const Task&, const double*, Index, double*);

#if defined(__x86_64__)
__attribute__((target("avx2"))) void sum_avx2(const Task& t, const double* x, Index columns,
                                              double* out) {
  sum_columns<32>(t, x, columns, out);
}

__attribute__((target("avx512f"))) void sum_avx512(const Task& t, const double* x, Index columns,
                                                   double* out) {
  sum_columns<64>(t, x, columns, out);
}
#endif

TileSum tile_sum(simd::InstructionSet set) {
#if defined(__x86_64__)
  if (set == simd::InstructionSet::Avx512) return sum_avx512;
  if (set == simd::InstructionSet::Avx2) return sum_avx2;
#endif
  (void)set;
  return sum_plain;
}

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
  const Task task{.sources = sources.data(),
                  .source_stride = sources.outerStride(),
                  .source_count = sources.rows(),
                  .weights = weights.data(),
                  .weight_stride = weights.outerStride(),
                  .factors = (2 * kernel_.order - kernel_.dimension - 1) / 2};
  const TileSum sum = tile_sum(set_);
  double x[3 * kTile];
  Eigen::MatrixXd values(kTile, out.cols());
  for (Index begin = 0; begin < targets.rows(); begin += kTile) {
    const Index count = std::min<Index>(kTile, targets.rows() - begin);
    // The last tile is filled up: every target goes through the same instructions.
    for (int d = 0; d < 3; ++d)
      for (Index i = 0; i < kTile; ++i)
        x[d * kTile + i] = targets(begin + std::min(i, count - 1), d);
    sum(task, x, out.cols(), values.data());
    out.middleRows(begin, count) += values.topRows(count);
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
