#include "core/rbf/compact_system.h"

#include <utility>

namespace cadmorph {
namespace {

using Eigen::MatrixXd;

constexpr int kMaxIterations = 1000;  // some ten are usual: what takes more has another fault

// In the factor's stencils: with fewer or more, iterations and stencils together take longer.
constexpr Index kNeighbours = 8;

}  // namespace

CompactSystem::CompactSystem(const Points& points, double support)
    : sum_(points, support),
      matrix_(sum_),
      factor_(SparseInverseCholesky::of_compact(points, support, kNeighbours)) {}

CgResult CompactSystem::solve(MatrixXd values, const Eigen::VectorXd& allowed) const {
  const MatrixXd no_polynomials(values.rows(), 0);
  return solve_projected_cg([&](const MatrixXd& x) { return matrix_ * x; },
                            [&](const MatrixXd& x) { return factor_.apply(x); }, no_polynomials,
                            {std::move(values)}, {allowed}, {.max_iterations = kMaxIterations})
      .front();
}

}  // namespace cadmorph
