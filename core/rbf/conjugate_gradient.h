#pragma once

#include <Eigen/Core>
#include <functional>
#include <vector>

#include "core/types.h"

namespace cadmorph {

/// A symmetric linear map applied to N x any number of columns at once, each of which must come out
/// the same whatever the others are.
using LinearMap = std::function<Eigen::MatrixXd(const Eigen::MatrixXd&)>;

struct CgOptions {
  int max_iterations = 40;
  /// A coarser form of A, and the residual (in units of `allowed`) below which it serves: errors
  /// of the product matter in proportion to the residual (Simoncini, Szyld 2003).
  LinearMap relaxed = {};
  double relaxed_below = 0;
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

/// Solves A w = r modulo span(P) for w orthogonal to P by preconditioned conjugate gradients, for
/// several N x M sets r at once that share each application of A and the preconditioner. Each
/// column has its own step lengths, and each set stops when the residual of every row is within its
/// own allowance: a set's result is to the last bit what it would be alone.
std::vector<CgResult> solve_projected_cg(const LinearMap& A, const LinearMap& preconditioner,
                                         const Eigen::MatrixXd& P, std::vector<Eigen::MatrixXd> r,
                                         const std::vector<Eigen::VectorXd>& allowed,
                                         const CgOptions& options = {});

/// Returns the sets side by side in one matrix.
Eigen::MatrixXd join_columns(const std::vector<const Eigen::MatrixXd*>& sets);

}  // namespace cadmorph
