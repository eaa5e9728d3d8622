#include "core/rbf/multiscale_correction.h"

#include <algorithm>
#include <numeric>

#include "core/errors.h"
#include "core/kd_tree.h"
#include "core/parallel.h"
#include "core/rbf/compact_system.h"

namespace cadmorph {
namespace {

using Eigen::MatrixXd;

// Over all levels: functions reach a little beyond the points that they interpolate, and what they
// leave there is left for the next sweep. With 2 or 6, 6 meshes come out the same, with half or
// twice of kSolved and kMostly, and a tenth or ten times kActive, to 1e-4.
constexpr int kSweeps = 3;

// Residuals below the first part of their allowance call for no correction. Levels are solved to
// the second, which leaves room for what finer levels change.
constexpr double kActive = 0.01;
constexpr double kSolved = 0.3;

// A level of more than this part of its points has all of them: the others would miss what its
// functions put there, which calls for a further sweep.
constexpr double kMostly = 1.0 / 3;

bool is_active(const MatrixXd& residual, const Eigen::VectorXd& allowed, Index i) {
  return residual.row(i).norm() > kActive * allowed(i);
}

// The points of a level within reach of one whose residual calls for a correction.
std::vector<Index> level_rows(const Points& points, Index count, const MatrixXd& residual,
                              const Eigen::VectorXd& allowed, double support) {
  std::vector<Index> active;
  for (Index i = 0; i < count; ++i)
    if (is_active(residual, allowed, i)) active.push_back(i);
  if (active.empty() || static_cast<Index>(active.size()) == count) return active;
  const KdTree tree(points(active, Eigen::all));
  std::vector<char> is_near(count);
  parallel_for(count, 1024, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i)
      is_near[i] =
          tree.nearest(points.row(i).data(), 1).front().squared_distance < support * support;
  });
  std::vector<Index> rows;
  for (Index i = 0; i < count; ++i)
    if (is_near[i]) rows.push_back(i);
  if (static_cast<double>(rows.size()) > kMostly * static_cast<double>(count)) {
    rows.resize(count);
    std::iota(rows.begin(), rows.end(), Index{0});
  }
  return rows;
}

}  // namespace

// A level's functions reach a little beyond the points that it interpolates: what they leave there
// is taken by a further sweep.
MultiscaleCorrection::MultiscaleCorrection(const Points& points,
                                           const std::vector<double>& separation, MatrixXd residual,
                                           const Eigen::VectorXd& allowed, double spacing) {
  double left = relative_residual(residual, allowed);
  for (int sweep = 0; sweep < kSweeps && (sweep == 0 || left > 1); ++sweep) {
    add_levels(points, separation, residual, allowed, spacing);
    left = relative_residual(residual, allowed);
  }
  if (!(left <= 1))
    throw SolverError("the surface correction leaves " + std::to_string(left) +
                      " times the residual asked");
  remainders_ = residual.rowwise().norm();
}

void MultiscaleCorrection::add_levels(const Points& points, const std::vector<double>& separation,
                                      MatrixXd& residual, const Eigen::VectorXd& allowed,
                                      double spacing) {
  const Index n = points.rows();
  const std::vector<Index> near_order = spatial_order(points);
  const MatrixXd targets = points(near_order, Eigen::all);
  Index count = 0;
  for (int level = 0; level < kMostLevels && count < n; ++level, spacing /= 2) {
    while (count < n && separation[count] >= spacing) ++count;
    const double support = kSupport * spacing;
    const std::vector<Index> rows = level_rows(points, count, residual, allowed, support);
    if (rows.empty()) continue;
    const Points centres = points(rows, Eigen::all);
    const CompactSystem system(centres, support);
    MatrixXd values(centres.rows(), residual.cols());
    Eigen::VectorXd goal(centres.rows());
    for (Index i = 0; i < values.rows(); ++i) {
      values.row(i) = residual.row(rows[i]);
      goal(i) = kSolved * allowed(rows[i]);
    }
    const CgResult solved = system.solve(std::move(values), goal);
    if (!solved.has_converged())
      throw SolverError("the surface correction did not converge at spacing " +
                        std::to_string(spacing) + " of the model's radius");
    const MatrixXd taken = system.sum()(targets, solved.weights);
    for (Index i = 0; i < n; ++i) residual.row(near_order[i]) -= taken.row(i);
    levels_.push_back({{support, centres, solved.weights}, system.sum()});
  }
}

MultiscaleCorrection::MultiscaleCorrection(std::vector<CorrectionLevel> levels) {
  for (CorrectionLevel& level : levels) {
    CompactSum sum(level.points, level.support);
    levels_.push_back({std::move(level), std::move(sum)});
  }
}

std::vector<CorrectionLevel> MultiscaleCorrection::levels() const {
  std::vector<CorrectionLevel> result;
  for (const Level& level : levels_) result.push_back(level.terms);
  return result;
}

MatrixXd MultiscaleCorrection::evaluate(const Eigen::Ref<const MatrixXd>& targets) const {
  if (is_empty()) return MatrixXd::Zero(targets.rows(), 0);
  const std::vector<Index> near_order = spatial_order(targets);
  const MatrixXd near_targets = targets(near_order, Eigen::all);
  MatrixXd sums = MatrixXd::Zero(targets.rows(), levels_.front().terms.coefficients.cols());
  for (const Level& level : levels_) sums += level.sum(near_targets, level.terms.coefficients);
  MatrixXd result(sums.rows(), sums.cols());
  for (Index i = 0; i < sums.rows(); ++i) result.row(near_order[i]) = sums.row(i);
  return result;
}

}  // namespace cadmorph
