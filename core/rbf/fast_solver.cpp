#include "core/rbf/fast_solver.h"

#include <algorithm>
#include <cmath>
#include <mutex>
#include <vector>

#include "core/errors.h"
#include "core/kd_tree.h"
#include "core/parallel.h"
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
constexpr double kThinning = 2.5e-5;

// Up to here direct sums beat the H2 matrix, its set-up included.
constexpr Index kDirectCentres = 12000;

// Measured stencil defects (ordinary parts: 0.002, steep grading 0.008, thin gaps up to 0.1): from
// which on all stencils are larger, and from which on they are enlarged one by one.
constexpr double kDefectWide = 0.005;
constexpr double kDefectWider = 0.01;
constexpr double kDefectAdaptive = 0.03;

constexpr int kIterations = 25;  // enough for every sound factor
constexpr int kAdaptiveIterations = 100;
constexpr int kRestarts = 4;

// Part of the allowance that the recursive residual is driven to: the true one is a little larger.
constexpr double kMargin = 0.8;

// Accuracy of the H2 matrix per tolerance asked: leaves its error a third of the allowance
// (measured).
constexpr double kFarFieldAccuracy = 5e-4;

// Part of the largest value that the rounding of the sums may come to.
constexpr double kRounding = 1e-9;

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
  Impl(const MatrixXd& given, const VectorXd& local_length, FastOptions options);

  // What may be refined when a solution calls for it; taken and replaced as a whole.
  struct Tools {
    std::shared_ptr<const SparseInverseCholesky> factor;
    std::shared_ptr<const H2Matrix> h2;  // none: direct sums
    bool is_adaptive = false;
    double accuracy = 0;  // of h2

    MatrixXd multiply(const Impl& s, const MatrixXd& weights) const {
      return h2 ? h2->multiply(weights) : s.sum(s.points, s.points, weights);
    }
  };

  Tools tools() const;
  Tools with_larger_stencils() const;
  Tools with_finer_far_field(double accuracy) const;
  MatrixXd solve_weights(const MatrixXd& values, const VectorXd& allowed, Tools& tools,
                         MatrixXd& residual, FastReport& report) const;
  double sampled_error(const MatrixXd& weights, const MatrixXd& image,
                       const VectorXd& allowed) const;

  FastOptions options;
  PointOrder order;         // of all points, farthest first
  Points ordered;           // all points in that order
  VectorXd ordered_length;  // local lengths of all points in that order
  double thinning_distance;
  std::vector<Index> rows;  // kept points (rows of the given), coarse to fine for the factor
  MatrixXd points;          // kept, in that order
  Points point_rows;        // the same, row-major
  VectorXd length;          // local length of kept points, where thinning left room
  CentreFrame frame;
  MatrixXd P;
  KernelSum sum{Kernel::triharmonic_3d()};
  std::string remarks;
  mutable std::mutex mutex;
  mutable Tools tools_;
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

FastSolver::Impl::Impl(const MatrixXd& given, const VectorXd& local_length,
                       FastOptions given_options)
    : options(std::move(given_options)),
      order(farthest_point_order(given)),
      ordered(select(given, order.rows)),
      thinning_distance(kThinning * diagonal(given)),
      rows(kept_rows(order, ordered, thinning_distance)),
      points(select(given, rows)),
      point_rows(points),
      frame(point_rows),
      P(frame.polynomials(frame.to_unit(point_rows))) {
  const VectorXd nearest = nearest_distances(given);
  const VectorXd lengths = local_length.size() == 0 ? nearest : local_length;
  ordered_length = select(lengths, order.rows);
  length = nearest_distances(point_rows);
  for (Index i = 0; i < length.size(); ++i)
    length(i) *= std::min(1.0, lengths(rows[i]) / nearest(rows[i]));
  const auto tell = [&](double fraction) {
    if (options.progress) options.progress("preparing the solver", fraction);
  };
  tell(0.1);
  FactorOptions factor_options;
  const double defect = stencil_defect(point_rows, frame.terms(), factor_options);
  if (defect > kDefectAdaptive) {
    factor_options.is_adaptive = tools_.is_adaptive = true;
    remarks = "larger stencils for thin gaps";
  } else if (defect > kDefectWide) {
    factor_options.neighbours = defect > kDefectWider ? 128 : 96;
  }
  tools_.factor =
      std::make_shared<SparseInverseCholesky>(point_rows, frame.terms(), factor_options);
  tell(0.5);
  tools_.accuracy = kFarFieldAccuracy * options.tolerance;
  if (points.rows() > kDirectCentres)
    tools_.h2 = std::make_shared<H2Matrix>(points, length, H2Options{.accuracy = tools_.accuracy});
  tell(1);
}

FastSolver::Impl::Tools FastSolver::Impl::tools() const {
  const std::lock_guard lock(mutex);
  return tools_;
}

FastSolver::Impl::Tools FastSolver::Impl::with_larger_stencils() const {
  const std::lock_guard lock(mutex);
  if (!tools_.is_adaptive) {
    tools_.factor = std::make_shared<SparseInverseCholesky>(point_rows, frame.terms(),
                                                            FactorOptions{.is_adaptive = true});
    tools_.is_adaptive = true;
  }
  return tools_;
}

FastSolver::Impl::Tools FastSolver::Impl::with_finer_far_field(double accuracy) const {
  const std::lock_guard lock(mutex);
  if (tools_.accuracy > accuracy) {
    tools_.h2 = std::make_shared<H2Matrix>(points, length, H2Options{.accuracy = accuracy});
    tools_.accuracy = accuracy;
  }
  return tools_;
}

// The H2 product against direct sums at some centres, in units of their allowance.
double FastSolver::Impl::sampled_error(const MatrixXd& weights, const MatrixXd& image,
                                       const VectorXd& allowed) const {
  constexpr Index kSample = 256;
  std::vector<Index> sample(std::min(kSample, points.rows()));
  for (std::size_t s = 0; s < sample.size(); ++s)
    sample[s] = static_cast<Index>(s) * points.rows() / static_cast<Index>(sample.size());
  const MatrixXd exact = sum(select(points, sample), points, weights);
  return relative_residual(exact - select(image, sample), select(allowed, sample));
}

// Conjugate gradients, restarted from the true residual until that is within the allowance.
MatrixXd FastSolver::Impl::solve_weights(const MatrixXd& values, const VectorXd& allowed,
                                         Tools& tools, MatrixXd& residual,
                                         FastReport& report) const {
  MatrixXd weights = MatrixXd::Zero(values.rows(), values.cols());
  residual = values;
  for (int restart = 0; restart <= kRestarts; ++restart) {
    CgOptions cg{.max_iterations = tools.is_adaptive ? kAdaptiveIterations : kIterations};
    if (options.progress)
      cg.watch = [&](int iteration, double) {
        options.progress("solving", std::min(0.95, iteration / 12.0));
      };
    const CgResult step =
        solve_projected_cg([&](const MatrixXd& x) { return tools.multiply(*this, x); },
                           [&](const MatrixXd& x) { return tools.factor->apply(x); }, P, residual,
                           kMargin * allowed, cg);
    report.iterations += step.iterations;
    weights += step.weights;
    MatrixXd image = tools.multiply(*this, weights);
    const double far_field = tools.h2 ? sampled_error(weights, image, allowed) : 0;
    if (far_field > 1) {
      tools = with_finer_far_field(tools.accuracy / (10 * far_field));
      image = tools.multiply(*this, weights);
      report.remarks = "finer far field: the usual one was too coarse for some centres";
    }
    residual = values - image;
    MatrixXd projected = residual;
    project_out(P, projected);
    report.residual = relative_residual(projected, allowed);
    if (report.residual <= 1) return weights;
    if (step.has_converged()) continue;
    if (tools.is_adaptive) break;
    tools = with_larger_stencils();
    report.remarks = "larger stencils: the plain ones did not converge";
  }
  throw SolverError("the fast solver reached only " + std::to_string(report.residual) +
                    " times the residual asked in " + std::to_string(report.iterations) +
                    " iterations; allow a larger tolerance or use a dense solver");
}

namespace {

// The source side of the evaluator's trees.
SourceTree source_tree(const H2Matrix& h2, const H2Matrix::Sources& sources) {
  SourceTree tree;
  tree.separation = EvaluatorOptions{}.separation;
  tree.skeleton_points = h2.skeleton_points();
  tree.skeleton_weights = sources.skeletons;
  for (std::size_t i = 0; i < h2.tree().nodes.size(); ++i) {
    const Octree::Node& node = h2.tree().nodes[i];
    const int id = static_cast<int>(i);
    const Index first = h2.skeleton_begin(id);
    tree.nodes.push_back({.centre = node.centre,
                          .radius = node.radius,
                          .first_child = node.first_child,
                          .child_count = node.child_count,
                          .begin = node.begin,
                          .end = node.end,
                          .skeleton_begin = first,
                          .skeleton_end = first + h2.rank(id)});
  }
  return tree;
}

// Direct sums for few targets; else the trees.
class FastField final : public UnitField {
 public:
  FastField(std::shared_ptr<const void> owner, const KernelSum& sum, const MatrixXd& points,
            std::shared_ptr<const H2Matrix> h2, const CentreFrame& frame, MatrixXd weights,
            MatrixXd coefficients)
      : owner_(std::move(owner)),
        sum_(sum),
        points_(points),
        h2_(std::move(h2)),
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

  void describe(FieldTerms& terms) const override {
    terms.centres = h2_ ? h2_->tree().points : points_;
    terms.weights = h2_ ? sources_.weights : weights_;
    terms.linear += frame_in_frame(frame_.linear(coefficients_));
    if (h2_) terms.tree = source_tree(*h2_, sources_);
    terms.correction = correction_.levels();
  }

 private:
  // The frame's coordinates are (x - centre) / unit of those of the points.
  MatrixXd frame_in_frame(MatrixXd linear) const {
    linear.bottomRows(3) /= frame_.unit();
    linear.row(0) -= frame_.centre() * linear.bottomRows(3);
    return linear;
  }

  std::shared_ptr<const void> owner_;  // of what the references below refer to
  const KernelSum& sum_;
  const MatrixXd& points_;
  std::shared_ptr<const H2Matrix> h2_;
  const CentreFrame& frame_;
  MatrixXd weights_, coefficients_;
  H2Matrix::Sources sources_;
  MultiscaleCorrection correction_;
};

}  // namespace

FastSolver::FastSolver(const MatrixXd& points, const VectorXd& local_length, FastOptions options)
    : impl_(std::make_shared<const Impl>(points, local_length, std::move(options))) {}

std::shared_ptr<const UnitField> FastSolver::solve(const MatrixXd& values,
                                                   FastReport& report) const {
  const Impl& s = *impl_;
  const double scale = s.options.tolerance * s.options.unit;
  const double least = kRounding * values.cwiseAbs().maxCoeff() + 1e-300;
  MatrixXd residual;
  Impl::Tools tools = s.tools();
  const VectorXd allowed = (scale * s.length).cwiseMax(least);
  MatrixXd weights = s.solve_weights(select(values, s.rows), allowed, tools, residual, report);
  const MatrixXd coefficients = s.P.transpose() * residual / static_cast<double>(s.P.rows());
  const auto field = std::make_shared<FastField>(impl_, s.sum, s.points, tools.h2, s.frame,
                                                 std::move(weights), coefficients);
  report.thinned = s.ordered.rows() - s.points.rows();
  if (report.thinned > 0) {
    MatrixXd missed = select(values, s.order.rows) - field->evaluate(s.ordered);
    MultiscaleCorrection correction(s.ordered, s.order.separation, std::move(missed),
                                    (scale * s.ordered_length).cwiseMax(least),
                                    s.thinning_distance);
    report.residual = std::max(report.residual, correction.remainder());
    field->set_correction(std::move(correction));
  }
  return field;
}

const std::string& FastSolver::remarks() const { return impl_->remarks; }

}  // namespace cadmorph
