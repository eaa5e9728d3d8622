#include "core/rbf/conjugate_gradient.h"

#include <algorithm>

namespace cadmorph {
namespace {

using Eigen::MatrixXd;
using Eigen::RowVectorXd;

RowVectorXd column_dots(const MatrixXd& a, const MatrixXd& b) {
  RowVectorXd result(a.cols());
  for (Index c = 0; c < a.cols(); ++c) result(c) = a.col(c).dot(b.col(c));
  return result;
}

// Columns that are solved already (zero denominators) stand still.
RowVectorXd safe_quotient(const RowVectorXd& a, const RowVectorXd& b) {
  return (b.array() > 0).select(a.array() / b.array().max(1e-300), 0.0);
}

}  // namespace

void project_out(const MatrixXd& P, MatrixXd& r) {
  const MatrixXd coefficients = P.transpose() * r / static_cast<double>(P.rows());
  r.noalias() -= P * coefficients;
}

double relative_residual(const MatrixXd& r, const Eigen::VectorXd& allowed) {
  const Index width = r.cols() % 3 == 0 ? 3 : r.cols();
  double largest = 0;
  for (Index c = 0; c < r.cols(); c += width)
    largest = std::max(
        largest, (r.middleCols(c, width).rowwise().norm().array() / allowed.array()).maxCoeff());
  return largest;
}

CgResult solve_projected_cg(const LinearMap& A, const LinearMap& preconditioner, const MatrixXd& P,
                            MatrixXd r, const Eigen::VectorXd& allowed, const CgOptions& options) {
  CgResult result;
  result.weights = MatrixXd::Zero(r.rows(), r.cols());
  MatrixXd direction = result.weights;
  RowVectorXd previous = RowVectorXd::Zero(r.cols());
  project_out(P, r);
  while (true) {
    result.residual = relative_residual(r, allowed);
    if (options.watch) options.watch(result.iterations, result.residual);
    if (result.has_converged() || result.iterations == options.max_iterations) return result;
    MatrixXd z = preconditioner(r);
    project_out(P, z);
    const RowVectorXd current = column_dots(r, z);
    direction = z + direction * safe_quotient(current, previous).asDiagonal();
    previous = current;
    const MatrixXd image = A(direction);
    const RowVectorXd step = safe_quotient(current, column_dots(direction, image));
    result.weights += direction * step.asDiagonal();
    r -= image * step.asDiagonal();
    project_out(P, r);
    ++result.iterations;
  }
}

}  // namespace cadmorph
