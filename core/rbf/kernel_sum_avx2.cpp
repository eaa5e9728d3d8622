#if defined(__x86_64__)

#pragma GCC target("avx2,fma")

#include <immintrin.h>

#include "core/rbf/kernel_sum_simd.h"

namespace {

constexpr int kWidth = 4;
constexpr int kUnroll = 2;
typedef double Vec __attribute__((vector_size(32)));
typedef std::uint64_t Int __attribute__((vector_size(32)));

inline Vec square_root(Vec x) { return (Vec)_mm256_sqrt_pd((__m256d)x); }
inline Vec cube(Vec r2) { return r2 * square_root(r2); }

}  // namespace

#include "core/rbf/kernel_sum_body.inc"

namespace cadmorph::simd {

void sum_avx2(const SumTask& task) { sum(task); }

}  // namespace cadmorph::simd

#endif
