#include "core/rbf/rbf_system.h"

#include <chrono>
#include <cmath>
#include <cstdio>
#include <utility>

#include "core/errors.h"
#include "core/kd_tree.h"
#include "core/parallel.h"
#include "core/rbf/centre_frame.h"
#include "core/rbf/dense_solver.h"
#include "core/rbf/kernel_sum.h"

namespace cadmorph {
namespace {

using Eigen::MatrixXd;

// A dense solution is refused when it misses its own values by more than this part of the largest:
// the matrix is then singular to rounding. Sound systems reach 1e-11.
constexpr double kDenseAccuracy = 1e-6;

// Above this part of the largest value one step of iterative refinement is worth its O(N^2).
constexpr double kRefine = 1e-13;

// Values of merged centres may differ by this part of the largest value.
constexpr double kDuplicateAgreement = 1e-9;

std::string scientific(double x) {
  char text[32];
  std::snprintf(text, sizeof text, "%.1e", x);
  return text;
}

class Stopwatch {
 public:
  double seconds() const {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
  }

 private:
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

void require_finite(const RowMatrix& rows, const char* what) {
  for (Index i = 0; i < rows.rows(); ++i)
    if (!rows.row(i).allFinite())
      throw InvalidInputError(std::string("RBF ") + what + " " + std::to_string(i) +
                              " is not finite");
}

RowMatrix select_rows(const RowMatrix& from, const std::vector<Index>& rows) {
  RowMatrix result(static_cast<Index>(rows.size()), from.cols());
  for (Index i = 0; i < result.rows(); ++i) result.row(i) = from.row(rows[i]);
  return result;
}

Eigen::VectorXd nearest_distances(const RowMatrix& points) {
  const KdTree tree(points);
  Eigen::VectorXd result(points.rows());
  parallel_for(points.rows(), 1024, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) {
      const auto found = tree.nearest(points.row(i).data(), 2);
      result(i) = std::sqrt(found.back().squared_distance);
    }
  });
  return result;
}

// Local length of each distinct centre: the smallest given among its duplicates, else the distance
// to its nearest neighbour.
Eigen::VectorXd local_lengths(const RowMatrix& centres, const DistinctRows& distinct,
                              const Eigen::VectorXd& given) {
  const Index n = static_cast<Index>(distinct.rows.size());
  if (given.size() == 0)
    return n > 1 ? nearest_distances(select_rows(centres, distinct.rows))
                 : Eigen::VectorXd::Ones(1);
  Eigen::VectorXd result = Eigen::VectorXd::Constant(n, INFINITY);
  for (Index i = 0; i < given.size(); ++i) {
    if (!(given(i) > 0 && std::isfinite(given(i))))
      throw InvalidInputError("local length " + scientific(given(i)) + " of RBF centre " +
                              std::to_string(i) + " is not positive");
    result(distinct.group[i]) = std::min(result(distinct.group[i]), given(i));
  }
  return result;
}

// Distances count in units of `unit`: the function stays the same, its parameters change.
Kernel in_units(Kernel kernel, double unit) {
  kernel.shape *= unit;
  return kernel;
}

// r^2 log r needs no shift for the unit: the change is a polynomial that the weights annihilate.
// Higher even polyharmonics with linear polynomials alone do.
double log_scale(const Kernel& kernel, double unit) {
  const bool has_log = kernel.kind == KernelKind::Polyharmonic && kernel.dimension % 2 == 0;
  return has_log && kernel.cpd_order() > 2 ? std::log(unit) : 0;
}

struct Choice {
  SolverKind solver;
  std::string reason;
};

Choice choose_solver(SolverKind asked, const Kernel& kernel) {
  const bool is_definite = kernel.cpd_order() <= 2;
  if (asked == SolverKind::Auto)
    return is_definite ? Choice{SolverKind::Cholesky, "positive definite beside linear polynomials"}
                       : Choice{SolverKind::Ldlt, "kernel needs more than linear polynomials"};
  if (asked == SolverKind::Cholesky && !is_definite)
    throw InvalidInputError(
        "the Cholesky solver needs a kernel that is positive definite beside linear polynomials; "
        "use "
        "LDL^T or LU for this one");
  if (asked == SolverKind::Fast)
    throw InvalidInputError("the fast solver serves the triharmonic kernel in 3D only");
  return {asked, "as asked"};
}

Factorisation factorisation_of(SolverKind solver) {
  if (solver == SolverKind::Lu) return Factorisation::Lu;
  if (solver == SolverKind::Ldlt) return Factorisation::Ldlt;
  return Factorisation::Cholesky;
}

double largest(const MatrixXd& values) {
  return values.size() == 0 ? 0 : values.cwiseAbs().maxCoeff();
}

}  // namespace

struct RbfField::Impl {
  KernelSum sum;
  CentreFrame frame;
  std::shared_ptr<const MatrixXd> centres;
  SaddleSolution solution;
  RbfReport report;
};

struct RbfSystem::Impl {
  Impl(const RowMatrix& given, Kernel kernel, RbfOptions given_options);

  void set_up_dense(const Kernel& kernel);
  MatrixXd distinct_values(const RowMatrix& values) const;
  SaddleSolution solve_dense(const MatrixXd& values) const;
  MatrixXd residual(const MatrixXd& values, const SaddleSolution& solution) const;
  double in_local_lengths(const MatrixXd& residual) const;

  RbfOptions options;
  DistinctRows distinct;
  CentreFrame frame;
  KernelSum sum;
  Eigen::VectorXd local_length;
  std::shared_ptr<const MatrixXd> centres;  // distinct, in units of the frame
  MatrixXd P;
  std::unique_ptr<DenseSolver> dense;
  RbfReport report;
};

RbfSystem::Impl::Impl(const RowMatrix& given, Kernel kernel, RbfOptions given_options)
    : options(std::move(given_options)),
      distinct(distinct_rows(given)),
      frame(select_rows(given, distinct.rows)),
      sum(in_units(kernel, frame.unit()), log_scale(kernel, frame.unit())) {
  if (options.local_length.size() != 0 && options.local_length.size() != given.rows())
    throw InvalidInputError("RBF system: " + std::to_string(options.local_length.size()) +
                            " local lengths for " + std::to_string(given.rows()) + " centres");
  const Stopwatch watch;
  centres = std::make_shared<MatrixXd>(frame.to_unit(select_rows(given, distinct.rows)));
  local_length = local_lengths(given, distinct, options.local_length);
  P = frame.polynomials(*centres);
  report.centres = centres->rows();
  report.merged = given.rows() - centres->rows();
  report.polynomial_terms = frame.terms();
  const Choice choice = choose_solver(options.solver, kernel);
  report.solver = choice.solver;
  report.reason = choice.reason;
  set_up_dense(kernel);
  report.seconds = watch.seconds();
}

void RbfSystem::Impl::set_up_dense(const Kernel& kernel) {
  const double rows = static_cast<double>(centres->rows() + P.cols());
  if (8 * rows * rows > options.memory_limit)
    throw SolverError("a dense solver for " + std::to_string(centres->rows()) + " centres needs " +
                      scientific(8 * rows * rows) + " bytes, more than the " +
                      scientific(options.memory_limit) +
                      " allowed; use the fast solver or allow more memory");
  try {
    dense = make_dense_solver(factorisation_of(report.solver), sum.matrix(*centres), P,
                              kernel.cpd_sign());
  } catch (const SolverError&) {
    if (options.solver != SolverKind::Auto || report.solver != SolverKind::Cholesky) throw;
    report.solver = SolverKind::Ldlt;
    report.reason = "Cholesky found the system not definite to rounding (centres nearly coincide)";
    dense = make_dense_solver(Factorisation::Ldlt, sum.matrix(*centres), P, kernel.cpd_sign());
  }
  report.reciprocal_condition = dense->reciprocal_condition();
}

MatrixXd RbfSystem::Impl::distinct_values(const RowMatrix& values) const {
  const double allowed =
      values.size() == 0 ? 0 : kDuplicateAgreement * values.cwiseAbs().maxCoeff();
  for (Index i = 0; i < values.rows(); ++i) {
    const Index first = distinct.rows[distinct.group[i]];
    if (first != i && (values.row(i) - values.row(first)).cwiseAbs().maxCoeff() > allowed)
      throw InvalidInputError("RBF centres " + std::to_string(first) + " and " + std::to_string(i) +
                              " coincide but carry different values");
  }
  return select_rows(values, distinct.rows);
}

MatrixXd RbfSystem::Impl::residual(const MatrixXd& values, const SaddleSolution& solution) const {
  return values - sum(*centres, *centres, solution.weights) - P * solution.coefficients;
}

double RbfSystem::Impl::in_local_lengths(const MatrixXd& residual) const {
  return residual.size() == 0
             ? 0
             : (residual.rowwise().norm().array() / local_length.array()).maxCoeff();
}

SaddleSolution RbfSystem::Impl::solve_dense(const MatrixXd& values) const {
  SaddleSolution solution = dense->solve(values);
  const MatrixXd missed = residual(values, solution);
  if (largest(missed) <= kRefine * largest(values)) return solution;
  SaddleSolution refined = dense->solve(missed);
  refined.weights += solution.weights;
  refined.coefficients += solution.coefficients;
  const bool is_better = largest(residual(values, refined)) < largest(missed);
  return is_better ? refined : solution;
}

RbfSystem::RbfSystem(const RowMatrix& centres, Kernel kernel, RbfOptions options) {
  if (centres.size() == 0) throw InvalidInputError("RBF system: there are no centres");
  require_finite(centres, "centre");
  impl_ = std::make_shared<const Impl>(centres, kernel, std::move(options));
}

RbfField RbfSystem::solve(const RowMatrix& values) const {
  const Impl& s = *impl_;
  if (values.rows() != static_cast<Index>(s.distinct.group.size()))
    throw InvalidInputError("RBF system: " + std::to_string(values.rows()) + " values for " +
                            std::to_string(s.distinct.group.size()) + " centres");
  require_finite(values, "value");
  const Stopwatch watch;
  const MatrixXd all = s.distinct_values(values);

  // The linear fit apart: affine values are then reproduced to rounding by every solver.
  const MatrixXd fit = s.P.transpose() * all / static_cast<double>(all.rows());
  const MatrixXd rest = all - s.P * fit;
  SaddleSolution solution = s.solve_dense(rest);
  const MatrixXd missed = s.residual(rest, solution);
  RbfReport report = s.report;
  report.max_residual = s.in_local_lengths(missed);
  if (!(largest(missed) <= kDenseAccuracy * largest(all)))
    throw SolverError("the interpolation matrix of " + std::to_string(all.rows()) +
                      " centres is singular to rounding (reciprocal condition " +
                      scientific(s.report.reciprocal_condition) +
                      "); remove centres that nearly coincide, or choose another kernel or shape");
  solution.coefficients += fit;
  report.seconds += watch.seconds();

  RbfField field;
  field.impl_ = std::make_shared<const RbfField::Impl>(
      RbfField::Impl{s.sum, s.frame, s.centres, std::move(solution), std::move(report)});
  return field;
}

const RbfReport& RbfSystem::report() const { return impl_->report; }

RowMatrix RbfField::evaluate(const RowMatrix& targets) const {
  const Impl& f = *impl_;
  if (targets.cols() != f.centres->cols())
    throw InvalidInputError("RBF field: targets of dimension " + std::to_string(targets.cols()) +
                            " for centres of dimension " + std::to_string(f.centres->cols()));
  const MatrixXd x = f.frame.to_unit(targets);
  return f.sum(x, *f.centres, f.solution.weights) +
         f.frame.polynomials(x) * f.solution.coefficients;
}

const RbfReport& RbfField::report() const { return impl_->report; }

}  // namespace cadmorph
