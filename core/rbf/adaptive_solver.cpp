#include "core/rbf/adaptive_solver.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "core/archive_types.h"
#include "core/errors.h"
#include "core/kd_tree.h"
#include "core/parallel.h"
#include "core/rbf/centre_frame.h"
#include "core/rbf/dense_solver.h"
#include "core/rbf/fast_solver.h"
#include "core/rbf/kernel_sum.h"
#include "core/rbf/multiscale_correction.h"
#include "core/rbf/point_order.h"

namespace cadmorph {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

// Centres are added until no node misses more spacings than this; each time all that miss more than
// half of it. Many centres cost more than the correction that takes the rest does in quality. With
// 0.5 for 0.3 the canister's hexahedra lose 5.3 % of their smallest Jacobian in place of 3.6 %
// (docs/adaptive-centres.md).
constexpr double kEnough = 0.3, kEnoughOfMany = 0.6;

// Another round is not worth its solve for nodes so few, in parts of the centres, that miss no more
// than this times as much, half a spacing, or a whole one of many: the correction takes them.
// With half or twice of kFew or of kEnoughOfMany, or 1.3 or 3 for kMoreOfFew, 6 meshes come out the
// same.
constexpr double kFew = 0.01, kMoreOfFew = 5.0 / 3;

// Centres to start from: a dense system of some milliseconds. With 250 or 1,000, 4 meshes keep the
// smallest scaled Jacobian to 1 %, a bore has 33 or 24 inverted hexahedra before repair in place of
// 29.
constexpr Index kFirst = 500;
// Then the correction takes the rest: courier's tetrahedra at 150 % are no worse for it.
constexpr Index kMost = 8000;

// Most centres after a round for each one before it: what is missed once these are in decides on
// the next better than what is missed now. With 1.5, more rounds cost what fewer centres save.
constexpr Index kGrowth = 2;

// A new centre keeps others of its round this part of its distance from the old ones away. With
// 0.25 the bore has 49 inverted hexahedra in place of 29, with 1 it has 19; 4 meshes are the same
// to 1.4 %.
constexpr double kSpread = 0.5;

// Centres closer than this part of the diagonal would bring the system near to rounding: r^3 is
// 1e-12 of what it is across the part.
constexpr double kLeastSeparation = 1e-4;

// From about so many centres on the fast solver is as fast as Cholesky (docs/fast-solver.md).
constexpr Index kManyCentres = 1500;

// What is missed counts in steps of this: of nodes that are mirror images the first is taken, not
// the one that rounding favours on this processor. Far above rounding, far below kEnough.
constexpr double kGrain = 1e-3;

// Part of the largest value that the rounding of the sums may come to.
constexpr double kRounding = 1e-9;

double enough(Index centres) { return centres < kManyCentres ? kEnough : kEnoughOfMany; }

bool is_enough(const VectorXd& missed, Index centres) {
  const double most = missed.maxCoeff(), allowed = enough(centres);
  if (most <= allowed) return true;
  const auto over = (missed.array() > allowed).count();
  return most <= kMoreOfFew * allowed &&
         static_cast<double>(over) <= kFew * static_cast<double>(centres);
}

VectorXd spacings(const Points& points, const KdTree& tree) {
  VectorXd result(points.rows());
  parallel_for(points.rows(), 1024, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i)
      result(i) = std::sqrt(squared_spacing(tree, points.row(i).data()));
  });
  return result;
}

}  // namespace

struct AdaptiveSolver::Impl {
  Impl(const MatrixXd& points, const VectorXd& local_length, AdaptiveOptions given_options)
      : options(std::move(given_options)),
        order(farthest_point_order(points)),
        ordered(points(order.rows, Eigen::all)),
        tree(ordered),
        length(local_length(order.rows, Eigen::all)),
        spacing(spacings(ordered, tree)) {}

  Impl(const MatrixXd& points, AdaptiveOptions given_options, InputArchive& archive)
      : options(std::move(given_options)),
        order(take<PointOrder>(archive)),
        ordered(points(order.rows, Eigen::all)),
        tree(ordered) {
    archive(length, spacing);
  }

  // An interpolant of some of the values.
  struct Attempt {
    UnitField field;
    MatrixXd residual;  // at all points
    VectorXd missed;    // its norms in spacings, rounded
  };

  double least_separation() const;
  Index coarse_count() const;
  std::vector<Index> first_centres() const;
  std::vector<Index> places(const std::vector<Index>& rows) const;
  double widest() const;
  std::optional<Attempt> attempt(const std::vector<Index>& centres, const MatrixXd& values) const;
  std::optional<UnitField> interpolate(const MatrixXd& centres, const MatrixXd& values) const;
  UnitField interpolate_dense(const MatrixXd& centres, const MatrixXd& values) const;
  MatrixXd residual(const UnitField& field, const MatrixXd& values) const;
  std::vector<Index> worst(const VectorXd& missed, const std::vector<Index>& centres) const;
  AdaptiveSolution finish(std::optional<Attempt> best, const std::vector<Index>& centres,
                          const MatrixXd& values) const;
  void correct(const MatrixXd& residual, double largest_value, AdaptiveSolution& solution) const;

  AdaptiveOptions options;
  PointOrder order;  // of the points, farthest first; all that follows is in that order
  Points ordered;
  KdTree tree;
  VectorXd length, spacing;
  KernelSum sum{Kernel::triharmonic_3d()};
};

double AdaptiveSolver::Impl::least_separation() const {
  return kLeastSeparation * (ordered.colwise().maxCoeff() - ordered.colwise().minCoeff()).norm();
}

// Of the points in their order, those to start from in any case.
Index AdaptiveSolver::Impl::coarse_count() const {
  const double least = least_separation();
  Index count = 0;
  while (count < std::min(kFirst, ordered.rows()) && order.separation[count] >= least) ++count;
  return count;
}

std::vector<Index> AdaptiveSolver::Impl::first_centres() const {
  const Index coarse = coarse_count();
  const double least = least_separation();
  std::vector<Index> centres(coarse);
  std::iota(centres.begin(), centres.end(), Index{0});
  std::vector<Index> more = places(options.first);
  std::ranges::sort(more);
  for (const Index centre : more) {
    if (order.separation[centre] < least || std::ssize(centres) == kMost) break;
    if (centre >= coarse) centres.push_back(centre);
  }
  return centres;
}

// Of rows of the points, in the order.
std::vector<Index> AdaptiveSolver::Impl::places(const std::vector<Index>& rows) const {
  std::vector<Index> place(order.rows.size()), result;
  for (std::size_t i = 0; i < place.size(); ++i) place[order.rows[i]] = static_cast<Index>(i);
  for (const Index row : rows) result.push_back(place[row]);
  return result;
}

UnitField AdaptiveSolver::Impl::interpolate_dense(const MatrixXd& centres,
                                                  const MatrixXd& values) const {
  const Points points = centres;
  const CentreFrame frame(points);
  const MatrixXd P = frame.polynomials(frame.to_unit(points));
  const int sign = Kernel::triharmonic_3d().cpd_sign();
  SaddleSolution solution =
      make_dense_solver(Factorisation::Cholesky, sum.matrix(centres), P, sign)->solve(values);
  return {.centres = std::make_shared<const MatrixXd>(centres),
          .weights = std::move(solution.weights),
          .linear = frame.linear_in_given(solution.coefficients),
          .far_field = nullptr,
          .correction = nullptr};
}

// Nothing where the centres are too close to each other for the solvers.
std::optional<UnitField> AdaptiveSolver::Impl::interpolate(const MatrixXd& centres,
                                                           const MatrixXd& values) const {
  try {
    if (centres.rows() < kManyCentres) return interpolate_dense(centres, values);
    const FastSolver solver(centres, VectorXd(),
                            {.tolerance = options.tolerance, .unit = options.unit});
    return solver.solve({values}).front().field;
  } catch (const SolverError&) {
    return {};
  }
}

MatrixXd AdaptiveSolver::Impl::residual(const UnitField& field, const MatrixXd& values) const {
  MatrixXd result = values - sum(ordered, *field.centres, field.weights);
  result -= ordered * field.linear.bottomRows(3);
  result.rowwise() -= field.linear.row(0);
  return result;
}

std::optional<AdaptiveSolver::Impl::Attempt> AdaptiveSolver::Impl::attempt(
    const std::vector<Index>& centres, const MatrixXd& values) const {
  std::optional<UnitField> field =
      interpolate(ordered(centres, Eigen::all), values(centres, Eigen::all));
  if (!field) return {};
  MatrixXd left = residual(*field, values);
  const VectorXd norms = left.rowwise().norm();
  if (!norms.allFinite()) return {};
  const VectorXd missed = norms.array() / (options.unit * spacing.array()).min(options.most_missed);
  return Attempt{std::move(*field), std::move(left), (missed / kGrain).array().round() * kGrain};
}

// The points that miss most, each at a distance from the centres and from those taken before it.
std::vector<Index> AdaptiveSolver::Impl::worst(const VectorXd& missed,
                                               const std::vector<Index>& centres) const {
  const auto count = static_cast<Index>(centres.size());
  const Index most = std::min(kMost - count, (kGrowth - 1) * count);
  std::vector<Index> candidates;
  for (Index i = 0; i < missed.size(); ++i)
    if (missed(i) > enough(count) / 2) candidates.push_back(i);
  std::sort(candidates.begin(), candidates.end(), [&](Index a, Index b) {
    return missed(a) != missed(b) ? missed(a) > missed(b) : a < b;
  });
  const KdTree old(Points(ordered(centres, Eigen::all)));
  const double least = least_separation();
  std::vector<char> is_near(missed.size(), 0);
  std::vector<Index> result;
  for (const Index i : candidates) {
    if (static_cast<Index>(result.size()) >= most) break;
    const double* x = ordered.row(i).data();
    if (is_near[i]) continue;
    const double distance = std::sqrt(old.nearest(x, 1).front().squared_distance);
    if (distance < least) continue;
    result.push_back(i);
    for (const Neighbour& near : tree.within(x, std::max(least, kSpread * distance)))
      is_near[near.index] = 1;
  }
  return result;
}

// Levels from the spacing of the first centres down: what is missed is at most as wide as these are
// apart.
double AdaptiveSolver::Impl::widest() const {
  return order.separation[std::min(coarse_count(), ordered.rows() - 1)];
}

void AdaptiveSolver::Impl::correct(const MatrixXd& residual, double largest_value,
                                   AdaptiveSolution& solution) const {
  const VectorXd allowed =
      (options.tolerance * options.unit * length).cwiseMax(kRounding * largest_value + 1e-300);
  try {
    auto correction = std::make_shared<const MultiscaleCorrection>(ordered, order.separation,
                                                                   residual, allowed, widest());
    solution.in_local_lengths =
        (correction->remainders().array() / length.array()).maxCoeff() / options.unit;
    if (!correction->is_empty()) solution.field->correction = std::move(correction);
  } catch (const SolverError& error) {
    solution.field.reset();
    solution.error = error.what();
  }
}

AdaptiveSolution AdaptiveSolver::Impl::finish(std::optional<Attempt> best,
                                              const std::vector<Index>& centres,
                                              const MatrixXd& values) const {
  AdaptiveSolution solution;
  if (!best) {
    solution.error = "the centres chosen nearly coincide";
    return solution;
  }
  for (const Index centre : centres) solution.centres.push_back(order.rows[centre]);
  solution.missed = best->missed.maxCoeff();
  solution.field = std::move(best->field);
  solution.field->rows = solution.centres;
  correct(best->residual, values.cwiseAbs().maxCoeff(), solution);
  return solution;
}

AdaptiveSolver::AdaptiveSolver(const MatrixXd& points, const VectorXd& local_length,
                               AdaptiveOptions options)
    : impl_(std::make_shared<const Impl>(points, local_length, std::move(options))) {}

AdaptiveSolver::AdaptiveSolver(const MatrixXd& points, AdaptiveOptions options,
                               InputArchive& archive)
    : impl_(std::make_shared<const Impl>(points, std::move(options), archive)) {}

void AdaptiveSolver::store(OutputArchive& archive) const {
  archive(impl_->order, impl_->length, impl_->spacing);
}

double AdaptiveSolver::correction_from() const { return impl_->widest(); }

AdaptiveSolution AdaptiveSolver::solve(const MatrixXd& values) const {
  const Impl& s = *impl_;
  const MatrixXd targets = values(s.order.rows, Eigen::all);
  std::vector<Index> centres = s.first_centres();
  std::optional<Impl::Attempt> best = s.attempt(centres, targets);
  for (int round = 1; best && !is_enough(best->missed, std::ssize(centres)); ++round) {
    if (s.options.progress) s.options.progress("solving", 1 - std::pow(0.7, round));
    const std::vector<Index> more = s.worst(best->missed, centres);
    if (more.empty()) break;
    std::vector<Index> all = centres;
    all.insert(all.end(), more.begin(), more.end());
    std::optional<Impl::Attempt> next = s.attempt(all, targets);
    if (!next) break;
    best = std::move(next);
    centres = std::move(all);
  }
  return s.finish(std::move(best), centres, targets);
}

AdaptiveSolution AdaptiveSolver::solve(const MatrixXd& values,
                                       const std::vector<Index>& centres) const {
  const Impl& s = *impl_;
  const std::vector<Index> ordered = s.places(centres);
  const MatrixXd targets = values(s.order.rows, Eigen::all);
  return s.finish(s.attempt(ordered, targets), ordered, targets);
}

}  // namespace cadmorph
