#include "core/rbf/simd.h"

namespace {

constexpr int kWidth = 2;
constexpr int kUnroll = 2;  // one vector's operations run while the other's wait
constexpr int kTurn = 1;    // the root is an instruction: that leaves registers for the sums
typedef double Vec __attribute__((vector_size(16)));
typedef std::uint64_t Int __attribute__((vector_size(16)));

inline Vec square_root(Vec x) { return Vec{__builtin_sqrt(x[0]), __builtin_sqrt(x[1])}; }
inline Vec cube(Vec r2) { return r2 * square_root(r2); }

// Correct in any case, through the C library where the processor can't.
inline Vec fused_difference(Vec a, Vec b, Vec c) {
  return Vec{__builtin_fma(a[0], b[0], -c[0]), __builtin_fma(a[1], b[1], -c[1])};
}

}  // namespace

#include "core/rbf/simd_dense.inc"
#include "core/rbf/simd_sum.inc"

namespace cadmorph::simd {

const Functions kBaseline = {
    sum,      sum_pairs,      cubic_matrix, add_outer_products, cubic_block,
    cholesky, cholesky_solve, pivoted_qr,   multiply,           multiply_transposed,
    contract};

}  // namespace cadmorph::simd
