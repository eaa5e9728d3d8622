#include "core/rbf/simd.h"

#include <algorithm>
#include <atomic>

namespace cadmorph::simd {
namespace {

std::atomic<InstructionSet> limit = InstructionSet::Avx512;

InstructionSet best_of_processor() {
#if defined(__x86_64__)
  if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
      __builtin_cpu_supports("avx512vl"))
    return InstructionSet::Avx512;
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) return InstructionSet::Avx2;
#endif
  return InstructionSet::Baseline;
}

}  // namespace

InstructionSet best() {
  static const InstructionSet found = best_of_processor();
  return std::min(found, limit.load(std::memory_order_relaxed));
}

void limit_to(InstructionSet most) { limit = most; }

const Functions& functions(InstructionSet set) {
#if defined(__x86_64__)
  if (set == InstructionSet::Avx512) return kAvx512;
  if (set == InstructionSet::Avx2) return kAvx2;
#endif
  (void)set;
  return kBaseline;
}

}  // namespace cadmorph::simd
