#include "core/rbf/kernel_sum_simd.h"

namespace {

constexpr int kWidth = 2;
constexpr int kUnroll = 2;
typedef double Vec __attribute__((vector_size(16)));
typedef std::uint64_t Int __attribute__((vector_size(16)));

inline Vec square_root(Vec x) { return Vec{__builtin_sqrt(x[0]), __builtin_sqrt(x[1])}; }
inline Vec cube(Vec r2) { return r2 * square_root(r2); }

}  // namespace

#include "core/rbf/kernel_sum_body.inc"

namespace cadmorph::simd {

void sum_baseline(const SumTask& task) { sum(task); }

}  // namespace cadmorph::simd
