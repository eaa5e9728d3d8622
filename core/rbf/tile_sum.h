#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cstring>

#include "core/rbf/register.h"
#include "core/rbf/simd.h"
#include "core/types.h"

// For files that are compiled without contraction of products and sums (see CMakeLists.txt).

namespace cadmorph {

constexpr int kTile = 16;  ///< targets that are summed together: two of the widest registers

/// A tile of the targets from `begin` on. The last one is filled up: every target goes through the
/// same instructions.
struct TargetTile {
  TargetTile(const Eigen::Ref<const Eigen::MatrixXd>& targets, Index begin)
      : count(std::min<Index>(kTile, targets.rows() - begin)) {
    for (int d = 0; d < 3; ++d)
      for (Index i = 0; i < kTile; ++i)
        x[d * kTile + i] = targets(begin + std::min(i, count - 1), d);
  }

  Index count;
  double x[3 * kTile];
};

/// Points and their weights, each a row, by columns.
struct WeightedPoints {
  const double* points;
  Index point_stride;
  const double* weights;
  Index weight_stride;
};

namespace tile_sum_detail {

// M columns into out (kTile x M).
template <int Bytes, int M, class Kernel>
CADMORPH_INLINE void sum_some(const Kernel& kernel, const WeightedPoints& from, const double* x,
                              const double* weights, double* out) {
  using Vec = typename Register<Bytes>::Vec;
  constexpr int kLanes = Register<Bytes>::kLanes, kUnroll = kTile / kLanes;
  Vec place[kUnroll][3], sum[kUnroll][M];
  for (int u = 0; u < kUnroll; ++u) {
    for (int d = 0; d < 3; ++d) std::memcpy(&place[u][d], x + d * kTile + u * kLanes, sizeof(Vec));
    for (int m = 0; m < M; ++m) sum[u][m] = Vec{};
  }
  for (Index i = 0; i < kernel.source_count(); ++i) {
    const Index j = kernel.source(i);
    for (int u = 0; u < kUnroll; ++u) {
      const Vec dx = place[u][0] - from.points[j];
      const Vec dy = place[u][1] - from.points[j + from.point_stride];
      const Vec dz = place[u][2] - from.points[j + 2 * from.point_stride];
      Vec value = dx * dx + dy * dy + dz * dz;
      kernel.evaluate(value);
      for (int m = 0; m < M; ++m) sum[u][m] += value * weights[m * from.weight_stride + j];
    }
  }
  for (int m = 0; m < M; ++m)
    for (int u = 0; u < kUnroll; ++u)
      std::memcpy(out + m * kTile + u * kLanes, &sum[u][m], sizeof(Vec));
}

template <int Bytes, class Kernel>
CADMORPH_INLINE void sum_columns(const Kernel& kernel, const WeightedPoints& from, const double* x,
                                 Index columns, double* out) {
  Index m = 0;
  for (; m + 3 <= columns; m += 3)
    sum_some<Bytes, 3>(kernel, from, x, from.weights + m * from.weight_stride, out + m * kTile);
  for (; m < columns; ++m)
    sum_some<Bytes, 1>(kernel, from, x, from.weights + m * from.weight_stride, out + m * kTile);
}

#if defined(__x86_64__)
template <class Kernel>
__attribute__((target("avx2"))) void sum_avx2(const Kernel& kernel, const WeightedPoints& from,
                                              const double* x, Index columns, double* out) {
  sum_columns<32>(kernel, from, x, columns, out);
}

template <class Kernel>
__attribute__((target("avx512f"))) void sum_avx512(const Kernel& kernel, const WeightedPoints& from,
                                                   const double* x, Index columns, double* out) {
  sum_columns<64>(kernel, from, x, columns, out);
}
#endif

}  // namespace tile_sum_detail

/// Sums of weights times kernel at a tile's targets into out (kTile x columns), the same to the
/// last bit with every instruction set. `kernel` has source_count(), source(i), the row of a point,
/// and evaluate(value), which makes a register of squared distances one of values.
template <class Kernel>
void sum_tile(simd::InstructionSet set, const Kernel& kernel, const WeightedPoints& from,
              const TargetTile& tile, Index columns, double* out) {
  using namespace tile_sum_detail;
#if defined(__x86_64__)
  if (set == simd::InstructionSet::Avx512) return sum_avx512(kernel, from, tile.x, columns, out);
  if (set == simd::InstructionSet::Avx2) return sum_avx2(kernel, from, tile.x, columns, out);
#endif
  (void)set;
  sum_columns<16>(kernel, from, tile.x, columns, out);
}

}  // namespace cadmorph
