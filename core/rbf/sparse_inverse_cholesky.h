#pragma once

#include <cstdint>
#include <vector>

#include "core/archive.h"
#include "core/types.h"

namespace cadmorph {

struct FactorOptions {
  Index neighbours = 64;   ///< earlier points in the stencil of each point
  Index dense_rows = 256;  ///< the first points have all earlier points in their stencil
  bool is_adaptive =
      false;  ///< enlarge stencils, twice or four times, where that changes the factor

  template <class Archive>
  void serialize(Archive& archive) {
    archive(neighbours, dense_rows, is_adaptive);
  }
};

/// A preconditioner U U^T for an interpolation system in space: the sparse inverse Cholesky factor
/// that minimises the Kullback-Leibler divergence (Schaefer, Katzfuss, Owhadi 2021), also known as
/// Vecchia's approximation. Column i holds the weights with which the value at point i is predicted
/// from its nearest earlier points, scaled by the prediction's deviation.
class SparseInverseCholesky {
 public:
  /// The factor for r^3 beside linear polynomials, of points ordered from coarse to fine, the first
  /// `free` of which determine the polynomials and get zero columns: these are predicted exactly,
  /// so each column annihilates them. O(N k^3), parallel. Throws SolverError when a stencil is
  /// singular to rounding.
  SparseInverseCholesky(const Points& points, int free, FactorOptions options = {});

  /// The factor for the functions of a CompactSum, of points in the same order; stencils have
  /// `neighbours` earlier points within the support at most. Parallel.
  static SparseInverseCholesky of_compact(const Points& points, double support, Index neighbours);

  /// The factor that was stored.
  explicit SparseInverseCholesky(InputArchive& archive);
  void store(OutputArchive& archive) const;

  /// Returns U U^T r for N x M rows. A column comes out the same whatever the others and the number
  /// of threads are.
  Eigen::MatrixXd apply(const Eigen::MatrixXd& r) const;

 private:
  SparseInverseCholesky() = default;
  template <class MakeColumn>
  void build(const Points& points, const MakeColumn& make_column);

  std::vector<Index> starts_;       // of each column, N + 1
  std::vector<std::int32_t> rows_;  // the point itself first
  std::vector<double> values_;
};

/// How much the factor would gain from stencils of twice the size: the 99th percentile of
/// 2 log(u_2k / u_k) over a sample of one point in a hundred, u the leading entry of a column.
/// Above 0.03 an adaptive factor pays.
double stencil_defect(const Points& points, int free, const FactorOptions& options);

}  // namespace cadmorph
