#pragma once

#include <Eigen/Core>
#include <functional>

#include "core/types.h"

namespace cadmorph {

/// A symmetric linear map applied to N x M columns at once.
using LinearMap = std::function<Eigen::MatrixXd(const Eigen::MatrixXd&)>;

struct CgOptions {
  int max_iterations = 40;
  /// Called each iteration; may be empty.
  std::function<void(int iteration, double residual)> watch = {};
};

struct CgResult {
  Eigen::MatrixXd weights;  ///< N x M
  int iterations = 0;
  double residual = 0;  ///< largest, in units of `allowed`, by recursion
  bool has_converged() const { return residual <= 1; }
};

/// Removes the component in the span of P (N x Q, orthogonal columns of squared norm N).
void project_out(const Eigen::MatrixXd& P, Eigen::MatrixXd& r);

/// Largest norm of three columns in one row (of all, where their number is no multiple of 3) over
/// that row's allowance.
double relative_residual(const Eigen::MatrixXd& r, const Eigen::VectorXd& allowed);

/// Solves A w = r modulo span(P) for w orthogonal to P by preconditioned conjugate gradients, each
/// column with its own step lengths and all in one application of A. Stops when the residual of
/// every row is within its allowance.
CgResult solve_projected_cg(const LinearMap& A, const LinearMap& preconditioner,
                            const Eigen::MatrixXd& P, Eigen::MatrixXd r,
                            const Eigen::VectorXd& allowed, const CgOptions& options = {});

}  // namespace cadmorph
