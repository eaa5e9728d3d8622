#include "core/rbf/fast_solver.h"

#include <algorithm>
#include <cmath>
#include <mutex>
#include <vector>

#include "core/errors.h"
#include "core/rbf/centre_frame.h"
#include "core/rbf/conjugate_gradient.h"
#include "core/rbf/field_evaluator.h"
#include "core/rbf/h2_matrix.h"
#include "core/rbf/multiscale_correction.h"
#include "core/rbf/point_order.h"
#include "core/rbf/sparse_inverse_cholesky.h"

namespace cadmorph {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

// Centres are kept this part of the bounding box's diagonal apart; finer points get the correction.
constexpr double kThinning = 5e-5;

// Up to here direct sums beat the H2 matrix, its set-up included.
constexpr Index kDirectCentres = 12000;

// Stencils are enlarged where the measured defect is above this.
constexpr double kDefectLimit = 0.03;

constexpr int kIterations = 25;  // enough for every sound factor
constexpr int kAdaptiveIterations = 100;
constexpr int kRestarts = 4;

// Part of the allowance that the recursive residual is driven to: the true one is a little larger.
constexpr double kMargin = 0.8;

MatrixXd select(const MatrixXd& from, const std::vector<Index>& rows) {
  MatrixXd result(static_cast<Index>(rows.size()), from.cols());
  for (Index i = 0; i < result.rows(); ++i) result.row(i) = from.row(rows[i]);
  return result;
}

VectorXd select(const VectorXd& from, const std::vector<Index>& rows) {
  return select(MatrixXd(from), rows);
}

double diagonal(const MatrixXd& points) {
  return (points.colwise().maxCoeff() - points.colwise().minCoeff()).norm();
}

}  // namespace

struct FastSolver::Impl {
  Impl(const MatrixXd& given, VectorXd given_allowed, const VectorXd& spacing, FastOptions options);

  MatrixXd multiply(const MatrixXd& weights) const;
  std::shared_ptr<const SparseInverseCholesky> factor() const;
  std::shared_ptr<const SparseInverseCholesky> make_adaptive() const;
  MatrixXd solve_weights(const MatrixXd& values, MatrixXd& residual, FastReport& report) const;
  double sampled_error(const MatrixXd& weights, const MatrixXd& image) const;

  FastOptions options;
  PointOrder order;  // of all points, farthest first
  Points ordered;    // all points in that order
  VectorXd ordered_allowed;
  double thinning_distance;
  std::vector<Index> rows;  // kept points (rows of the given), coarse to fine for the factor
  MatrixXd points;          // kept, in that order
  Points point_rows;        // the same, row-major
  VectorXd allowed;
  CentreFrame frame;
  MatrixXd P;
  KernelSum sum{Kernel::triharmonic_3d()};
  std::unique_ptr<H2Matrix> h2;  // none: direct sums
  std::string remarks;
  mutable std::mutex mutex;
  mutable std::shared_ptr<const SparseInverseCholesky> factor_;
  mutable bool is_adaptive = false;
};

namespace {

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

}  // namespace

FastSolver::Impl::Impl(const MatrixXd& given, VectorXd given_allowed, const VectorXd& spacing,
                       FastOptions given_options)
    : options(std::move(given_options)),
      order(farthest_point_order(given)),
      ordered(select(given, order.rows)),
      ordered_allowed(select(given_allowed, order.rows)),
      thinning_distance(kThinning * diagonal(given)),
      rows(kept_rows(order, ordered, thinning_distance)),
      points(select(given, rows)),
      point_rows(points),
      allowed(select(given_allowed, rows)),
      frame(point_rows),
      P(frame.polynomials(frame.to_unit(point_rows))) {
  const auto tell = [&](double fraction) {
    if (options.progress) options.progress("preparing the solver", fraction);
  };
  tell(0.1);
  FactorOptions factor_options;
  const double defect = stencil_defect(point_rows, frame.terms(), factor_options);
  if (defect > kDefectLimit) {
    factor_options.is_adaptive = is_adaptive = true;
    remarks = "larger stencils for thin gaps or steep grading";
  }
  factor_ = std::make_shared<SparseInverseCholesky>(point_rows, frame.terms(), factor_options);
  tell(0.5);
  if (points.rows() > kDirectCentres)
    h2 = std::make_unique<H2Matrix>(points, select(spacing, rows), H2Options{});
  tell(1);
}

MatrixXd FastSolver::Impl::multiply(const MatrixXd& weights) const {
  return h2 ? h2->multiply(weights) : sum(points, points, weights);
}

std::shared_ptr<const SparseInverseCholesky> FastSolver::Impl::factor() const {
  const std::lock_guard lock(mutex);
  return factor_;
}

std::shared_ptr<const SparseInverseCholesky> FastSolver::Impl::make_adaptive() const {
  const std::lock_guard lock(mutex);
  if (!is_adaptive) {
    factor_ = std::make_shared<SparseInverseCholesky>(point_rows, frame.terms(),
                                                      FactorOptions{.is_adaptive = true});
    is_adaptive = true;
  }
  return factor_;
}

// The H2 product against direct sums at some centres, in units of their allowance.
double FastSolver::Impl::sampled_error(const MatrixXd& weights, const MatrixXd& image) const {
  constexpr Index kSample = 256;
  std::vector<Index> sample(std::min(kSample, points.rows()));
  for (std::size_t s = 0; s < sample.size(); ++s)
    sample[s] = static_cast<Index>(s) * points.rows() / static_cast<Index>(sample.size());
  const MatrixXd exact = sum(select(points, sample), points, weights);
  return relative_residual(exact - select(image, sample), select(allowed, sample));
}

// Conjugate gradients, restarted from the true residual until that is within the allowance.
MatrixXd FastSolver::Impl::solve_weights(const MatrixXd& values, MatrixXd& residual,
                                         FastReport& report) const {
  MatrixXd weights = MatrixXd::Zero(values.rows(), values.cols());
  residual = values;
  auto preconditioner = factor();
  int most = is_adaptive ? kAdaptiveIterations : kIterations;
  for (int restart = 0; restart <= kRestarts; ++restart) {
    CgOptions cg{.max_iterations = most, .watch = {}};
    if (options.progress)
      cg.watch = [&](int iteration, double) {
        options.progress("solving", std::min(0.95, iteration / 12.0));
      };
    const CgResult step =
        solve_projected_cg([&](const MatrixXd& x) { return multiply(x); },
                           [&](const MatrixXd& x) { return preconditioner->apply(x); }, P, residual,
                           kMargin * allowed, cg);
    report.iterations += step.iterations;
    weights += step.weights;
    const MatrixXd image = multiply(weights);
    residual = values - image;
    MatrixXd projected = residual;
    project_out(P, projected);
    report.residual = relative_residual(projected, allowed);
    if (report.residual <= 1) {
      if (h2 && sampled_error(weights, image) > 1)
        throw SolverError("the far field is too coarse for the residual asked at some centres");
      return weights;
    }
    if (step.has_converged()) continue;
    if (most == kAdaptiveIterations) break;
    preconditioner = make_adaptive();
    most = kAdaptiveIterations;
    report.remarks = "larger stencils: the plain ones did not converge";
  }
  throw SolverError("the fast solver reached only " + std::to_string(report.residual) +
                    " times the residual asked in " + std::to_string(report.iterations) +
                    " iterations; allow a larger tolerance or use a dense solver");
}

namespace {

// Direct sums for few targets; else the trees.
class FastField final : public UnitField {
 public:
  FastField(std::shared_ptr<const void> owner, const KernelSum& sum, const MatrixXd& points,
            const H2Matrix* h2, const CentreFrame& frame, MatrixXd weights, MatrixXd coefficients)
      : owner_(std::move(owner)),
        sum_(sum),
        points_(points),
        h2_(h2),
        frame_(frame),
        weights_(std::move(weights)),
        coefficients_(std::move(coefficients)) {
    if (h2_) sources_ = h2_->compress(weights_);
  }

  void set_correction(MultiscaleCorrection correction) { correction_ = std::move(correction); }

  MatrixXd evaluate(const MatrixXd& targets) const override {
    constexpr Index kFewTargets = 2000;
    MatrixXd result = h2_ && targets.rows() > kFewTargets ? evaluate_field(*h2_, sources_, targets)
                                                          : sum_(targets, points_, weights_);
    result += frame_.polynomials(frame_.to_unit(targets)) * coefficients_;
    if (!correction_.is_empty()) result += correction_.evaluate(targets);
    return result;
  }

 private:
  std::shared_ptr<const void> owner_;  // of what the references below refer to
  const KernelSum& sum_;
  const MatrixXd& points_;
  const H2Matrix* h2_;
  const CentreFrame& frame_;
  MatrixXd weights_, coefficients_;
  H2Matrix::Sources sources_;
  MultiscaleCorrection correction_;
};

}  // namespace

FastSolver::FastSolver(const MatrixXd& points, VectorXd allowed, const VectorXd& spacing,
                       FastOptions options)
    : impl_(std::make_shared<const Impl>(points, std::move(allowed), spacing, std::move(options))) {
}

std::shared_ptr<const UnitField> FastSolver::solve(const MatrixXd& values,
                                                   FastReport& report) const {
  const Impl& s = *impl_;
  MatrixXd residual;
  MatrixXd weights = s.solve_weights(select(values, s.rows), residual, report);
  const MatrixXd coefficients = s.P.transpose() * residual / static_cast<double>(s.P.rows());
  const auto field = std::make_shared<FastField>(impl_, s.sum, s.points, s.h2.get(), s.frame,
                                                 std::move(weights), coefficients);
  report.thinned = s.ordered.rows() - s.points.rows();
  if (report.thinned > 0) {
    MatrixXd missed = select(values, s.order.rows) - field->evaluate(s.ordered);
    MultiscaleCorrection correction(s.ordered, s.order.separation, std::move(missed),
                                    s.ordered_allowed, s.thinning_distance);
    report.residual = std::max(report.residual, correction.remainder());
    field->set_correction(std::move(correction));
  }
  return field;
}

const std::string& FastSolver::remarks() const { return impl_->remarks; }

}  // namespace cadmorph
