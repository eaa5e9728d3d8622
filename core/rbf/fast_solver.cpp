#include "core/rbf/fast_solver.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <mutex>
#include <utility>

#include "core/archive_types.h"
#include "core/errors.h"
#include "core/kd_tree.h"
#include "core/parallel.h"
#include "core/rbf/centre_frame.h"
#include "core/rbf/conjugate_gradient.h"
#include "core/rbf/h2_matrix.h"
#include "core/rbf/multiscale_correction.h"
#include "core/rbf/point_order.h"
#include "core/rbf/sparse_inverse_cholesky.h"
#include "core/rbf/unit_targets.h"

namespace cadmorph {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

// Centres are kept this part of the bounding box's diagonal apart, where r^3 is 1.6e-14 of what it
// is across: closer ones cost more digits than a double has. Finer points get the correction.
constexpr double kThinning = 2.5e-5;

// Up to here direct sums beat the H2 matrix, its set-up included.
constexpr Index kDirectCentres = 12000;

// Measured stencil defects (ordinary parts: 0.002, steep grading 0.008, thin gaps up to 0.1): from
// which on all stencils are larger, and from which on they are enlarged one by one. With half of
// the first, canisters of 15,666 and 21,124 centres take 10 and 9 iterations as ever, with twice 13
// and 12, and the test of thin walls fails; with half of the last that of thin sheets does.
constexpr double kDefectWide = 0.005;
constexpr double kDefectWider = 0.01;
constexpr double kDefectAdaptive = 0.03;

constexpr int kIterations = 25;           // enough for every sound factor: measured 8 to 21
constexpr int kAdaptiveIterations = 100;  // unmatched gaps of 0.005 node spacings take 39
// With 0 walls so thin that the far field misses sums fail; 2 or 8 solve all that the tests have.
constexpr int kRestarts = 4;

// Part of the allowance that the recursive residual is driven to: the true one is a little larger.
// With 0.4 or 1 those canisters take as many iterations, and the tests pass.
constexpr double kMargin = 0.8;

// Accuracy of the H2 matrix per tolerance asked: leaves its error below the allowance (measured: up
// to 0.9 of it for the sphere in a box at 100,000 nodes).
constexpr double kFarFieldAccuracy = 2e-4;

// A coarser H2 matrix serves once the residual is below kRelaxedBelow allowances: errors of the
// product then matter less in that proportion (measured: leaves the true residual unchanged). With
// half or twice of either those canisters take as many iterations, and their time to 5 %.
constexpr double kRelaxedAccuracy = 2.5e3;
constexpr double kRelaxedBelow = 1e3;

// Part of the largest value that the rounding of the sums may come to.
constexpr double kRounding = 1e-9;

// Rounding of a sum in terms of its largest possible one-step error, eps sum |w| r^3 (measured: up
// to 1.5), and the part of the largest value up to which it is accepted, as for the dense solvers.
constexpr double kSumRounding = 2 * std::numeric_limits<double>::epsilon();
constexpr double kWorstRounding = 1e-6;

double diagonal(const MatrixXd& points) {
  return (points.colwise().maxCoeff() - points.colwise().minCoeff()).norm();
}

// Elimination order of the points that are kept: rows of the given points.
std::vector<Index> kept_rows(const PointOrder& order, const Points& ordered, double distance) {
  Index count = 0;
  while (count < ordered.rows() && order.separation[count] >= distance) ++count;
  const Points kept = ordered.topRows(count);
  const std::vector<double> separation(order.separation.begin(), order.separation.begin() + count);
  const int terms = CentreFrame(kept).terms();
  std::vector<Index> rows = leader_follower_order(kept, separation, terms);
  for (Index& row : rows) row = order.rows[row];
  return rows;
}

// The matrix of the system, and a coarser form; none: direct sums.
struct FarField {
  std::shared_ptr<const H2Matrix> exact, relaxed;
};

// How far a solution has got.
struct Progression {
  MatrixXd values;                    // at the kept points
  VectorXd allowed;                   // residual of each
  MatrixXd weights, image, residual;  // image: sums of the weights at the points
  bool is_adaptive = false;           // has the larger stencils
  int restarts = 0;
  bool is_solved = false;
  std::string error;
  FastReport report;

  bool is_open() const { return !is_solved && error.empty(); }
};

}  // namespace

struct FastSolver::Impl {
  Impl(const MatrixXd& given, const VectorXd& local_length, FastOptions options);
  Impl(const MatrixXd& given, FastOptions options, InputArchive& archive);
  void store(OutputArchive& archive) const;

  void choose_stencils();
  std::shared_ptr<const SparseInverseCholesky> factor(bool is_adaptive) const;
  void set_up_far_field();
  MatrixXd multiply(const H2Matrix* h2, const MatrixXd& weights) const {
    return h2 ? h2->multiply(weights) : sum(*points, *points, weights);
  }

  Progression start(const MatrixXd& values) const;
  void advance(const std::vector<Progression*>& solutions) const;
  void iterate(const std::vector<Progression*>& solutions) const;
  void take_images(const std::vector<Progression*>& solutions,
                   const std::vector<CgResult>& steps) const;
  void verify(Progression& solution, bool has_converged) const;
  bool is_rounding(const MatrixXd& residual, const Progression& solution) const;
  double sampled_error(const Progression& solution) const;
  FastSolution finish(Progression solution) const;
  void correct(const std::vector<MatrixXd>& value_sets, std::vector<FastSolution>& solutions) const;
  VectorXd allowance(const VectorXd& lengths, const MatrixXd& values) const;
  double in_local_lengths(const MatrixXd& residual, const std::vector<Index>& of) const;

  FastOptions options;
  PointOrder order;         // of all points, farthest first
  Points ordered;           // all points in that order
  VectorXd ordered_length;  // local lengths of all points in that order
  double thinning_distance;
  std::vector<Index> rows;  // kept points (rows of the given), coarse to fine for the factor
  std::shared_ptr<const MatrixXd> points;  // kept, in that order
  Points point_rows;                       // the same, row-major
  VectorXd length;                         // local length of kept points, where thinning left room
  CentreFrame frame;
  MatrixXd P;
  KernelSum sum{Kernel::triharmonic_3d()};
  FactorOptions stencils;
  FarField far;
  std::string remarks;

  mutable std::mutex mutex;  // of what follows, made when first needed
  mutable std::map<bool, std::shared_ptr<const SparseInverseCholesky>> factors;
};

FastSolver::Impl::Impl(const MatrixXd& given, const VectorXd& local_length,
                       FastOptions given_options)
    : options(std::move(given_options)),
      order(farthest_point_order(given)),
      ordered(given(order.rows, Eigen::all)),
      thinning_distance(kThinning * diagonal(given)),
      rows(kept_rows(order, ordered, thinning_distance)),
      points(std::make_shared<const MatrixXd>(given(rows, Eigen::all))),
      point_rows(*points),
      frame(point_rows),
      P(frame.polynomials(frame.to_unit(point_rows))) {
  const VectorXd nearest = nearest_distances(given);
  const VectorXd lengths = local_length.size() == 0 ? nearest : local_length;
  ordered_length = lengths(order.rows, Eigen::all);
  length = nearest_distances(point_rows);
  for (Index i = 0; i < length.size(); ++i)
    length(i) *= std::min(1.0, lengths(rows[i]) / nearest(rows[i]));
  const auto tell = [&](double fraction) {
    if (options.progress) options.progress("preparing the solver", fraction);
  };
  tell(0.1);
  choose_stencils();
  factor(stencils.is_adaptive);
  tell(0.5);
  set_up_far_field();
  tell(1);
}

FastSolver::Impl::Impl(const MatrixXd& given, FastOptions given_options, InputArchive& archive)
    : options(std::move(given_options)),
      order(take<PointOrder>(archive)),
      ordered(given(order.rows, Eigen::all)),
      thinning_distance(kThinning * diagonal(given)),
      rows(take<std::vector<Index>>(archive)),
      points(std::make_shared<const MatrixXd>(given(rows, Eigen::all))),
      point_rows(*points),
      frame(point_rows),
      P(frame.polynomials(frame.to_unit(point_rows))) {
  archive(ordered_length, length, stencils, remarks);
  factors[stencils.is_adaptive] = std::make_shared<const SparseInverseCholesky>(archive);
  if (!take<bool>(archive)) return;
  far.exact = std::make_shared<const H2Matrix>(archive);
  far.relaxed = std::make_shared<const H2Matrix>(archive);
}

void FastSolver::Impl::store(OutputArchive& archive) const {
  archive(order, rows, ordered_length, length, stencils, remarks);
  factor(stencils.is_adaptive)->store(archive);
  archive(static_cast<bool>(far.exact));
  if (!far.exact) return;
  far.exact->store(archive);
  far.relaxed->store(archive);
}

void FastSolver::Impl::choose_stencils() {
  const double defect = stencil_defect(point_rows, frame.terms(), stencils);
  if (defect > kDefectAdaptive) {
    stencils.is_adaptive = true;
    remarks = "larger stencils for thin gaps";
  } else if (defect > kDefectWide) {
    stencils.neighbours = defect > kDefectWider ? 128 : 96;
  }
}

std::shared_ptr<const SparseInverseCholesky> FastSolver::Impl::factor(bool is_adaptive) const {
  const std::lock_guard lock(mutex);
  auto& result = factors[is_adaptive];
  if (!result)
    result = std::make_shared<const SparseInverseCholesky>(
        point_rows, frame.terms(), is_adaptive ? FactorOptions{.is_adaptive = true} : stencils);
  return result;
}

void FastSolver::Impl::set_up_far_field() {
  if (points->rows() <= kDirectCentres) return;
  const double accuracy = kFarFieldAccuracy * options.tolerance;
  far.exact = std::make_shared<const H2Matrix>(*points, length, H2Options{.accuracy = accuracy});
  far.relaxed = std::make_shared<const H2Matrix>(
      *points, length, H2Options{.accuracy = kRelaxedAccuracy * accuracy});
}

// The image against direct sums at some centres, in units of their allowance.
double FastSolver::Impl::sampled_error(const Progression& solution) const {
  constexpr Index kSample = 256;  // of more than 12,000: a fiftieth of a direct product at most
  std::vector<Index> sample(std::min(kSample, points->rows()));
  for (std::size_t s = 0; s < sample.size(); ++s)
    sample[s] = static_cast<Index>(s) * points->rows() / static_cast<Index>(sample.size());
  const MatrixXd exact = sum((*points)(sample, Eigen::all), *points, solution.weights);
  return relative_residual(exact - solution.image(sample, Eigen::all),
                           solution.allowed(sample, Eigen::all));
}

VectorXd FastSolver::Impl::allowance(const VectorXd& lengths, const MatrixXd& values) const {
  const double least = kRounding * values.cwiseAbs().maxCoeff() + 1e-300;
  return (options.tolerance * options.unit * lengths).cwiseMax(least);
}

// Largest residual of these of the given points.
double FastSolver::Impl::in_local_lengths(const MatrixXd& residual,
                                          const std::vector<Index>& of) const {
  VectorXd lengths(ordered_length.size());
  lengths(order.rows) = ordered_length;
  return (residual.rowwise().norm().array() / lengths(of).array()).maxCoeff() / options.unit;
}

Progression FastSolver::Impl::start(const MatrixXd& values) const {
  Progression result;
  result.values = values(rows, Eigen::all);
  result.allowed = allowance(length, values);
  result.weights = MatrixXd::Zero(result.values.rows(), result.values.cols());
  result.image = result.weights;
  result.residual = result.values;
  result.is_adaptive = stencils.is_adaptive;
  return result;
}

// One run of conjugate gradients from the true residuals of solutions with the same tools.
void FastSolver::Impl::advance(const std::vector<Progression*>& solutions) const {
  try {
    iterate(solutions);
  } catch (const SolverError& error) {
    for (Progression* solution : solutions) solution->error = error.what();
  }
}

void FastSolver::Impl::iterate(const std::vector<Progression*>& solutions) const {
  const Progression& first = *solutions.front();
  const auto preconditioner = factor(first.is_adaptive);
  std::vector<MatrixXd> residuals;
  std::vector<VectorXd> goals;
  for (const Progression* solution : solutions) {
    residuals.push_back(solution->residual);
    goals.push_back(kMargin * solution->allowed);
  }
  CgOptions cg{.max_iterations = first.is_adaptive ? kAdaptiveIterations : kIterations};
  if (far.relaxed) {
    cg.relaxed = [&](const MatrixXd& x) { return far.relaxed->multiply(x); };
    cg.relaxed_below = kRelaxedBelow;
  }
  if (options.progress)
    cg.watch = [&](int iteration, double) {
      options.progress("solving", std::min(0.95, iteration / 12.0));
    };
  const std::vector<CgResult> steps = solve_projected_cg(
      [&](const MatrixXd& x) { return multiply(far.exact.get(), x); },
      [&](const MatrixXd& x) { return preconditioner->apply(x); }, P, residuals, goals, cg);
  for (std::size_t s = 0; s < solutions.size(); ++s) {
    solutions[s]->report.iterations += steps[s].iterations;
    solutions[s]->weights += steps[s].weights;
  }
  take_images(solutions, steps);
  for (std::size_t s = 0; s < solutions.size(); ++s)
    verify(*solutions[s], steps[s].has_converged());
}

// Adds the steps' images, as the far field sees them. Where weights are so large (thin walls) that
// it misses a sum, direct ones take its place: the steps that follow are small, and so is what it
// misses of them.
void FastSolver::Impl::take_images(const std::vector<Progression*>& solutions,
                                   const std::vector<CgResult>& steps) const {
  std::vector<const MatrixXd*> columns;
  if (far.exact) {
    for (const CgResult& step : steps) columns.push_back(&step.weights);
    const MatrixXd images = far.exact->multiply(join_columns(columns));
    Index column = 0;
    for (Progression* solution : solutions) {
      solution->image += images.middleCols(column, solution->image.cols());
      column += solution->image.cols();
    }
  }
  std::vector<Progression*> missed;
  columns.clear();
  for (Progression* solution : solutions) {
    if (far.exact && sampled_error(*solution) <= 1) continue;
    if (far.exact) solution->report.remarks = "direct sums: the far field missed some centres";
    missed.push_back(solution);
    columns.push_back(&solution->weights);
  }
  if (missed.empty()) return;
  const MatrixXd images = sum(*points, *points, join_columns(columns));
  Index column = 0;
  for (Progression* solution : missed) {
    solution->image = images.middleCols(column, solution->image.cols());
    column += solution->image.cols();
  }
}

// Whether a residual is no more than the rounding of the sums that it comes from. Weights are large
// where centres that nearly coincide move apart.
bool FastSolver::Impl::is_rounding(const MatrixXd& residual, const Progression& solution) const {
  const MatrixXd magnitudes = multiply(far.exact.get(), solution.weights.cwiseAbs());
  const double most = kWorstRounding * solution.values.cwiseAbs().maxCoeff();
  const VectorXd rounding = (kSumRounding * magnitudes.rowwise().norm()).cwiseMin(most);
  return relative_residual(residual, solution.allowed.cwiseMax(rounding)) <= 1;
}

// Takes the true residual and says how to go on where it is above the allowance.
void FastSolver::Impl::verify(Progression& solution, bool has_converged) const {
  solution.residual = solution.values - solution.image;
  MatrixXd projected = solution.residual;
  project_out(P, projected);
  FastReport& report = solution.report;
  report.residual = relative_residual(projected, solution.allowed);
  if (report.residual <= 1 || (has_converged && is_rounding(projected, solution))) {
    solution.is_solved = true;
    report.in_local_lengths = in_local_lengths(projected, rows);
    if (report.residual > 1) report.remarks = "solved to the rounding of the sums";
  } else if (++solution.restarts > kRestarts || (!has_converged && solution.is_adaptive)) {
    solution.error = "the fast solver reached only " + std::to_string(report.residual) +
                     " times the residual asked in " + std::to_string(report.iterations) +
                     " iterations; allow a larger tolerance or use a dense solver";
  } else if (!has_converged) {
    solution.is_adaptive = true;
    report.remarks = "larger stencils: the plain ones did not converge";
  }
}

FastSolution FastSolver::Impl::finish(Progression solution) const {
  if (!solution.is_solved) return {{}, solution.error, solution.report};
  const MatrixXd coefficients = P.transpose() * solution.residual / static_cast<double>(P.rows());
  UnitField field{.centres = points,
                  .weights = std::move(solution.weights),
                  .linear = frame.linear_in_given(coefficients),
                  .far_field = far.exact,
                  .correction = nullptr,
                  .rows = rows};
  return {std::move(field), {}, std::move(solution.report)};
}

// Adds the multiscale correction where points were thinned out.
void FastSolver::Impl::correct(const std::vector<MatrixXd>& value_sets,
                               std::vector<FastSolution>& solutions) const {
  const UnitTargets all(sum, ordered, far.exact.get());
  for (std::size_t s = 0; s < solutions.size(); ++s) {
    FastSolution& solution = solutions[s];
    if (!solution.field) continue;
    solution.report.thinned = ordered.rows() - points->rows();
    try {
      const MatrixXd missed =
          value_sets[s](order.rows, Eigen::all) - all.evaluate({&*solution.field}).front();
      auto correction = std::make_shared<const MultiscaleCorrection>(
          ordered, order.separation, missed, allowance(ordered_length, value_sets[s]),
          thinning_distance);
      solution.report.in_local_lengths = in_local_lengths(correction->remainders(), order.rows);
      if (!correction->is_empty()) solution.field->correction = std::move(correction);
    } catch (const SolverError& error) {
      solution.field.reset();
      solution.error = error.what();
    }
  }
}

FastSolver::FastSolver(const MatrixXd& points, const VectorXd& local_length, FastOptions options)
    : impl_(std::make_shared<const Impl>(points, local_length, std::move(options))) {}

FastSolver::FastSolver(const MatrixXd& points, FastOptions options, InputArchive& archive)
    : impl_(std::make_shared<const Impl>(points, std::move(options), archive)) {}

void FastSolver::store(OutputArchive& archive) const { impl_->store(archive); }

std::vector<FastSolution> FastSolver::solve(const std::vector<MatrixXd>& value_sets) const {
  const Impl& s = *impl_;
  std::vector<Progression> progress;
  for (const MatrixXd& values : value_sets) progress.push_back(s.start(values));
  while (true) {
    const auto open =
        std::find_if(progress.begin(), progress.end(), [](auto& p) { return p.is_open(); });
    if (open == progress.end()) break;
    std::vector<Progression*> group;
    for (auto p = open; p != progress.end(); ++p)
      if (p->is_open() && p->is_adaptive == open->is_adaptive) group.push_back(&*p);
    s.advance(group);
  }
  std::vector<FastSolution> solutions;
  for (Progression& solution : progress) solutions.push_back(s.finish(std::move(solution)));
  if (s.ordered.rows() > s.points->rows()) s.correct(value_sets, solutions);
  return solutions;
}

double FastSolver::correction_from() const { return impl_->thinning_distance; }

const std::string& FastSolver::remarks() const { return impl_->remarks; }

std::shared_ptr<const H2Matrix> FastSolver::far_field() const { return impl_->far.exact; }

}  // namespace cadmorph
