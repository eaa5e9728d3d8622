#include "core/rbf/field_derivative.h"

#include <algorithm>
#include <limits>
#include <numeric>
#include <optional>
#include <string>
#include <utility>

#include "core/errors.h"
#include "core/kd_tree.h"
#include "core/parallel.h"
#include "core/rbf/compact_sum.h"
#include "core/rbf/conjugate_gradient.h"
#include "core/rbf/dense_solver.h"
#include "core/rbf/multiscale_correction.h"
#include "core/rbf/point_order.h"

namespace cadmorph {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

// Levels are solved to this part of their largest value: rounding.
constexpr double kSolved = 1e-13;
constexpr int kMaxIterations = 3000;

// A map of no more numbers is worked out as a whole: some tenths of a second.
constexpr Index kFewNumbers = 1'000'000;

// Part of the memory allowed that each level's matrix may take.
constexpr double kKeptPart = 0.1;

// Sources that a thread sums over at a time where the targets are few.
constexpr Index kSourceChunk = 8192, kMostChunks = 64;

MatrixXd select(const MatrixXd& from, const std::vector<Index>& rows) {
  MatrixXd result(static_cast<Index>(rows.size()), from.cols());
  for (Index i = 0; i < result.rows(); ++i) result.row(i) = from.row(rows[i]);
  return result;
}

void add_rows(MatrixXd& to, const std::vector<Index>& rows, const MatrixXd& values) {
  for (Index i = 0; i < values.rows(); ++i) to.row(rows[i]) += values.row(i);
}

// Sums of many sources at few targets; the same on any number of threads.
MatrixXd sum_sources(const KernelSum& sum, const MatrixXd& targets, const MatrixXd& sources,
                     const MatrixXd& weights) {
  const Index size = std::max(kSourceChunk, sources.rows() / kMostChunks + 1);
  const Index chunks = (sources.rows() + size - 1) / size;
  if (chunks <= 1) return sum(targets, sources, weights);
  std::vector<MatrixXd> parts(static_cast<std::size_t>(chunks));
  parallel_for(chunks, 1, [&](Index begin, Index end) {
    for (Index c = begin; c < end; ++c) {
      const Index first = c * size, count = std::min(size, sources.rows() - first);
      parts[c] = MatrixXd::Zero(targets.rows(), weights.cols());
      sum.add(targets, sources.middleRows(first, count), weights.middleRows(first, count),
              parts[c]);
    }
  });
  for (Index c = 1; c < chunks; ++c) parts.front() += parts[c];
  return std::move(parts.front());
}

// Which of the points lie within a distance of some of them.
std::vector<char> near(const Points& points, const std::vector<Index>& some, double distance) {
  const KdTree tree(Points(points(some, Eigen::all)));
  std::vector<char> result(static_cast<std::size_t>(points.rows()));
  parallel_for(points.rows(), 1024, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i)
      result[i] =
          tree.nearest(points.row(i).data(), 1).front().squared_distance < distance * distance;
  });
  return result;
}

// One level of the correction: its points interpolate what the levels before it leave.
struct Level {
  Level(const Points& points, std::vector<Index> which, double support, double most_bytes)
      : rows(std::move(which)),
        sum(Points(points(rows, Eigen::all)), support),
        matrix(sum, most_bytes) {}
  Level(const Level&) = delete;
  Level& operator=(const Level&) = delete;

  MatrixXd solve(const MatrixXd& values) const;

  std::vector<Index> rows;  ///< of the points
  CompactSum sum;
  CompactMatrix matrix;
};

// Columns of unit size, so that each is solved to its own rounding.
MatrixXd Level::solve(const MatrixXd& values) const {
  const Eigen::RowVectorXd largest = values.cwiseAbs().colwise().maxCoeff();
  const Eigen::RowVectorXd scale = (largest.array() > 0).select(largest, 1.0);
  const CgResult result =
      solve_projected_cg(
          [&](const MatrixXd& x) { return matrix * x; }, [](const MatrixXd& x) { return x; },
          MatrixXd(values.rows(), 0), {values * scale.cwiseInverse().asDiagonal()},
          {VectorXd::Constant(values.rows(), kSolved)}, {.max_iterations = kMaxIterations})
          .front();
  if (!result.has_converged())
    throw SolverError("the derivative of the surface correction did not converge");
  return result.weights * scale.asDiagonal();
}

// Points that sums are taken at, or over, again and again.
struct Cloud {
  explicit Cloud(MatrixXd given)
      : points(std::move(given)), order(spatial_order(points)), ordered(select(points, order)) {}

  MatrixXd in_order(const MatrixXd& values) const { return select(values, order); }

  MatrixXd points;
  std::vector<Index> order;
  MatrixXd ordered;
};

void add_sums(const CompactSum& sum, const Cloud& at, const MatrixXd& weights, double sign,
              MatrixXd& to) {
  add_rows(to, at.order, sign * sum(at.ordered, weights));
}

}  // namespace

struct FieldDerivative::Impl {
  Impl(const FrozenField& field, const MatrixXd& targets);

  void add_levels(std::vector<char> is_met, double spacing, double most_bytes);
  MatrixXd weights(const MatrixXd& values, MatrixXd& coefficients) const;
  MatrixXd transposed_weights(const MatrixXd& weights, const MatrixXd& coefficients) const;

  CentreFrame frame, own;  // of the points, and of the centres among them
  KernelSum sum;
  Cloud points, targets;
  std::vector<Index> rows;  // of the centres
  MatrixXd centres;
  MatrixXd P, P_targets;            // polynomials of the points' frame
  MatrixXd Q, Q_points, Q_targets;  // of the centres' own
  std::shared_ptr<const DenseSolver> solver;
  std::vector<std::unique_ptr<const Level>> levels;
  std::optional<CompactSum> over_points, over_targets;  // of any support: for their trees
  // The whole map, N x T, of few points and targets: its numbers make both directions transposes to
  // rounding, where weights would be large ones that cancel.
  MatrixXd transposed;
};

FieldDerivative::Impl::Impl(const FrozenField& field, const MatrixXd& given_targets)
    : frame(field.frame),
      own(RowMatrix(field.centres.empty() ? *field.points : select(*field.points, field.centres))),
      sum(field.kernel, field.log_scale),
      points(*field.points),
      targets(given_targets),
      rows(field.centres),
      P(frame.polynomials(points.points)),
      P_targets(frame.polynomials(targets.points)) {
  const Index count = points.points.rows();
  if (rows.empty()) {
    rows.resize(static_cast<std::size_t>(count));
    std::iota(rows.begin(), rows.end(), Index{0});
  }
  centres = select(points.points, rows);
  const auto polynomials = [&](const MatrixXd& x) {
    return own.polynomials(own.to_unit(RowMatrix(x)));
  };
  Q = polynomials(centres);
  Q_points = polynomials(points.points);
  Q_targets = polynomials(targets.points);
  solver = field.solver;
  if (!solver) {
    const double bytes =
        8.0 * static_cast<double>(centres.rows()) * static_cast<double>(centres.rows());
    if (bytes > field.memory_limit)
      throw SolverError("the derivative of a field of " + std::to_string(centres.rows()) +
                        " centres needs " + std::to_string(static_cast<long long>(bytes)) +
                        " bytes; allow more memory, or use the adaptive solver");
    const int sign = field.kernel.cpd_sign();
    try {
      solver = make_dense_solver(Factorisation::Cholesky, sum.matrix(centres), Q, sign);
    } catch (const SolverError&) {  // centres nearly coincide
      solver = make_dense_solver(Factorisation::Ldlt, sum.matrix(centres), Q, sign);
    }
  }
  if (static_cast<Index>(rows.size()) == count) return;
  std::vector<char> is_met(static_cast<std::size_t>(count), 0);
  for (const Index row : rows) is_met[row] = 1;
  add_levels(std::move(is_met), field.correction_from, kKeptPart * field.memory_limit);
}

// The levels of one sweep of MultiscaleCorrection where what is not met yet is worth a correction.
void FieldDerivative::Impl::add_levels(std::vector<char> is_met, double spacing,
                                       double most_bytes) {
  const Points given(points.points);
  const PointOrder order = farthest_point_order(given);
  const Index all = given.rows();
  Index count = 0;
  for (int level = 0; level < MultiscaleCorrection::kMostLevels && count < all;
       ++level, spacing /= 2) {
    while (count < all && order.separation[count] >= spacing) ++count;
    std::vector<Index> active;
    for (Index i = 0; i < count; ++i)
      if (!is_met[order.rows[i]]) active.push_back(order.rows[i]);
    if (active.empty()) continue;
    const double support = MultiscaleCorrection::kSupport * spacing;
    std::vector<char> is_near = near(given, active, support);
    std::vector<Index> taken;
    for (Index i = 0; i < count; ++i)
      if (is_near[order.rows[i]]) taken.push_back(order.rows[i]);
    is_near = near(given, taken, support);
    for (Index i = 0; i < all; ++i)
      if (is_near[i]) is_met[i] = 0;
    for (const Index row : taken) is_met[row] = 1;
    levels.push_back(std::make_unique<const Level>(given, std::move(taken), support, most_bytes));
  }
  if (levels.empty()) return;
  over_points.emplace(given, 1);
  if (targets.points.rows() > 0) over_targets.emplace(Points(targets.points), 1);
}

// The weights at the centres that meet values there, refined once, and the polynomials with them.
// By the values this is a symmetric map.
MatrixXd FieldDerivative::Impl::weights(const MatrixXd& values, MatrixXd& coefficients) const {
  MatrixXd result = solver->solve(values).weights;
  MatrixXd left = values - sum(centres, centres, result);
  coefficients = Q.transpose() * left / static_cast<double>(Q.rows());
  result += solver->solve(left - Q * coefficients).weights;
  left = values - sum(centres, centres, result);
  coefficients = Q.transpose() * left / static_cast<double>(Q.rows());
  return result;
}

// The transpose of `weights`, polynomials included.
MatrixXd FieldDerivative::Impl::transposed_weights(const MatrixXd& by_weights,
                                                   const MatrixXd& by_coefficients) const {
  const MatrixXd even = Q * by_coefficients / static_cast<double>(Q.rows());
  MatrixXd unused;
  return even + weights(by_weights - sum(centres, centres, even), unused);
}

FieldDerivative::FieldDerivative(const FrozenField& field, const MatrixXd& targets) {
  const auto impl = std::make_shared<Impl>(field, targets);
  impl_ = impl;
  const Index count = targets.rows();
  if (impl->levels.empty() && count * points() <= kFewNumbers)
    impl->transposed = adjoint(MatrixXd::Identity(count, count));
}

Index FieldDerivative::points() const { return impl_->points.points.rows(); }
Index FieldDerivative::targets() const { return impl_->targets.points.rows(); }

MatrixXd FieldDerivative::forward(const MatrixXd& values) const {
  const Impl& s = *impl_;
  if (s.transposed.size() > 0) return s.transposed.transpose() * values;
  const MatrixXd fit = s.P.transpose() * values / static_cast<double>(s.P.rows());
  MatrixXd left = values - s.P * fit;
  MatrixXd coefficients;
  const MatrixXd weights = s.weights(select(left, s.rows), coefficients);
  MatrixXd result = s.sum(s.targets.points, s.centres, weights);
  result += s.Q_targets * coefficients + s.P_targets * fit;
  if (s.levels.empty()) return result;
  left -= s.sum(s.points.points, s.centres, weights) + s.Q_points * coefficients;
  for (const auto& level : s.levels) {
    const MatrixXd part = level->solve(select(left, level->rows));
    add_sums(level->sum, s.points, part, -1, left);
    if (s.over_targets) add_sums(level->sum, s.targets, part, 1, result);
  }
  return result;
}

MatrixXd FieldDerivative::adjoint(const MatrixXd& slopes) const {
  const Impl& s = *impl_;
  if (s.transposed.size() > 0) return s.transposed * slopes;
  MatrixXd by_left = MatrixXd::Zero(s.points.points.rows(), slopes.cols());
  for (auto at = s.levels.rbegin(); at != s.levels.rend(); ++at) {
    const Level& level = **at;
    const Cloud centres(select(s.points.points, level.rows));
    MatrixXd by_part = MatrixXd::Zero(centres.points.rows(), slopes.cols());
    add_sums(s.over_points->with_support(level.sum.support()), centres, by_left, -1, by_part);
    if (s.over_targets)
      add_sums(s.over_targets->with_support(level.sum.support()), centres, slopes, 1, by_part);
    add_rows(by_left, level.rows, level.solve(by_part));
  }
  MatrixXd by_weights = sum_sources(s.sum, s.centres, s.targets.points, slopes);
  MatrixXd by_coefficients = s.Q_targets.transpose() * slopes;
  if (!s.levels.empty()) {
    by_weights -= sum_sources(s.sum, s.centres, s.points.points, by_left);
    by_coefficients -= s.Q_points.transpose() * by_left;
  }
  add_rows(by_left, s.rows, s.transposed_weights(by_weights, by_coefficients));
  const MatrixXd by_fit = s.P_targets.transpose() * slopes - s.P.transpose() * by_left;
  return by_left + s.P * by_fit / static_cast<double>(s.P.rows());
}

}  // namespace cadmorph
