#include "core/rbf/rbf_system.h"

#include <chrono>
#include <cmath>
#include <cstdio>
#include <mutex>
#include <utility>

#include "core/errors.h"
#include "core/kd_tree.h"
#include "core/parallel.h"
#include "core/rbf/centre_frame.h"
#include "core/rbf/dense_solver.h"
#include "core/rbf/fast_solver.h"
#include "core/rbf/kernel_sum.h"
#include "core/rbf/unit_field.h"

namespace cadmorph {
namespace {

using Eigen::MatrixXd;

// A dense solution is refused when it misses its own values by more than this part of the largest:
// the matrix is then singular to rounding. Sound systems reach 1e-11.
constexpr double kDenseAccuracy = 1e-6;

// Above this part of the largest value iterative refinement is worth its O(N^2) a step.
constexpr double kRefine = 1e-13;
constexpr int kRefinements = 5;

// Number of centres from which on the fast solver beats Cholesky (docs/fast-solver.md).
constexpr Index kFastCentres = 2000;

// Bytes a centre that the fast solver holds at its peak (measured: 2,500 to 3,000).
constexpr double kFastBytes = 3000;

// The fast solver needs enough centres for its stencils.
constexpr Index kFewCentres = 100;

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

Choice choose_automatically(const Kernel& kernel, bool is_triharmonic, Index centres) {
  if (kernel.cpd_order() > 2)
    return {SolverKind::Ldlt, "the kernel needs more than linear polynomials"};
  if (is_triharmonic && centres >= kFastCentres)
    return {SolverKind::Fast, "triharmonic in space, many centres"};
  return {SolverKind::Cholesky, is_triharmonic ? "few centres" : "positive definite kernel"};
}

Choice choose_solver(SolverKind asked, const Kernel& kernel, Index dimension, Index centres) {
  const bool is_triharmonic = dimension == 3 && kernel.kind == KernelKind::Polyharmonic &&
                              kernel.dimension % 2 == 1 && 2 * kernel.order - kernel.dimension == 3;
  if (asked == SolverKind::Auto) return choose_automatically(kernel, is_triharmonic, centres);
  if (asked == SolverKind::Cholesky && kernel.cpd_order() > 2)
    throw InvalidInputError(
        "the Cholesky solver needs a kernel that is positive definite beside linear polynomials, "
        "which this one is not; use LDL^T or LU");
  if (asked == SolverKind::Fast && !is_triharmonic)
    throw InvalidInputError("the fast solver serves the triharmonic kernel in 3D only");
  if (asked == SolverKind::Fast && centres < kFewCentres)
    return {SolverKind::Cholesky, "too few centres for the fast solver"};
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

class DenseField final : public UnitField {
 public:
  DenseField(const KernelSum& sum, std::shared_ptr<const MatrixXd> centres,
             const CentreFrame& frame, SaddleSolution solution)
      : sum_(sum), centres_(std::move(centres)), frame_(frame), solution_(std::move(solution)) {}

  MatrixXd evaluate(const MatrixXd& targets) const override {
    return sum_(targets, *centres_, solution_.weights) +
           frame_.polynomials(targets) * solution_.coefficients;
  }

  void describe(FieldTerms& terms) const override {
    terms.centres = *centres_;
    terms.weights = solution_.weights;
    terms.linear += frame_.linear(solution_.coefficients);
  }

 private:
  KernelSum sum_;
  std::shared_ptr<const MatrixXd> centres_;
  CentreFrame frame_;
  SaddleSolution solution_;
};

}  // namespace

struct RbfField::Impl {
  CentreFrame frame;
  MatrixXd fit;  // coefficients of the linear fit
  std::shared_ptr<const UnitField> rest;
  Kernel kernel;
  RbfReport report;
};

struct RbfSystem::Impl {
  Impl(const RowMatrix& given, const Kernel& given_kernel, RbfOptions given_options);

  void set_up_fast();
  std::unique_ptr<DenseSolver> factor_dense(RbfReport& into) const;
  const DenseSolver& fallback(RbfReport& into) const;
  MatrixXd distinct_values(const RowMatrix& values) const;
  std::shared_ptr<const UnitField> solve(const MatrixXd& values, double scale,
                                         RbfReport& into) const;
  std::shared_ptr<const UnitField> solve_fast(const MatrixXd& values, RbfReport& into) const;
  std::shared_ptr<const UnitField> solve_dense(const DenseSolver& solver, const MatrixXd& values,
                                               double scale, RbfReport& into) const;
  MatrixXd residual(const MatrixXd& values, const SaddleSolution& solution) const;
  double in_local_lengths(const MatrixXd& residual) const;

  Kernel kernel;
  RbfOptions options;
  DistinctRows distinct;
  CentreFrame frame;
  KernelSum sum;
  Eigen::VectorXd local_length;
  std::shared_ptr<const MatrixXd> centres;  // distinct, in units of the frame
  MatrixXd P;
  std::unique_ptr<DenseSolver> dense;
  std::unique_ptr<FastSolver> fast;
  RbfReport report;
  mutable std::mutex fallback_mutex;
  mutable std::unique_ptr<DenseSolver> fallback_;
};

RbfSystem::Impl::Impl(const RowMatrix& given, const Kernel& given_kernel, RbfOptions given_options)
    : kernel(given_kernel),
      options(std::move(given_options)),
      distinct(distinct_rows(given)),
      frame(select_rows(given, distinct.rows)),
      sum(in_units(kernel, frame.unit()), log_scale(kernel, frame.unit())) {
  if (options.local_length.size() != 0 && options.local_length.size() != given.rows())
    throw InvalidInputError("RBF system: " + std::to_string(options.local_length.size()) +
                            " local lengths for " + std::to_string(given.rows()) + " centres");
  if (!(options.tolerance > 0))
    throw InvalidInputError("RBF system: the tolerance " + scientific(options.tolerance) +
                            " is not positive");
  const Stopwatch watch;
  centres = std::make_shared<MatrixXd>(frame.to_unit(select_rows(given, distinct.rows)));
  local_length = local_lengths(given, distinct, options.local_length);
  P = frame.polynomials(*centres);
  report.centres = centres->rows();
  report.merged = given.rows() - centres->rows();
  report.polynomial_terms = frame.terms();
  const Choice choice = choose_solver(options.solver, kernel, given.cols(), centres->rows());
  report.solver = choice.solver;
  report.reason = choice.reason;
  if (report.solver == SolverKind::Fast) set_up_fast();
  if (!fast) dense = factor_dense(report);
  report.seconds = watch.seconds();
}

void RbfSystem::Impl::set_up_fast() {
  const double bytes = kFastBytes * static_cast<double>(centres->rows());
  if (bytes > options.memory_limit)
    throw SolverError("the fast solver for " + std::to_string(centres->rows()) +
                      " centres needs some " + scientific(bytes) + " bytes, more than the " +
                      scientific(options.memory_limit) + " allowed; allow more memory");
  try {
    fast = std::make_unique<FastSolver>(
        *centres, local_length / frame.unit(),
        FastOptions{
            .tolerance = options.tolerance, .unit = frame.unit(), .progress = options.progress});
    if (!fast->remarks().empty()) report.reason += "; " + fast->remarks();
  } catch (const SolverError& error) {
    report.solver = SolverKind::Cholesky;
    report.reason = std::string("fast solver not possible: ") + error.what();
  }
}

std::unique_ptr<DenseSolver> RbfSystem::Impl::factor_dense(RbfReport& into) const {
  const double rows = static_cast<double>(centres->rows() + P.cols());
  const double bytes = 8 * rows * rows;
  if (bytes > options.memory_limit)
    throw SolverError("a dense solver for " + std::to_string(centres->rows()) + " centres needs " +
                      scientific(bytes) + " bytes, more than the " +
                      scientific(options.memory_limit) +
                      " allowed; use the fast solver or allow more memory" +
                      (options.solver == SolverKind::Auto ? " (" + into.reason + ")" : ""));
  std::unique_ptr<DenseSolver> solver;
  try {
    solver = make_dense_solver(factorisation_of(into.solver), sum.matrix(*centres), P,
                               kernel.cpd_sign());
  } catch (const SolverError&) {
    if (options.solver == SolverKind::Cholesky || into.solver != SolverKind::Cholesky) throw;
    into.solver = SolverKind::Ldlt;
    into.reason += "; Cholesky found the system not definite to rounding (centres nearly coincide)";
    solver = make_dense_solver(Factorisation::Ldlt, sum.matrix(*centres), P, kernel.cpd_sign());
  }
  into.reciprocal_condition = solver->reciprocal_condition();
  return solver;
}

const DenseSolver& RbfSystem::Impl::fallback(RbfReport& into) const {
  const std::lock_guard lock(fallback_mutex);
  into.solver = SolverKind::Cholesky;
  if (!fallback_) fallback_ = factor_dense(into);
  into.reciprocal_condition = fallback_->reciprocal_condition();
  return *fallback_;
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

std::shared_ptr<const UnitField> RbfSystem::Impl::solve(const MatrixXd& values, double scale,
                                                        RbfReport& into) const {
  if (!fast) return solve_dense(*dense, values, scale, into);
  try {
    return solve_fast(values, into);
  } catch (const SolverError& error) {
    into.reason = std::string("fast solver failed: ") + error.what();
  }
  return solve_dense(fallback(into), values, scale, into);
}

std::shared_ptr<const UnitField> RbfSystem::Impl::solve_fast(const MatrixXd& values,
                                                             RbfReport& into) const {
  FastReport details;
  auto field = fast->solve(values, details);
  into.iterations = details.iterations;
  into.max_residual = details.residual * options.tolerance;
  if (details.thinned > 0)
    into.reason += "; " + std::to_string(details.thinned) +
                   " closely spaced centres served by the multiscale correction";
  if (!details.remarks.empty()) into.reason += "; " + details.remarks;
  return field;
}

std::shared_ptr<const UnitField> RbfSystem::Impl::solve_dense(const DenseSolver& solver,
                                                              const MatrixXd& values, double scale,
                                                              RbfReport& into) const {
  SaddleSolution solution = solver.solve(values);
  MatrixXd missed = residual(values, solution);
  for (int step = 0; step < kRefinements && largest(missed) > kRefine * scale; ++step) {
    SaddleSolution refined = solver.solve(missed);
    refined.weights += solution.weights;
    refined.coefficients += solution.coefficients;
    MatrixXd remaining = residual(values, refined);
    if (!(largest(remaining) < 0.5 * largest(missed))) break;
    solution = std::move(refined);
    missed = std::move(remaining);
  }
  into.max_residual = in_local_lengths(missed);
  if (!(largest(missed) <= kDenseAccuracy * scale))
    throw SolverError("the interpolation matrix of " + std::to_string(centres->rows()) +
                      " centres is singular to rounding (reciprocal condition " +
                      scientific(solver.reciprocal_condition()) +
                      "); remove centres that nearly coincide, or choose another kernel or shape");
  return std::make_shared<DenseField>(sum, centres, frame, std::move(solution));
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
  RbfReport report = s.report;
  auto rest = s.solve(all - s.P * fit, largest(all), report);
  report.seconds += watch.seconds();

  RbfField field;
  field.impl_ = std::make_shared<const RbfField::Impl>(
      RbfField::Impl{s.frame, fit, std::move(rest), s.kernel, std::move(report)});
  return field;
}

const RbfReport& RbfSystem::report() const { return impl_->report; }

RowMatrix RbfField::evaluate(const RowMatrix& targets) const {
  const CentreFrame& frame = impl_->frame;
  if (targets.cols() != frame.dimension())
    throw InvalidInputError("RBF field: targets of dimension " + std::to_string(targets.cols()) +
                            " for centres of dimension " + std::to_string(frame.dimension()));
  const MatrixXd x = frame.to_unit(targets);
  MatrixXd values = impl_->rest->evaluate(x);
  values += frame.polynomials(x) * impl_->fit;
  return values;
}

FieldTerms RbfField::terms() const {
  const CentreFrame& frame = impl_->frame;
  if (frame.dimension() != 3 || log_scale(impl_->kernel, 2) != 0)
    throw InvalidInputError(
        "RBF field: terms are given for fields in space and kernels without a "
        "logarithm");
  FieldTerms terms;
  terms.origin = frame.centre();
  terms.unit = frame.unit();
  terms.kernel = in_units(impl_->kernel, frame.unit());
  terms.linear = frame.linear(impl_->fit);
  impl_->rest->describe(terms);
  return terms;
}

const RbfReport& RbfField::report() const { return impl_->report; }

}  // namespace cadmorph
