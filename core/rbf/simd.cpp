#include "core/rbf/simd.h"

namespace cadmorph::simd {

InstructionSet best() {
#if defined(__x86_64__)
  if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
      __builtin_cpu_supports("avx512vl"))
    return InstructionSet::Avx512;
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) return InstructionSet::Avx2;
#endif
  return InstructionSet::Baseline;
}

const Functions& functions(InstructionSet set) {
#if defined(__x86_64__)
  if (set == InstructionSet::Avx512) return kAvx512;
  if (set == InstructionSet::Avx2) return kAvx2;
#endif
  (void)set;
  return kBaseline;
}

}  // namespace cadmorph::simd
