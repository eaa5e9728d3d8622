#include "core/rbf/sparse_inverse_cholesky.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "core/archive_types.h"
#include "core/errors.h"
#include "core/parallel.h"
#include "core/rbf/box_tree.h"
#include "core/rbf/simd.h"

namespace cadmorph {
namespace {

using Eigen::MatrixXd;

// Directions of a stencil with less than this moment a point, in squares of its radius, are flat:
// with an extent below 3e-7. The sums round to 1e-16.
constexpr double kFlatMoment = 1e-13;

// Gains in log variance above which a stencil is enlarged: ten times those of ordinary parts. The
// tests of thin gaps pass with half and twice of it.
constexpr double kDefect = 0.02;

// Each tree serves the points up to 1.5 times its start: later points in a tree cost search time.
// With 1.25 or 3 canisters of 15,666 and 21,124 centres take the same time to 10 %.
constexpr double kTreeGrowth = 1.5;

// Columns of U are added up in this many parts whatever the thread count.
constexpr Index kScatterParts = 8;
constexpr Index kGrain = 64;

// Computes single columns of the factor; one a thread.
class ColumnSolver {
 public:
  // Weights for the stencil rows (the point itself first), or an empty vector when they can't
  // determine more than the linear polynomials. Throws SolverError when singular.
  const Eigen::VectorXd& solve(const Points& points, const std::vector<Index>& stencil) {
    const Index n = static_cast<Index>(stencil.size());
    stride_ = simd::padded(n);
    load_coordinates(points, stencil);
    const int terms = orthonormal_polynomials(n);
    weights_.resize(0);
    if (n <= terms) return weights_;
    if (!solve_conditional(n, terms))
      throw SolverError("centre " + std::to_string(stencil[0]) +
                        " (in elimination order) depends on its neighbours to rounding; remove "
                        "centres that nearly coincide");
    return weights_;
  }

 private:
  void load_coordinates(const Points& points, const std::vector<Index>& stencil) {
    const Index n = static_cast<Index>(stencil.size());
    x_.setZero(stride_, 3);
    for (Index j = 0; j < n; ++j) x_.row(j) = points.row(stencil[j]) - points.row(stencil[0]);
    radius_ = std::sqrt(x_.rowwise().squaredNorm().maxCoeff());
    if (radius_ > 0) x_ /= radius_;
  }

  // Q: the constant and the directions in which the stencil has an extent.
  int orthonormal_polynomials(Index n) {
    q_.setZero(stride_, 5);
    q_.col(0).head(n).setConstant(1 / std::sqrt(static_cast<double>(n)));
    Eigen::Matrix<double, Eigen::Dynamic, 3> centred = x_.topRows(n);
    centred.rowwise() -= centred.colwise().mean().eval();
    const Eigen::Matrix3d moments = centred.transpose() * centred;
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(moments);
    int terms = 1;
    for (int a = 2; a >= 0; --a) {
      if (!(axes.eigenvalues()(a) > kFlatMoment * n)) break;
      auto column = q_.col(terms).head(n);
      column = centred * axes.eigenvectors().col(a);
      for (int b = 0; b < terms; ++b) column -= q_.col(b).head(n).dot(column) * q_.col(b).head(n);
      column.normalize();
      ++terms;
    }
    return terms;
  }

  // u = B^-1 (e_0 - Q S^-1 Q^T B^-1 e_0), B = A + sigma Q Q^T, S = Q^T B^-1 Q: the first column of
  // the inverse of A on the null space of Q^T.
  bool solve_conditional(Index n, int terms) {
    const simd::Functions& simd = simd::functions(simd::best());
    matrix_.resize(stride_, n);
    simd.cubic_matrix(n, x_.data(), matrix_.data(), stride_);
    const double shift = 2 * matrix_.colwise().sum().maxCoeff();
    simd.add_outer_products(n, terms, q_.data(), shift, matrix_.data(), stride_);
    if (!simd.cholesky(n, matrix_.data(), stride_)) return false;
    z_ = q_.leftCols(terms + 1);
    z_.col(terms).setZero();
    z_(0, terms) = 1;
    simd.cholesky_solve(n, matrix_.data(), terms + 1, z_.data(), stride_);
    const auto Q = q_.block(0, 0, n, terms);
    const MatrixXd S = Q.transpose() * z_.block(0, 0, n, terms);
    const Eigen::VectorXd b = Q.transpose() * z_.col(terms).head(n);
    weights_ = z_.col(terms).head(n) - z_.block(0, 0, n, terms) * S.ldlt().solve(b);
    weights_ -= Q * (Q.transpose() * weights_).eval();
    const double leading = weights_(0);
    if (!(leading > 0)) return false;
    weights_ *= 1 / std::sqrt(leading * radius_ * radius_ * radius_);
    return true;
  }

  Index stride_ = 0;
  double radius_ = 0;
  Eigen::Matrix<double, Eigen::Dynamic, 3> x_;
  MatrixXd q_, matrix_, z_;
  Eigen::VectorXd weights_;
};

std::vector<Index> make_stencil(const BoxTree& tree, const Points& points, Index i, Index size) {
  std::vector<Index> stencil = {i};
  for (const Neighbour& near : tree.nearest_before(points.row(i).data(), size, i))
    stencil.push_back(near.index);
  return stencil;
}

struct Column {
  std::vector<Index> stencil;
  Eigen::VectorXd weights;
};

// The column with stencils of 1, 2, 4 times the size, as long as the gain is worth it.
Column solve_adaptive(ColumnSolver& solver, const BoxTree& tree, const Points& points, Index i,
                      Index size) {
  Column column{make_stencil(tree, points, i, size), {}};
  column.weights = solver.solve(points, column.stencil);
  for (int doubling = 0; doubling < 2 && column.weights.size() > 0; ++doubling) {
    size *= 2;
    Column larger{make_stencil(tree, points, i, size), {}};
    larger.weights = solver.solve(points, larger.stencil);
    const bool has_gain = 2 * std::log(larger.weights(0) / column.weights(0)) > kDefect;
    if (!has_gain) break;
    column = std::move(larger);
  }
  return column;
}

// A^-1 e_0, scaled to e_0^T A^-1 e_0 = 1, for the points of the stencil within the support of the
// first, which it keeps.
Eigen::VectorXd compact_weights(const Points& points, double support, std::vector<Index>& stencil) {
  const auto value = [&](Index i, Index j) {
    const double r = (points.row(i) - points.row(j)).norm() / support;
    const double rest = std::max(1 - r, 0.0), square = rest * rest;
    return square * square * (4 * r + 1);
  };
  std::erase_if(stencil, [&](Index j) { return value(stencil[0], j) == 0; });
  const Index n = std::ssize(stencil);
  MatrixXd matrix(n, n);
  for (Index i = 0; i < n; ++i)
    for (Index j = 0; j <= i; ++j) matrix(i, j) = value(stencil[i], stencil[j]);
  const Eigen::VectorXd weights = matrix.llt().solve(Eigen::VectorXd::Unit(n, 0));
  return weights / std::sqrt(weights(0));
}

// Calls visit(tree, begin, end) for ranges of points with a tree that holds all earlier ones.
template <class Visit>
void for_each_range(const Points& points, Index first, const Visit& visit) {
  const Index count = points.rows();
  while (first < count) {
    const Index last = std::min(count, static_cast<Index>(kTreeGrowth * first) + 512);
    const BoxTree tree(points, last);
    visit(tree, first, last);
    first = last;
  }
}

template <int M>
void gather(const std::vector<Index>& starts, const std::vector<std::int32_t>& rows,
            const std::vector<double>& values, const RowMatrix& r, Index i, double* out) {
  double sum[M] = {};
  for (Index p = starts[i]; p < starts[i + 1]; ++p) {
    const double* row = r.data() + M * static_cast<Index>(rows[p]);
    for (int m = 0; m < M; ++m) sum[m] += values[p] * row[m];
  }
  for (int m = 0; m < M; ++m) out[m] = sum[m];
}

template <int M>
void scatter(const std::vector<Index>& starts, const std::vector<std::int32_t>& rows,
             const std::vector<double>& values, Index i, const double* factor, RowMatrix& out) {
  for (Index p = starts[i]; p < starts[i + 1]; ++p) {
    double* row = out.data() + M * static_cast<Index>(rows[p]);
    for (int m = 0; m < M; ++m) row[m] += values[p] * factor[m];
  }
}

template <int M>
RowMatrix apply_factor(const std::vector<Index>& starts, const std::vector<std::int32_t>& rows,
                       const std::vector<double>& values, const RowMatrix& r) {
  const Index n = r.rows();
  const Index part_rows = std::max<Index>(1, (n + kScatterParts - 1) / kScatterParts);
  const Index parts = (n + part_rows - 1) / part_rows;
  std::vector<RowMatrix> sums(parts);
  parallel_for(parts, 1, [&](Index begin, Index end) {
    for (Index part = begin; part < end; ++part) {
      // The stencils of a part reach no later rows.
      const Index last = std::min(n, (part + 1) * part_rows);
      sums[part] = RowMatrix::Zero(last, M);
      for (Index i = part * part_rows; i < last; ++i) {
        double y[M];
        gather<M>(starts, rows, values, r, i, y);
        scatter<M>(starts, rows, values, i, y, sums[part]);
      }
    }
  });
  RowMatrix result = RowMatrix::Zero(n, M);
  parallel_for(n, 8192, [&](Index begin, Index end) {
    for (const RowMatrix& sum : sums) {
      const Index last = std::min<Index>(end, sum.rows());
      if (last > begin)
        result.middleRows(begin, last - begin) += sum.middleRows(begin, last - begin);
    }
  });
  return result;
}

}  // namespace

// make_column() makes a function of a task's own: the column of (tree of earlier points, point).
template <class MakeColumn>
void SparseInverseCholesky::build(const Points& points, const MakeColumn& make_column) {
  starts_.assign(1, 0);
  starts_.reserve(points.rows() + 1);
  for_each_range(points, 0, [&](const BoxTree& tree, Index first, Index last) {
    std::vector<Column> columns(last - first);
    parallel_for(last - first, kGrain, [&](Index begin, Index end) {
      auto column = make_column();
      for (Index j = begin; j < end; ++j) columns[j] = column(tree, first + j);
    });
    for (const Column& column : columns) {
      for (Index j = 0; j < column.weights.size(); ++j) {
        rows_.push_back(static_cast<std::int32_t>(column.stencil[j]));
        values_.push_back(column.weights(j));
      }
      starts_.push_back(static_cast<Index>(values_.size()));
    }
  });
}

SparseInverseCholesky::SparseInverseCholesky(const Points& points, int free,
                                             FactorOptions options) {
  const Index n = points.rows();
  if (n > std::numeric_limits<std::int32_t>::max())
    throw SolverError("the fast solver is limited to 2^31 centres");
  build(points, [&] {
    return [&, solver = ColumnSolver()](const BoxTree& tree, Index i) mutable {
      Column column;
      if (i < free) return column;
      if (options.is_adaptive && i >= options.dense_rows) {
        column = solve_adaptive(solver, tree, points, i, options.neighbours);
      } else {
        const Index size = i < options.dense_rows ? i : options.neighbours;
        column.stencil = make_stencil(tree, points, i, size);
        column.weights = solver.solve(points, column.stencil);
      }
      if (column.weights.size() == 0)
        throw SolverError("centre " + std::to_string(i) +
                          " (in elimination order) has no neighbours that span space");
      return column;
    };
  });
}

SparseInverseCholesky SparseInverseCholesky::of_compact(const Points& points, double support,
                                                        Index neighbours) {
  SparseInverseCholesky result;
  result.build(points, [&] {
    return [&](const BoxTree& tree, Index i) {
      Column column{make_stencil(tree, points, i, neighbours), {}};
      column.weights = compact_weights(points, support, column.stencil);
      return column;
    };
  });
  return result;
}

SparseInverseCholesky::SparseInverseCholesky(InputArchive& archive) {
  archive(starts_, rows_, values_);
}

void SparseInverseCholesky::store(OutputArchive& archive) const {
  archive(starts_, rows_, values_);
}

MatrixXd SparseInverseCholesky::apply(const MatrixXd& r) const {
  MatrixXd result(r.rows(), r.cols());
  Index column = 0;
  const auto apply_in = [&]<int M>(std::integral_constant<int, M>) {
    for (; column + M <= r.cols(); column += M)
      result.middleCols(column, M) =
          apply_factor<M>(starts_, rows_, values_, r.middleCols(column, M));
  };
  apply_in(std::integral_constant<int, 6>{});
  apply_in(std::integral_constant<int, 3>{});
  apply_in(std::integral_constant<int, 1>{});
  return result;
}

double stencil_defect(const Points& points, int free, const FactorOptions& options) {
  // One point in so many: stencils of twice the size take eight times the work, which makes it a
  // tenth of the factor's.
  constexpr Index kSample = 100;
  const Index first = std::max<Index>(options.dense_rows, free);
  std::vector<double> defects;
  for_each_range(points, first, [&](const BoxTree& tree, Index begin, Index end) {
    const Index count = (end - begin + kSample - 1) / kSample;
    std::vector<double> found(count);
    parallel_for(count, 4, [&](Index from, Index to) {
      ColumnSolver solver;
      for (Index s = from; s < to; ++s) {
        const Index i = begin + s * kSample;
        const double small =
            solver.solve(points, make_stencil(tree, points, i, options.neighbours))(0);
        const double large =
            solver.solve(points, make_stencil(tree, points, i, 2 * options.neighbours))(0);
        found[s] = 2 * std::log(large / small);
      }
    });
    defects.insert(defects.end(), found.begin(), found.end());
  });
  if (defects.empty()) return 0;
  const auto percentile = defects.begin() + (99 * (defects.size() - 1)) / 100;
  std::nth_element(defects.begin(), percentile, defects.end());
  return *percentile;
}

}  // namespace cadmorph
