#pragma once

#include <Eigen/Core>
#include <memory>

#include "core/archive.h"
#include "core/types.h"

namespace cadmorph {

/// Weights and polynomial coefficients of an interpolant, a column a value set.
struct SaddleSolution {
  Eigen::MatrixXd weights;       ///< N x M
  Eigen::MatrixXd coefficients;  ///< Q x M
};

/// How a dense system is factored.
enum class Factorisation {
  Lu,        ///< dgetrf of the full matrix
  Ldlt,      ///< dsytrf of the full matrix
  Cholesky,  ///< dpotrf on the null space of P^T, where A is positive definite
};

/// A factored saddle system [A P; P^T 0] [w; c] = [f; 0] (Sieger et al. 2013, eq. 3).
class DenseSolver {
 public:
  virtual ~DenseSolver() = default;

  /// Solves for N x M values.
  virtual SaddleSolution solve(const Eigen::MatrixXd& values) const = 0;

  /// LAPACK's estimate of the reciprocal condition number (1-norm) of the factored matrix.
  virtual double reciprocal_condition() const = 0;

  virtual void store(OutputArchive& archive) const = 0;
};

/// Factors the system for the symmetric kernel matrix A (N x N, consumed) and the polynomials P
/// (N x Q, full column rank, Q <= N). `sign` * A is positive definite on the null space of P^T;
/// only Cholesky needs it. N^3 / 3 operations (LU: twice that). Throws SolverError when the matrix
/// is singular, or for Cholesky not positive definite, to rounding.
std::unique_ptr<DenseSolver> make_dense_solver(Factorisation factorisation, Eigen::MatrixXd A,
                                               const Eigen::MatrixXd& P, int sign);

/// The solver that was stored, for the same factorisation and polynomials.
std::unique_ptr<DenseSolver> restore_dense_solver(Factorisation factorisation,
                                                  const Eigen::MatrixXd& P, InputArchive& archive);

}  // namespace cadmorph
