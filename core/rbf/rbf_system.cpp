#include "core/rbf/rbf_system.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <mutex>
#include <optional>
#include <sstream>
#include <utility>

#include "core/archive_types.h"
#include "core/errors.h"
#include "core/kd_tree.h"
#include "core/rbf/adaptive_solver.h"
#include "core/rbf/centre_frame.h"
#include "core/rbf/dense_solver.h"
#include "core/rbf/fast_solver.h"
#include "core/rbf/field_derivative.h"
#include "core/rbf/incremental_qr.h"
#include "core/rbf/rbf_field_impl.h"
#include "core/rbf/solver_choice.h"
#include "core/stopwatch.h"

namespace cadmorph {
namespace {

using Eigen::MatrixXd;

// A dense solution is refused when it misses its own values by more than this part of the largest:
// the matrix is then singular to rounding. Sound systems reach 1e-11.
constexpr double kDenseAccuracy = 1e-6;

// Values far below the distances of their centres may miss more: by this part of the local length,
// as the fast solver does.
constexpr double kHarmless = 1e-5;

// Above this part of the largest value iterative refinement is worth its O(N^2) a step. With 0, 2
// or 10 steps, 12 systems of 2,252 and 2,594 centres come out as with 5 to the last bit.
constexpr double kRefine = 1e-13;
constexpr int kRefinements = 5;

// The true residual of the incremental QR may be larger than the one it knows by this factor.
constexpr double kQrRounding = 1.1;

// Bytes a centre that the fast solver holds at its peak (measured: 2,500 to 3,000).
constexpr double kFastBytes = 3000;

// Values of merged centres may differ by this part of the largest value: what the rounding of the
// sums may come to, too.
constexpr double kDuplicateAgreement = 1e-9;

std::string scientific(double x) {
  char text[32];
  std::snprintf(text, sizeof text, "%.1e", x);
  return text;
}

void require_finite(const RowMatrix& rows, const char* what) {
  for (Index i = 0; i < rows.rows(); ++i)
    if (!rows.row(i).allFinite())
      throw InvalidInputError(std::string("RBF ") + what + " " + std::to_string(i) +
                              " is not finite");
}

// Local length of each distinct centre: the smallest given among its duplicates, else the distance
// to its nearest neighbour.
Eigen::VectorXd local_lengths(const RowMatrix& centres, const DistinctRows& distinct,
                              const Eigen::VectorXd& given) {
  const Index n = static_cast<Index>(distinct.rows.size());
  if (given.size() == 0)
    return n > 1 ? nearest_distances(centres(distinct.rows, Eigen::all)) : Eigen::VectorXd::Ones(1);
  Eigen::VectorXd result = Eigen::VectorXd::Constant(n, INFINITY);
  for (Index i = 0; i < given.size(); ++i) {
    if (!(given(i) > 0 && std::isfinite(given(i))))
      throw InvalidInputError("local length " + scientific(given(i)) + " of RBF centre " +
                              std::to_string(i) + " is not positive");
    result(distinct.group[i]) = std::min(result(distinct.group[i]), given(i));
  }
  return result;
}

Factorisation factorisation_of(SolverKind solver) {
  if (solver == SolverKind::Lu) return Factorisation::Lu;
  if (solver == SolverKind::Ldlt) return Factorisation::Ldlt;
  return Factorisation::Cholesky;
}

double largest(const MatrixXd& values) {
  return values.size() == 0 ? 0 : values.cwiseAbs().maxCoeff();
}

// A value set on its way to a solution.
struct Problem {
  MatrixXd fit;     // coefficients of the linear fit
  MatrixXd values;  // at the distinct centres, less the fit
  double scale = 0;
  RbfReport report;
  UnitField field;
  std::exception_ptr error;
};

// Runs a step of one problem; keeps its error.
template <class Step>
void attempt(Problem& problem, const Step& step) {
  if (problem.error) return;
  try {
    step();
  } catch (...) {
    problem.error = std::current_exception();
  }
}

}  // namespace

struct RbfSystem::Impl {
  Impl(const RowMatrix& given, const Kernel& given_kernel, RbfOptions given_options);
  Impl(const RowMatrix& given, const Kernel& given_kernel, RbfOptions given_options,
       InputArchive& archive);
  void store(OutputArchive& archive) const;

  FastOptions fast_options() const {
    return {.tolerance = options.tolerance, .unit = frame.unit(), .progress = options.progress};
  }

  AdaptiveOptions adaptive_options() const {
    return {.tolerance = options.tolerance,
            .unit = frame.unit(),
            .most_missed = options.most_missed,
            .first = distinct_rows_of(options.first_centres),
            .progress = options.progress};
  }

  std::vector<Index> distinct_rows_of(const std::vector<Index>& given) const {
    std::vector<Index> result;
    for (const Index row : given) result.push_back(distinct.group[row]);
    std::ranges::sort(result);
    const auto rest = std::ranges::unique(result);
    result.erase(rest.begin(), rest.end());
    return result;
  }

  void set_up_fast();
  void set_up_qr();
  void require_memory(const RbfReport& report) const;
  std::unique_ptr<DenseSolver> factor_dense(RbfReport& into) const;
  const DenseSolver& fallback(RbfReport& into) const;
  MatrixXd distinct_values(const RowMatrix& values) const;
  void prepare(const RowMatrix& values, Problem& problem) const;
  void solve(std::vector<Problem>& problems) const;
  void take_fast(FastSolution solution, Problem& problem) const;
  std::unique_ptr<AdaptiveSolver> make_adaptive() const;
  const AdaptiveSolver& adaptive_fallback() const;
  std::optional<UnitField> solve_adaptive(const AdaptiveSolver& solver, const Problem& problem,
                                          RbfReport& into) const;
  UnitField adaptive_or_dense(const Problem& problem, RbfReport& into) const;
  UnitField dense_or_adaptive(const Problem& problem, RbfReport& into) const;
  UnitField solve_qr(const Problem& problem, RbfReport& into) const;
  UnitField solve_dense(const DenseSolver& solver, const Problem& problem, RbfReport& into) const;
  MatrixXd residual(const MatrixXd& values, const SaddleSolution& solution) const;
  double in_local_lengths(const MatrixXd& residual) const;
  std::string closest_centres() const;

  Kernel kernel;
  RbfOptions options;
  DistinctRows distinct;
  CentreFrame frame;
  KernelSum sum;
  Eigen::VectorXd local_length;
  std::shared_ptr<const MatrixXd> centres;  // distinct, in units of the frame
  MatrixXd P;
  std::shared_ptr<const DenseSolver> dense;
  std::unique_ptr<FastSolver> fast;
  std::unique_ptr<IncrementalQr> qr;
  std::unique_ptr<AdaptiveSolver> adaptive;
  RbfReport report;
  // For value sets that the solver failed on, made when first needed.
  struct Fallback {
    std::unique_ptr<DenseSolver> dense;
    std::unique_ptr<AdaptiveSolver> adaptive;
    RbfReport report;  // solver, condition, and what more the reason has to say
  };
  mutable std::mutex fallback_mutex;
  mutable Fallback fallback_;
};

RbfSystem::Impl::Impl(const RowMatrix& given, const Kernel& given_kernel, RbfOptions given_options)
    : kernel(given_kernel),
      options(std::move(given_options)),
      distinct(distinct_rows(given)),
      frame(RowMatrix(given(distinct.rows, Eigen::all))),
      sum(in_units(kernel, frame.unit()), log_scale(kernel, frame.unit())) {
  if (options.local_length.size() != 0 && options.local_length.size() != given.rows())
    throw InvalidInputError("RBF system: " + std::to_string(options.local_length.size()) +
                            " local lengths for " + std::to_string(given.rows()) + " centres");
  if (!(options.tolerance > 0))
    throw InvalidInputError("RBF system: the tolerance " + scientific(options.tolerance) +
                            " is not positive");
  const Stopwatch watch;
  centres = std::make_shared<MatrixXd>(frame.to_unit(RowMatrix(given(distinct.rows, Eigen::all))));
  local_length = local_lengths(given, distinct, options.local_length);
  P = frame.polynomials(*centres);
  report.centres = centres->rows();
  report.merged = given.rows() - centres->rows();
  report.polynomial_terms = frame.terms();
  const SolverChoice choice = choose_solver(options.solver, kernel, given.cols(), centres->rows());
  report.solver = choice.solver;
  report.reason = choice.reason;
  if (report.solver == SolverKind::Fast) set_up_fast();
  if (report.solver == SolverKind::Iqr) set_up_qr();
  if (report.solver == SolverKind::Adaptive) adaptive = make_adaptive();
  if (!fast && !qr && !adaptive) dense = factor_dense(report);
  report.seconds = watch.seconds();
}

RbfSystem::Impl::Impl(const RowMatrix& given, const Kernel& given_kernel, RbfOptions given_options,
                      InputArchive& archive)
    : kernel(given_kernel),
      options(std::move(given_options)),
      distinct(take<DistinctRows>(archive)),
      frame(RowMatrix(given(distinct.rows, Eigen::all))),
      sum(in_units(kernel, frame.unit()), log_scale(kernel, frame.unit())) {
  const Stopwatch watch;
  centres = std::make_shared<MatrixXd>(frame.to_unit(RowMatrix(given(distinct.rows, Eigen::all))));
  P = frame.polynomials(*centres);
  archive(local_length, report);
  if (report.solver == SolverKind::Fast)
    fast = std::make_unique<FastSolver>(*centres, fast_options(), archive);
  else if (report.solver == SolverKind::Iqr)
    set_up_qr();
  else if (report.solver == SolverKind::Adaptive)
    adaptive = std::make_unique<AdaptiveSolver>(*centres, adaptive_options(), archive);
  else
    dense = restore_dense_solver(factorisation_of(report.solver), P, archive);
  report.seconds = watch.seconds();
}

void RbfSystem::Impl::store(OutputArchive& archive) const {
  archive(distinct, local_length, report);
  if (fast) fast->store(archive);
  if (adaptive) adaptive->store(archive);
  if (dense) dense->store(archive);
}

std::unique_ptr<AdaptiveSolver> RbfSystem::Impl::make_adaptive() const {
  return std::make_unique<AdaptiveSolver>(*centres, local_length / frame.unit(),
                                          adaptive_options());
}

// Its columns come with the first value set.
void RbfSystem::Impl::set_up_qr() {
  qr = std::make_unique<IncrementalQr>(
      sum, centres, P, local_length,
      QrOptions{.tolerance = options.tolerance, .memory_limit = options.memory_limit});
}

void RbfSystem::Impl::set_up_fast() {
  const double bytes = kFastBytes * static_cast<double>(centres->rows());
  if (bytes > options.memory_limit)
    throw SolverError("the fast solver for " + std::to_string(centres->rows()) +
                      " centres needs some " + scientific(bytes) + " bytes, more than the " +
                      scientific(options.memory_limit) + " allowed; allow more memory");
  try {
    fast = std::make_unique<FastSolver>(*centres, local_length / frame.unit(), fast_options());
    if (!fast->remarks().empty()) report.reason += "; " + fast->remarks();
  } catch (const SolverError& error) {
    report.solver = SolverKind::Cholesky;
    report.reason = std::string("fast solver not possible: ") + error.what();
  }
}

// LU and LDL^T hold the kernel matrix beside the saddle matrix that is made of it.
void RbfSystem::Impl::require_memory(const RbfReport& into) const {
  const double rows = static_cast<double>(centres->rows() + P.cols());
  const double bytes = (into.solver == SolverKind::Cholesky ? 8 : 16) * rows * rows;
  if (bytes <= options.memory_limit) return;
  const bool is_chosen = into.solver == options.solver;
  throw SolverError("a dense solver for " + std::to_string(centres->rows()) + " centres needs " +
                    scientific(bytes) + " bytes, more than the " +
                    scientific(options.memory_limit) + " allowed; allow more memory" +
                    (is_chosen && is_triharmonic_3d(kernel, centres->cols())
                         ? ", or use the fast solver"
                         : " (" + into.reason + ")"));
}

std::unique_ptr<DenseSolver> RbfSystem::Impl::factor_dense(RbfReport& into) const {
  require_memory(into);
  std::unique_ptr<DenseSolver> solver;
  try {
    solver = make_dense_solver(factorisation_of(into.solver), sum.matrix(*centres), P,
                               kernel.cpd_sign());
  } catch (const SolverError&) {
    if (options.solver == SolverKind::Cholesky || into.solver != SolverKind::Cholesky) throw;
    into.solver = SolverKind::Ldlt;
    into.reason += "; Cholesky found the system not definite to rounding (centres nearly coincide)";
    require_memory(into);
    solver = make_dense_solver(Factorisation::Ldlt, sum.matrix(*centres), P, kernel.cpd_sign());
  }
  into.reciprocal_condition = solver->reciprocal_condition();
  return solver;
}

const DenseSolver& RbfSystem::Impl::fallback(RbfReport& into) const {
  const std::lock_guard lock(fallback_mutex);
  if (!fallback_.dense) {
    RbfReport report = into;
    report.solver = SolverKind::Cholesky;
    fallback_.dense = factor_dense(report);
    report.reason.erase(0, into.reason.size());
    fallback_.report = std::move(report);
  }
  into.solver = fallback_.report.solver;
  into.reason += fallback_.report.reason;
  into.reciprocal_condition = fallback_.report.reciprocal_condition;
  return *fallback_.dense;
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
  return values(distinct.rows, Eigen::all);
}

MatrixXd RbfSystem::Impl::residual(const MatrixXd& values, const SaddleSolution& solution) const {
  return values - sum(*centres, *centres, solution.weights) - P * solution.coefficients;
}

double RbfSystem::Impl::in_local_lengths(const MatrixXd& residual) const {
  return residual.size() == 0
             ? 0
             : (residual.rowwise().norm().array() / local_length.array()).maxCoeff();
}

// Which two centres are closest to each other, and where.
std::string RbfSystem::Impl::closest_centres() const {
  if (centres->rows() < 2) return "";
  const RowMatrix points = *centres;
  Index one = 0;
  const double distance = nearest_distances(points).minCoeff(&one);
  const auto near = KdTree(points).nearest(points.row(one).data(), 2);
  const Index other = near.front().index == one ? near.back().index : near.front().index;
  const Eigen::RowVectorXd place = frame.centre() + frame.unit() * centres->row(one);
  std::ostringstream text;
  text << "; centres " << std::min(distinct.rows[one], distinct.rows[other]) << " and "
       << std::max(distinct.rows[one], distinct.rows[other]) << " are closest, "
       << frame.unit() * distance << " apart, at (";
  for (Index d = 0; d < place.size(); ++d) text << (d > 0 ? ", " : "") << place(d);
  text << ")";
  return text.str();
}

// The linear fit apart: affine values are then reproduced to rounding by every solver.
void RbfSystem::Impl::prepare(const RowMatrix& values, Problem& problem) const {
  if (values.rows() != static_cast<Index>(distinct.group.size()))
    throw InvalidInputError("RBF system: " + std::to_string(values.rows()) + " values for " +
                            std::to_string(distinct.group.size()) + " centres");
  require_finite(values, "value");
  problem.values = distinct_values(values);
  problem.scale = largest(problem.values);
  problem.fit = P.transpose() * problem.values / static_cast<double>(problem.values.rows());
  problem.values -= P * problem.fit;
}

void RbfSystem::Impl::solve(std::vector<Problem>& problems) const {
  if (fast) {
    std::vector<Problem*> sound;
    std::vector<MatrixXd> value_sets;
    for (Problem& problem : problems) {
      if (problem.error) continue;
      sound.push_back(&problem);
      value_sets.push_back(problem.values);
    }
    std::vector<FastSolution> solutions = fast->solve(value_sets);
    for (std::size_t p = 0; p < sound.size(); ++p)
      attempt(*sound[p], [&] { take_fast(std::move(solutions[p]), *sound[p]); });
  } else {
    for (Problem& problem : problems)
      attempt(problem, [&] {
        RbfReport& into = problem.report;
        if (adaptive)
          problem.field = adaptive_or_dense(problem, into);
        else
          problem.field = qr ? solve_qr(problem, into) : dense_or_adaptive(problem, into);
      });
  }
}

const AdaptiveSolver& RbfSystem::Impl::adaptive_fallback() const {
  const std::lock_guard lock(fallback_mutex);
  if (!fallback_.adaptive) fallback_.adaptive = make_adaptive();
  return *fallback_.adaptive;
}

// Nothing where it fails; the reason then says why.
std::optional<UnitField> RbfSystem::Impl::solve_adaptive(const AdaptiveSolver& solver,
                                                         const Problem& problem,
                                                         RbfReport& into) const {
  AdaptiveSolution solution = solver.solve(problem.values);
  if (!solution.field) {
    into.reason = "adaptive solver failed: " + solution.error;
    return {};
  }
  into.iterations = static_cast<int>(solution.centres.size());
  into.max_residual = solution.in_local_lengths;
  into.reason += "; " + std::to_string(solution.centres.size()) + " kernels miss at most " +
                 scientific(solution.missed) + " spacings, the correction takes that";
  return std::move(solution.field);
}

UnitField RbfSystem::Impl::adaptive_or_dense(const Problem& problem, RbfReport& into) const {
  std::optional<UnitField> field = solve_adaptive(*adaptive, problem, into);
  return field ? std::move(*field) : solve_dense(fallback(into), problem, into);
}

// Centres that nearly coincide and move apart by far more than their distance take weights whose
// sums round to more than is allowed. The adaptive solver leaves one of them to the correction.
UnitField RbfSystem::Impl::dense_or_adaptive(const Problem& problem, RbfReport& into) const {
  try {
    return solve_dense(*dense, problem, into);
  } catch (const SolverError&) {
    if (options.solver != SolverKind::Auto || !is_triharmonic_3d(kernel, centres->cols())) throw;
    RbfReport report = into;
    report.solver = SolverKind::Adaptive;
    report.reciprocal_condition = 0;
    report.reason += "; the dense solver misses values (centres nearly coincide and move apart)";
    std::optional<UnitField> field = solve_adaptive(adaptive_fallback(), problem, report);
    if (!field) throw;
    into = std::move(report);
    return std::move(*field);
  }
}

// Takes the true residual, too: rounding must not have spoilt what the QR promises.
UnitField RbfSystem::Impl::solve_qr(const Problem& problem, RbfReport& into) const {
  QrSolution solution = qr->solve(problem.values);
  const auto taken = static_cast<Index>(solution.rows.size());
  MatrixXd points(taken, centres->cols());
  for (Index i = 0; i < taken; ++i) points.row(i) = centres->row(solution.rows[i]);
  const MatrixXd missed =
      problem.values - sum(*centres, points, solution.weights) - P * solution.coefficients;
  const double mean =
      std::sqrt((missed.rowwise().squaredNorm().array() / local_length.array().square()).mean());
  if (!(mean <= kQrRounding * options.tolerance))
    throw SolverError("the incremental QR solver lost its accuracy to rounding: residual " +
                      scientific(mean) + " local lengths; allow a larger tolerance");
  into.iterations = static_cast<int>(taken);
  into.max_residual = in_local_lengths(missed);
  into.reason += "; " + std::to_string(taken) + " of " + std::to_string(centres->rows()) +
                 " kernels, mean residual " + scientific(mean) + " local edges";
  UnitField field;
  field.centres = std::make_shared<const MatrixXd>(std::move(points));
  field.weights = std::move(solution.weights);
  field.linear = frame.linear(solution.coefficients);
  return field;
}

// A fast solution, or where there is none the dense one.
void RbfSystem::Impl::take_fast(FastSolution solution, Problem& problem) const {
  RbfReport& report = problem.report;
  if (!solution.field) {
    report.reason = "fast solver failed: " + solution.error;
    problem.field = solve_dense(fallback(report), problem, report);
    return;
  }
  const FastReport& details = solution.report;
  problem.field = std::move(*solution.field);
  report.iterations = details.iterations;
  report.max_residual = details.in_local_lengths;
  if (details.thinned > 0)
    report.reason += "; " + std::to_string(details.thinned) +
                     " closely spaced centres served by the multiscale correction";
  if (!details.remarks.empty()) report.reason += "; " + details.remarks;
}

UnitField RbfSystem::Impl::solve_dense(const DenseSolver& solver, const Problem& problem,
                                       RbfReport& into) const {
  const MatrixXd& values = problem.values;
  const double scale = problem.scale;
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
  if (!(largest(missed) <= kDenseAccuracy * scale) && !(into.max_residual <= kHarmless))
    throw SolverError("the interpolation matrix of " + std::to_string(centres->rows()) +
                      " centres is singular to rounding (reciprocal condition " +
                      scientific(solver.reciprocal_condition()) + closest_centres() +
                      "); remove centres that nearly coincide, or choose another " +
                      (is_triharmonic_3d(kernel, centres->cols()) ? "solver, " : "") +
                      "kernel or shape");
  UnitField field;
  field.centres = centres;
  field.weights = std::move(solution.weights);
  field.linear = frame.linear(solution.coefficients);
  return field;
}

RbfSystem::RbfSystem(const RowMatrix& centres, Kernel kernel, RbfOptions options) {
  if (centres.size() == 0) throw InvalidInputError("RBF system: there are no centres");
  require_finite(centres, "centre");
  impl_ = std::make_shared<const Impl>(centres, kernel, std::move(options));
}

RbfSystem::RbfSystem(const RowMatrix& centres, Kernel kernel, RbfOptions options,
                     InputArchive& archive)
    : impl_(std::make_shared<const Impl>(centres, kernel, std::move(options), archive)) {}

void RbfSystem::store(OutputArchive& archive) const { impl_->store(archive); }

RbfField RbfSystem::solve(const RowMatrix& values) const {
  RbfSolution solution = std::move(solve_each({values}).front());
  if (solution.error) std::rethrow_exception(solution.error);
  return std::move(solution.field);
}

std::vector<RbfSolution> RbfSystem::solve_each(const std::vector<RowMatrix>& value_sets) const {
  const Impl& s = *impl_;
  const Stopwatch watch;
  std::vector<Problem> problems(value_sets.size());
  for (std::size_t p = 0; p < problems.size(); ++p) {
    problems[p].report = s.report;
    attempt(problems[p], [&] { s.prepare(value_sets[p], problems[p]); });
  }
  s.solve(problems);
  std::vector<RbfSolution> solutions;
  for (Problem& problem : problems) {
    problem.report.seconds += watch.seconds() / static_cast<double>(problems.size());
    RbfSolution& solution = solutions.emplace_back();
    solution.error = problem.error;
    if (problem.error) continue;
    problem.field.linear += s.frame.linear(problem.fit);
    solution.field.impl_ = std::make_shared<const RbfField::Impl>(RbfField::Impl{
        s.frame, s.kernel, s.sum, std::move(problem.field), std::move(problem.report)});
  }
  return solutions;
}

RbfDerivative RbfSystem::derivative(const RbfField& field, const RowMatrix& targets) const {
  return derivative(field.impl_->field.rows, targets);
}

RbfDerivative RbfSystem::derivative(const RowMatrix& targets) const {
  return derivative(std::vector<Index>(), targets);
}

RbfDerivative RbfSystem::derivative(std::vector<Index> rows, const RowMatrix& targets) const {
  const Impl& s = *impl_;
  if (s.qr)
    throw InvalidInputError(
        "the incremental QR solver fits the values and has no derivative here; use another solver");
  if (targets.cols() != s.frame.dimension())
    throw InvalidInputError("RBF derivative: targets of dimension " +
                            std::to_string(targets.cols()) + " for centres of dimension " +
                            std::to_string(s.frame.dimension()));
  const bool is_of_all = rows.empty();
  const double from = s.adaptive              ? s.adaptive->correction_from()
                      : s.fast                ? s.fast->correction_from()
                      : s.dense && !is_of_all ? s.adaptive_fallback().correction_from()
                                              : 0;
  RbfDerivative result;
  result.map_ = std::make_shared<const FieldDerivative>(
      FrozenField{.points = s.centres,
                  .centres = std::move(rows),
                  .correction_from = from,
                  .frame = s.frame,
                  .kernel = in_units(s.kernel, s.frame.unit()),
                  .log_scale = log_scale(s.kernel, s.frame.unit()),
                  .memory_limit = s.options.memory_limit,
                  .solver = is_of_all ? s.dense : nullptr},
      s.frame.to_unit(targets));
  result.rows_ = s.distinct.rows;
  result.count_ = static_cast<Index>(s.distinct.group.size());
  return result;
}

MatrixXd RbfDerivative::forward(const MatrixXd& values) const {
  return map_->forward(values(rows_, Eigen::all));
}

MatrixXd RbfDerivative::adjoint(const MatrixXd& slopes) const {
  MatrixXd result = MatrixXd::Zero(count_, slopes.cols());
  result(rows_, Eigen::all) = map_->adjoint(slopes);
  return result;
}

std::vector<Index> RbfSystem::kernels(const RbfField& field) const {
  const std::vector<Index>& rows = field.impl_->field.rows;
  if (rows.empty()) return impl_->distinct.rows;
  std::vector<Index> result;
  for (const Index row : rows) result.push_back(impl_->distinct.rows[row]);
  std::ranges::sort(result);
  return result;
}

const RbfReport& RbfSystem::report() const { return impl_->report; }

RbfTargets::RbfTargets(const RbfSystem& system, const RowMatrix& targets) {
  const RbfSystem::Impl& s = *system.impl_;
  const auto far_field = s.fast ? s.fast->far_field() : nullptr;
  impl_ =
      std::make_shared<const Impl>(Impl{unit_targets(s.frame, s.sum, targets, far_field.get())});
}

RbfTargets::RbfTargets(const RbfSystem& system, InputArchive& archive)
    : impl_(std::make_shared<const Impl>(Impl{UnitTargets(system.impl_->sum, archive)})) {}

void RbfTargets::store(OutputArchive& archive) const { impl_->targets.store(archive); }

}  // namespace cadmorph
