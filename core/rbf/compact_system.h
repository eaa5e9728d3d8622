#pragma once

#include "core/rbf/compact_sum.h"
#include "core/rbf/conjugate_gradient.h"
#include "core/rbf/sparse_inverse_cholesky.h"
#include "core/types.h"

namespace cadmorph {

/// Interpolation by the functions of a CompactSum at its points: conjugate gradients with a sparse
/// inverse Cholesky factor.
class CompactSystem {
 public:
  /// `points` (N x 3) from coarse to fine.
  CompactSystem(const Points& points, double support);
  CompactSystem(const CompactSystem&) = delete;
  CompactSystem& operator=(const CompactSystem&) = delete;

  const CompactSum& sum() const { return sum_; }

  /// Returns the coefficients that meet `values` (N x M) within `allowed` (N), if it has converged.
  CgResult solve(Eigen::MatrixXd values, const Eigen::VectorXd& allowed) const;

 private:
  CompactSum sum_;
  CompactMatrix matrix_;
  SparseInverseCholesky factor_;
};

}  // namespace cadmorph
