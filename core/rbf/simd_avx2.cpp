#if defined(__x86_64__)

#ifndef __clang__
#pragma GCC target("avx2,fma")
#endif

#include <immintrin.h>

#include "core/rbf/simd.h"

#ifdef __clang__
#pragma clang attribute push(__attribute__((target("avx2,fma"))), apply_to = function)
#endif

namespace {

constexpr int kWidth = 4;
constexpr int kUnroll = 2;  // one vector's operations run while the other's wait
constexpr int kTurn = 1;    // the root is an instruction: that leaves registers for the sums
typedef double Vec __attribute__((vector_size(32)));
typedef std::uint64_t Int __attribute__((vector_size(32)));

inline Vec square_root(Vec x) { return (Vec)_mm256_sqrt_pd((__m256d)x); }
inline Vec cube(Vec r2) { return r2 * square_root(r2); }
inline Vec fused_difference(Vec a, Vec b, Vec c) {
  return (Vec)_mm256_fmsub_pd((__m256d)a, (__m256d)b, (__m256d)c);
}

}  // namespace

#include "core/rbf/simd_dense.inc"
#include "core/rbf/simd_sum.inc"

namespace cadmorph::simd {

const Functions kAvx2 = {
    sum,      sum_pairs,      cubic_matrix, add_outer_products, cubic_block,
    cholesky, cholesky_solve, pivoted_qr,   multiply,           multiply_transposed,
    contract};

}  // namespace cadmorph::simd

#ifdef __clang__
#pragma clang attribute pop
#endif

#endif
