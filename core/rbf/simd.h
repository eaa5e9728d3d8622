#pragma once

#include <cstdint>

/// Inner loops compiled once for each instruction set. Their sources are compiled for newer
/// processors than the rest of the program, so this header pulls in no inline code that the linker
/// might share with it.
namespace cadmorph::simd {

enum class InstructionSet { Baseline, Avx2, Avx512 };

enum class Form {
  Cubic,
  ThinPlate,
  OddPower,
  EvenPowerLog,
  Gaussian,
  Multiquadric,
  InverseMultiquadric,
  WendlandC2,
  WendlandC4
};

/// out(i, c) += sum_j weights(j, c) phi(|targets(i, :) - sources(j, :)|), all column-major.
struct SumTask {
  Form form;
  int exponent;      ///< of OddPower and EvenPowerLog
  double log_shift;  ///< EvenPowerLog: r^n (log r + log_shift)
  double shape;      ///< Kernel::shape
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
  // Of sum_pairs: what the weights and the sums are more than a double holds, with their strides.
  const double* low_weights = nullptr;
  double* low_out = nullptr;
};

/// Matrices of the dense functions are column-major with a stride that is a multiple of kPad; their
/// rows beyond the last count as storage and hold zeros.
constexpr std::int64_t kPad = 8;

inline std::int64_t padded(std::int64_t rows) { return (rows + kPad - 1) / kPad * kPad; }

struct Functions {
  void (*sum)(const SumTask& task);

  /// As `sum`, with weights and sums in twice the precision; the kernel's values are doubles, the
  /// same where targets and sources change places. Three to four times as slow.
  void (*sum_pairs)(const SumTask& task);

  /// A(i, j) = |x_i - x_j|^3 for n points with coordinates x[d * stride + i].
  void (*cubic_matrix)(std::int64_t n, const double* x, double* A, std::int64_t stride);

  /// A += factor * sum_c Q(:, c) Q(:, c)^T for `columns` columns of the same stride.
  void (*add_outer_products)(std::int64_t n, std::int64_t columns, const double* Q, double factor,
                             double* A, std::int64_t stride);

  /// A(i, j) = scale[i] * |x_i - y_j|^3 for `rows` points x and `columns` points y.
  void (*cubic_block)(std::int64_t rows, const double* x, std::int64_t x_stride,
                      const double* scale, std::int64_t columns, const double* y,
                      std::int64_t y_stride, double* A, std::int64_t stride);

  /// A = L L^T in place of the lower triangle; false when a pivot is not positive.
  bool (*cholesky)(std::int64_t n, double* A, std::int64_t stride);

  /// Solves L L^T x = b in place for `columns` right-hand sides of the same stride.
  void (*cholesky_solve)(std::int64_t n, const double* L, std::int64_t columns, double* b,
                         std::int64_t stride);

  /// QR with column pivoting of A (rows x n, destroyed) until no remaining column has a squared
  /// norm above `tolerance`. permutation[k] is the column at place k; the upper trapezoid of R (n x
  /// n, the same n as stride) is set. Returns the rank found.
  std::int64_t (*pivoted_qr)(std::int64_t rows, std::int64_t n, double* A, std::int64_t stride,
                             double tolerance, std::int64_t* permutation, double* R);

  /// Y = A X for A (rows x depth) and `columns` columns, each computed the same whatever the number
  /// of columns; all strides of the rows are padded.
  void (*multiply)(std::int64_t rows, std::int64_t depth, const double* A, std::int64_t stride,
                   std::int64_t columns, const double* X, std::int64_t x_stride, double* Y,
                   std::int64_t y_stride);

  /// Y = A^T X likewise; the rows of X beyond the last hold zeros.
  void (*multiply_transposed)(std::int64_t rows, std::int64_t depth, const double* A,
                              std::int64_t stride, std::int64_t columns, const double* X,
                              std::int64_t x_stride, double* Y, std::int64_t y_stride);

  /// out(i, c) = sum_abk x(i, a) y(i, b) z(i, k) T(k + p b + p^2 a, c) for n points whose bases x,
  /// y, z (n x p) and sums have the same stride, each column computed the same whatever their
  /// number.
  void (*contract)(std::int64_t n, std::int64_t p, const double* x, const double* y,
                   const double* z, std::int64_t stride, std::int64_t columns, const double* T,
                   std::int64_t t_stride, double* out);
};

/// Best instruction set of this processor, or the one `limit_to` allows where that is lower.
InstructionSet best();

/// Makes `best` return at most `most`; for tests and benchmarks.
void limit_to(InstructionSet most);

const Functions& functions(InstructionSet set);

extern const Functions kAvx512, kAvx2, kBaseline;

}  // namespace cadmorph::simd
