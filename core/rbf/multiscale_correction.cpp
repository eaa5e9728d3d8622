#include "core/rbf/multiscale_correction.h"

#include <Eigen/SparseCore>
#include <algorithm>
#include <cmath>

#include "core/errors.h"
#include "core/parallel.h"
#include "core/rbf/conjugate_gradient.h"

namespace cadmorph {
namespace {

using Eigen::MatrixXd;

constexpr double kSupport = 4;  // in spacings of a level
constexpr int kMaxLevels = 40;
constexpr int kSweeps = 3;
constexpr int kMaxIterations = 400;

// Residuals below this part of their allowance call for no correction, and levels are solved to
// this.
constexpr double kActive = 0.01;
constexpr double kSolved = 0.3;

double wendland_c2(double r) {
  const double t = 1 - r, t2 = t * t;
  return t2 * t2 * (4 * r + 1);
}

using SparseMatrix = Eigen::SparseMatrix<double, Eigen::RowMajor, Index>;

SparseMatrix assemble(const KdTree& tree, const RowMatrix& points, double support) {
  const Index n = points.rows();
  std::vector<std::vector<Neighbour>> rows(n);
  parallel_for(n, 256, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) {
      rows[i] = tree.within(points.row(i).data(), support);
      std::sort(rows[i].begin(), rows[i].end(),
                [](const Neighbour& a, const Neighbour& b) { return a.index < b.index; });
    }
  });
  SparseMatrix matrix(n, n);
  Index entries = 0;
  for (const auto& row : rows) entries += static_cast<Index>(row.size());
  matrix.reserve(entries);
  for (Index i = 0; i < n; ++i) {
    matrix.startVec(i);
    for (const Neighbour& near : rows[i])
      matrix.insertBack(i, near.index) = wendland_c2(std::sqrt(near.squared_distance) / support);
  }
  matrix.finalize();
  return matrix;
}

MatrixXd multiply(const SparseMatrix& matrix, const MatrixXd& x) {
  MatrixXd result(x.rows(), x.cols());
  parallel_for(x.rows(), 1024, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) {
      result.row(i).setZero();
      for (SparseMatrix::InnerIterator entry(matrix, i); entry; ++entry)
        result.row(i) += entry.value() * x.row(entry.col());
    }
  });
  return result;
}

RowMatrix select(const Points& points, const std::vector<Index>& rows) {
  RowMatrix result(static_cast<Index>(rows.size()), 3);
  for (Index i = 0; i < result.rows(); ++i) result.row(i) = points.row(rows[i]);
  return result;
}

bool is_active(const MatrixXd& residual, const Eigen::VectorXd& allowed, Index i) {
  return residual.row(i).norm() > kActive * allowed(i);
}

// The points of a level within reach of one whose residual calls for a correction.
std::vector<Index> level_rows(const Points& points, Index count, const MatrixXd& residual,
                              const Eigen::VectorXd& allowed, double support) {
  std::vector<Index> active;
  for (Index i = 0; i < count; ++i)
    if (is_active(residual, allowed, i)) active.push_back(i);
  if (active.empty()) return {};
  const KdTree tree(select(points, active));
  std::vector<char> is_near(count);
  parallel_for(count, 1024, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i)
      is_near[i] =
          tree.nearest(points.row(i).data(), 1).front().squared_distance < support * support;
  });
  std::vector<Index> rows;
  for (Index i = 0; i < count; ++i)
    if (is_near[i]) rows.push_back(i);
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
  Index count = 0;
  for (int level = 0; level < kMaxLevels && count < n; ++level, spacing /= 2) {
    while (count < n && separation[count] >= spacing) ++count;
    const double support = kSupport * spacing;
    const std::vector<Index> rows = level_rows(points, count, residual, allowed, support);
    if (rows.empty()) continue;
    const RowMatrix centres = select(points, rows);
    KdTree tree(centres);
    const SparseMatrix matrix = assemble(tree, centres, support);
    MatrixXd rhs(centres.rows(), residual.cols());
    Eigen::VectorXd goal(centres.rows());
    for (Index i = 0; i < rhs.rows(); ++i) {
      rhs.row(i) = residual.row(rows[i]);
      goal(i) = kSolved * allowed(rows[i]);
    }
    const CgResult solved =
        solve_projected_cg([&](const MatrixXd& x) { return multiply(matrix, x); },
                           [](const MatrixXd& x) { return x; }, MatrixXd(rhs.rows(), 0), {rhs},
                           {goal}, {.max_iterations = kMaxIterations})
            .front();
    if (!solved.has_converged())
      throw SolverError("the surface correction did not converge at spacing " +
                        std::to_string(spacing) + " of the model's radius");
    levels_.push_back({{support, centres, solved.weights}, std::move(tree)});
    residual -= evaluate(levels_.back(), points);
  }
}

MultiscaleCorrection::MultiscaleCorrection(std::vector<CorrectionLevel> levels) {
  for (CorrectionLevel& level : levels) {
    KdTree tree(level.points);
    levels_.push_back({std::move(level), std::move(tree)});
  }
}

std::vector<CorrectionLevel> MultiscaleCorrection::levels() const {
  std::vector<CorrectionLevel> result;
  for (const Level& level : levels_) result.push_back(level.terms);
  return result;
}

MatrixXd MultiscaleCorrection::evaluate(const Level& level,
                                        const Eigen::Ref<const MatrixXd>& targets) {
  MatrixXd result = MatrixXd::Zero(targets.rows(), level.terms.coefficients.cols());
  parallel_for(targets.rows(), 512, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) {
      const Eigen::RowVector3d x = targets.row(i);
      for (const Neighbour& near : level.tree.within(x.data(), level.terms.support))
        result.row(i) += wendland_c2(std::sqrt(near.squared_distance) / level.terms.support) *
                         level.terms.coefficients.row(near.index);
    }
  });
  return result;
}

MatrixXd MultiscaleCorrection::evaluate(const Eigen::Ref<const MatrixXd>& targets) const {
  if (is_empty()) return MatrixXd::Zero(targets.rows(), 0);
  MatrixXd result = evaluate(levels_.front(), targets);
  for (std::size_t l = 1; l < levels_.size(); ++l) result += evaluate(levels_[l], targets);
  return result;
}

}  // namespace cadmorph
