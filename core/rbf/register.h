#pragma once

#include <cstring>

namespace cadmorph {

/// A processor's register of doubles, on which + - * / and comparisons work lane by lane, correctly
/// rounded whatever the width. Wider ones than the processor has, g++ 12 puts through memory.
template <int Bytes>
struct Register {
  typedef double Vec __attribute__((vector_size(Bytes)));
  static constexpr int kLanes = Bytes / sizeof(double);
};

#define CADMORPH_INLINE inline __attribute__((always_inline))

/// The square root in each lane.
template <class Vec>
CADMORPH_INLINE void take_root(Vec& x) {
  constexpr int kLanes = sizeof(Vec) / sizeof(double);
  double values[kLanes];
  std::memcpy(values, &x, sizeof x);
  for (int i = 0; i < kLanes; ++i) values[i] = __builtin_sqrt(values[i]);
  std::memcpy(&x, values, sizeof x);
}

}  // namespace cadmorph
