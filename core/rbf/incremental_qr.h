#pragma once

#include <memory>
#include <vector>

#include "core/rbf/kernel_sum.h"
#include "core/types.h"

namespace cadmorph {

struct QrOptions {
  double tolerance = 1e-5;    ///< root mean square of the residuals, each over its local length
  double memory_limit = 8e9;  ///< bytes that the factor may hold
};

/// A least-squares approximation with some of the centres.
struct QrSolution {
  std::vector<Index> rows;       ///< centres taken, in the order taken
  Eigen::MatrixXd weights;       ///< of those, K x M
  Eigen::MatrixXd coefficients;  ///< Q x M
  double error = 0;              ///< root mean square residual in local lengths, as the QR knows it
};

/// The incremental QR solver (Sieger et al. 2013, sect. 7, eq. 4; Botsch, Kobbelt 2005): least
/// squares over all centres and the side conditions P^T w = 0 with the polynomials and the kernels
/// of as few centres, farthest point first, as reach a tolerance. The Householder QR
///
///     D A_k = Q_k R_k,   X_k = R_k^-1 (Q_k^T D B),   |D (A_k X_k - B)| = |(Q_k^T D B)_(k+1...)|
///
/// (D: 1 / local length) grows block of columns by block, so the error is known at every k before
/// anything is solved for. The columns depend on the centres alone and are kept: a further value
/// set costs O(N k). O(N k^2) operations, O(N k) memory.
class IncrementalQr {
 public:
  /// `centres`: N x D in unit coordinates, D <= 3, distinct; `P`: N x Q, the polynomials there;
  /// `local_length`: N, in the unit of the values.
  IncrementalQr(const KernelSum& sum, std::shared_ptr<const Eigen::MatrixXd> centres,
                const Eigen::MatrixXd& P, const Eigen::VectorXd& local_length, QrOptions options);

  /// Approximates N x M values, with one and the same k for all columns. Does not depend on what
  /// was solved before nor on the number of threads. Throws SolverError when the memory allowed, or
  /// rounding, ends the growth before the tolerance is reached.
  QrSolution solve(const Eigen::MatrixXd& values) const;

 private:
  struct Impl;
  std::shared_ptr<Impl> impl_;
};

}  // namespace cadmorph
