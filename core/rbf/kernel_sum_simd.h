#pragma once

#include <cstdint>

/// Interface of the per-processor sources of kernel_sum.cpp. They are compiled for newer processors
/// than the rest of the program, so this header pulls in no inline code that the linker might
/// share.
namespace cadmorph::simd {

enum class Form {
  Cubic,
  ThinPlate,
  OddPower,
  EvenPowerLog,
  Gaussian,
  Multiquadric,
  InverseMultiquadric
};

/// out(i, c) += sum_j weights(j, c) phi(|targets(i, :) - sources(j, :)|), all column-major.
struct SumTask {
  Form form;
  int exponent;      ///< of OddPower and EvenPowerLog
  double log_shift;  ///< EvenPowerLog: r^n (log r + log_shift)
  double shape;      ///< epsilon of the Gaussian and the multiquadrics
  int dimension;
  int columns;
  const double* targets;
  std::int64_t target_stride, target_count;
  const double* sources;
  std::int64_t source_stride, source_count;
  const double* weights;
  std::int64_t weight_stride;
  double* out;
  std::int64_t out_stride;
};

void sum_avx512(const SumTask& task);
void sum_avx2(const SumTask& task);
void sum_baseline(const SumTask& task);

}  // namespace cadmorph::simd
