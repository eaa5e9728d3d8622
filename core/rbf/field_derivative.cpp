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
#include "core/rbf/compact_system.h"
#include "core/rbf/dense_solver.h"
#include "core/rbf/multiscale_correction.h"
#include "core/rbf/point_order.h"

namespace cadmorph {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

// Levels are solved to this part of their largest value: rounding.
constexpr double kSolved = 1e-13;

// Of the weights; each takes the error down by the condition number times 1e-16. With 0 two tests
// fail, of flat layers and of anchors; with 1 they pass.
constexpr int kRefinements = 2;

// Sources that a thread sums over at a time where the targets are few; of the parts' sums, which
// each hold all targets, there are kMostChunks at most.
constexpr Index kSourceChunk = 8192, kMostChunks = 64;

void add_rows(MatrixXd& to, const std::vector<Index>& rows, const MatrixXd& values) {
  for (Index i = 0; i < values.rows(); ++i) to.row(rows[i]) += values.row(i);
}

// Polynomials, which cost little, are summed in the processor's longest numbers.
using Extended = Eigen::Matrix<long double, Eigen::Dynamic, Eigen::Dynamic>;

Extended extended(const MatrixPair& x) {
  return x.high.cast<long double>() + x.low.cast<long double>();
}

MatrixPair pair_of(const Extended& x) {
  MatrixPair result(x.cast<double>());
  result.low = (x - result.high.cast<long double>()).cast<double>();
  return result;
}

Extended product(const MatrixXd& Q, const Extended& x) {
  return Q.cast<long double>().lazyProduct(x);
}
Extended transposed_product(const MatrixXd& Q, const Extended& x) {
  return Q.transpose().cast<long double>().lazyProduct(x);
}

// Sums of many sources at few targets; the same on any number of threads.
MatrixPair sum_sources(const KernelSum& sum, const MatrixXd& targets, const MatrixXd& sources,
                       const MatrixPair& weights) {
  const Index size = std::max(kSourceChunk, sources.rows() / kMostChunks + 1);
  const Index chunks = (sources.rows() + size - 1) / size;
  if (chunks <= 1) return sum.pairs(targets, sources, weights);
  std::vector<MatrixPair> parts(static_cast<std::size_t>(chunks));
  parallel_for(chunks, 1, [&](Index begin, Index end) {
    for (Index c = begin; c < end; ++c) {
      const Index first = c * size, count = std::min(size, sources.rows() - first);
      MatrixPair some;
      some.high = weights.high.middleRows(first, count);
      some.low = weights.low.middleRows(first, count);
      parts[c] = sum.pairs(targets, sources.middleRows(first, count), some);
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
  Level(const Points& points, std::vector<Index> which, double support)
      : rows(std::move(which)), system(Points(points(rows, Eigen::all)), support) {}

  MatrixXd solve(const MatrixXd& values) const;

  std::vector<Index> rows;  ///< of the points
  CompactSystem system;
};

// Columns of unit size, so that each is solved to its own rounding.
MatrixXd Level::solve(const MatrixXd& values) const {
  const Eigen::RowVectorXd largest = values.cwiseAbs().colwise().maxCoeff();
  const Eigen::RowVectorXd scale = (largest.array() > 0).select(largest, 1.0);
  const CgResult result = system.solve(values * scale.cwiseInverse().asDiagonal(),
                                       VectorXd::Constant(values.rows(), kSolved));
  if (!result.has_converged())
    throw SolverError("the derivative of the surface correction did not converge");
  return result.weights * scale.asDiagonal();
}

// Points in space in an order in which sums at them are quick.
struct Ordered {
  explicit Ordered(const MatrixXd& given)
      : order(spatial_order(given)), points(given(order, Eigen::all)) {}

  std::vector<Index> order;
  MatrixXd points;
};

void add_sums(const CompactSum& sum, const Ordered& at, const MatrixXd& weights, double sign,
              MatrixXd& to) {
  add_rows(to, at.order, sign * sum(at.points, weights));
}

}  // namespace

struct FieldDerivative::Impl {
  Impl(const FrozenField& field, const MatrixXd& targets);

  void add_levels(std::vector<char> is_met, double spacing);
  MatrixPair weights(const MatrixPair& values, Extended& coefficients) const;
  void clear_moments(MatrixPair& weights) const;
  MatrixXd transposed_weights(MatrixPair by_weights, const Extended& by_coefficients) const;

  CentreFrame frame, own;  // of the points, and of the centres among them
  KernelSum sum;
  MatrixXd points, targets;
  std::vector<Index> rows;  // of the centres
  MatrixXd centres;
  MatrixXd P, P_targets;            // polynomials of the points' frame
  MatrixXd Q, Q_points, Q_targets;  // of the centres' own
  std::shared_ptr<const DenseSolver> solver;
  std::vector<std::unique_ptr<const Level>> levels;
  // Where there are levels:
  std::optional<Ordered> ordered_points, ordered_targets;
  std::optional<CompactSum> over_points, over_targets;  // of any support: for their trees
};

FieldDerivative::Impl::Impl(const FrozenField& field, const MatrixXd& given_targets)
    : frame(field.frame),
      own(RowMatrix(field.centres.empty() ? *field.points
                                          : (*field.points)(field.centres, Eigen::all))),
      sum(field.kernel, field.log_scale),
      points(*field.points),
      targets(given_targets),
      rows(field.centres),
      P(frame.polynomials(points)),
      P_targets(frame.polynomials(targets)) {
  const Index count = points.rows();
  if (rows.empty()) {
    rows.resize(static_cast<std::size_t>(count));
    std::iota(rows.begin(), rows.end(), Index{0});
  }
  centres = points(rows, Eigen::all);
  const auto polynomials = [&](const MatrixXd& x) {
    return own.polynomials(own.to_unit(RowMatrix(x)));
  };
  Q = polynomials(centres);
  Q_points = polynomials(points);
  Q_targets = polynomials(targets);
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
  add_levels(std::move(is_met), field.correction_from);
}

// The levels of one sweep of MultiscaleCorrection where what is not met yet is worth a correction.
void FieldDerivative::Impl::add_levels(std::vector<char> is_met, double spacing) {
  const Points given(points);
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
    levels.push_back(std::make_unique<const Level>(given, std::move(taken), support));
  }
  if (levels.empty()) return;
  ordered_points.emplace(points);
  over_points.emplace(given, 1);
  if (targets.rows() == 0) return;
  ordered_targets.emplace(targets);
  over_targets.emplace(Points(targets), 1);
}

// The weights at the centres that meet values there, and the polynomials with them. By the values
// this is a symmetric map. Values that are no smooth motion have weights so large that their sums
// cancel to a small part, so that doubles are not enough for them.
MatrixPair FieldDerivative::Impl::weights(const MatrixPair& values, Extended& coefficients) const {
  MatrixPair result(solver->solve(values.high).weights);
  for (int step = 0;; ++step) {
    clear_moments(result);
    MatrixPair left = values;
    left -= sum.pairs(centres, centres, result);
    const Extended rest = extended(left);
    coefficients = transposed_product(Q, rest) / static_cast<long double>(Q.rows());
    if (step == kRefinements) return result;
    result += MatrixPair(solver->solve((rest - product(Q, coefficients)).cast<double>()).weights);
  }
}

// Takes out what rounding leaves of Q^T weights, which is zero.
void FieldDerivative::Impl::clear_moments(MatrixPair& weights) const {
  const Extended moments = transposed_product(Q, extended(weights));
  weights -= pair_of(product(Q, moments / static_cast<long double>(Q.rows())));
}

// The transpose of `weights`, polynomials included.
MatrixXd FieldDerivative::Impl::transposed_weights(MatrixPair by_weights,
                                                   const Extended& by_coefficients) const {
  const MatrixPair even = pair_of(product(Q, by_coefficients / static_cast<long double>(Q.rows())));
  by_weights -= sum.pairs(centres, centres, even);
  Extended unused;
  MatrixPair result = weights(by_weights, unused);
  result += even;
  return result.rounded();
}

FieldDerivative::FieldDerivative(const FrozenField& field, const MatrixXd& targets) {
  impl_ = std::make_shared<const Impl>(field, targets);
}

Index FieldDerivative::points() const { return impl_->points.rows(); }
Index FieldDerivative::targets() const { return impl_->targets.rows(); }

MatrixXd FieldDerivative::forward(const MatrixXd& values) const {
  const Impl& s = *impl_;
  const MatrixXd fit = s.P.transpose() * values / static_cast<double>(s.P.rows());
  MatrixXd left = values - s.P * fit;
  Extended coefficients;
  const MatrixPair weights = s.weights(MatrixPair(left(s.rows, Eigen::all)), coefficients);
  const auto field = [&](const MatrixXd& at, const MatrixXd& Q) {
    MatrixPair sums = s.sum.pairs(at, s.centres, weights);
    sums += pair_of(product(Q, coefficients));
    return sums.rounded();
  };
  MatrixXd result = field(s.targets, s.Q_targets) + s.P_targets * fit;
  if (s.levels.empty()) return result;
  left -= field(s.points, s.Q_points);
  for (const auto& level : s.levels) {
    const MatrixXd part = level->solve(left(level->rows, Eigen::all));
    add_sums(level->system.sum(), *s.ordered_points, part, -1, left);
    if (s.ordered_targets) add_sums(level->system.sum(), *s.ordered_targets, part, 1, result);
  }
  return result;
}

MatrixXd FieldDerivative::adjoint(const MatrixXd& slopes) const {
  const Impl& s = *impl_;
  MatrixXd by_left = MatrixXd::Zero(s.points.rows(), slopes.cols());
  for (auto at = s.levels.rbegin(); at != s.levels.rend(); ++at) {
    const Level& level = **at;
    const Ordered centres(s.points(level.rows, Eigen::all));
    MatrixXd by_part = MatrixXd::Zero(centres.points.rows(), slopes.cols());
    add_sums(s.over_points->with_support(level.system.sum().support()), centres, by_left, -1,
             by_part);
    if (s.over_targets)
      add_sums(s.over_targets->with_support(level.system.sum().support()), centres, slopes, 1,
               by_part);
    add_rows(by_left, level.rows, level.solve(by_part));
  }
  MatrixPair by_weights = sum_sources(s.sum, s.centres, s.targets, MatrixPair(slopes));
  Extended by_coefficients = transposed_product(s.Q_targets, slopes.cast<long double>());
  if (!s.levels.empty()) {
    by_weights -= sum_sources(s.sum, s.centres, s.points, MatrixPair(by_left));
    by_coefficients -= transposed_product(s.Q_points, by_left.cast<long double>());
  }
  add_rows(by_left, s.rows, s.transposed_weights(std::move(by_weights), by_coefficients));
  const MatrixXd by_fit = s.P_targets.transpose() * slopes - s.P.transpose() * by_left;
  return by_left + s.P * by_fit / static_cast<double>(s.P.rows());
}

}  // namespace cadmorph
