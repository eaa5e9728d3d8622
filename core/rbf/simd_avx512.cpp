#if defined(__x86_64__)

#ifndef __clang__
#pragma GCC target("avx512f,avx512dq,avx512vl,avx2,fma")
#endif

#include <immintrin.h>

#include "core/rbf/simd.h"

#ifdef __clang__
#pragma clang attribute push(__attribute__((target("avx512f,avx512dq,avx512vl,avx2,fma"))), \
                             apply_to = function)
#endif

namespace {

constexpr int kWidth = 8;
constexpr int kUnroll = 2;  // one vector's operations run while the other's wait
constexpr int kTurn = 32;   // 4 KB of values: they stay in the first cache
typedef double Vec __attribute__((vector_size(64)));
typedef std::uint64_t Int __attribute__((vector_size(64)));

inline Vec fused_difference(Vec a, Vec b, Vec c) {
  return (Vec)_mm512_fmsub_pd((__m512d)a, (__m512d)b, (__m512d)c);
}

inline Vec square_root(Vec x) { return (Vec)_mm512_maskz_sqrt_pd(0xff, (__m512d)x); }

// r^2 * sqrt(r^2) for r^2 >= kLeastSquare: y = (1 - h)^(1/2) / r from the 14-bit reciprocal root,
// then the series of (1 - h)^(-1/2) up to h^3 < 2^-39. Relative error below 1e-15, at four times
// the speed of the hardware's square root.
inline Vec cube(Vec r2) {
  const Vec y = (Vec)_mm512_maskz_rsqrt14_pd(0xff, (__m512d)r2);
  const Vec root = r2 * y;
  const Vec h = 1.0 - root * y;
  const Vec correction = h * (0.5 + h * (0.375 + h * 0.3125));
  const Vec product = r2 * root;
  return product + product * correction;
}

}  // namespace

#include "core/rbf/simd_dense.inc"
#include "core/rbf/simd_sum.inc"

namespace cadmorph::simd {

const Functions kAvx512 = {
    sum,      sum_pairs,      cubic_matrix, add_outer_products, cubic_block,
    cholesky, cholesky_solve, pivoted_qr,   multiply,           multiply_transposed,
    contract};

}  // namespace cadmorph::simd

#ifdef __clang__
#pragma clang attribute pop
#endif

#endif
