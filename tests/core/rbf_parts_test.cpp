#include <Eigen/Dense>
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>

#include "core/kd_tree.h"
#include "core/parallel.h"
#include "core/rbf/centre_frame.h"
#include "core/rbf/conjugate_gradient.h"
#include "core/rbf/field_evaluator.h"
#include "core/rbf/h2_matrix.h"
#include "core/rbf/multiscale_correction.h"
#include "core/rbf/point_order.h"
#include "core/rbf/sparse_inverse_cholesky.h"
#include "rbf_sets.h"

using namespace cadmorph;
using Eigen::MatrixXd;

namespace {

Points reorder(const Points& points, const std::vector<Index>& rows) {
  Points result(static_cast<Index>(rows.size()), 3);
  for (Index i = 0; i < result.rows(); ++i) result.row(i) = points.row(rows[i]);
  return result;
}

Eigen::VectorXd spacing_of(const RowMatrix& points) {
  const KdTree tree(points);
  Eigen::VectorXd result(points.rows());
  for (Index i = 0; i < points.rows(); ++i)
    result(i) = std::sqrt(tree.nearest(points.row(i).data(), 2)[1].squared_distance);
  return result;
}

// Points in unit size with the polynomials and random weights that annihilate them.
struct Sample {
  explicit Sample(const RowMatrix& points)
      : frame(points),
        x(frame.to_unit(points)),
        P(frame.polynomials(x)),
        w(MatrixXd::Random(x.rows(), 3)) {
    project_out(P, w);
  }
  CentreFrame frame;
  MatrixXd x, P, w;
};

bool is_permutation_of_rows(std::vector<Index> rows, Index count) {
  std::sort(rows.begin(), rows.end());
  for (Index i = 0; i < count; ++i)
    if (i >= static_cast<Index>(rows.size()) || rows[i] != i) return false;
  return static_cast<Index>(rows.size()) == count;
}

}  // namespace

TEST_CASE("farthest-point order takes the farthest point each time", "[core][rbf]") {
  srand(1);
  const Points points = Points::Random(300, 3);
  const PointOrder order = farthest_point_order(points);
  REQUIRE(is_permutation_of_rows(order.rows, 300));
  Eigen::VectorXd distance =
      Eigen::VectorXd::Constant(300, std::numeric_limits<double>::infinity());
  for (std::size_t i = 0; i < order.rows.size(); ++i) {
    REQUIRE(order.separation[i] == distance(order.rows[i]));
    if (i > 0) REQUIRE(order.separation[i] == distance.maxCoeff());
    for (Index j = 0; j < 300; ++j)
      distance(j) = std::min(distance(j), (points.row(j) - points.row(order.rows[i])).norm());
  }
}

TEST_CASE("the second of two close sheets follows the first", "[core][rbf]") {
  const test::RbfSet set = test::thin_sheets(test::SheetShape::Plate, 1000, 0.01, true);
  const PointOrder order = farthest_point_order(set.surface);
  const Points ordered = reorder(set.surface, order.rows);
  const std::vector<Index> rows = leader_follower_order(ordered, order.separation, 4);
  REQUIRE(is_permutation_of_rows(rows, ordered.rows()));
  const Points result = reorder(ordered, rows);
  Eigen::Matrix3d edges;
  for (int d = 0; d < 3; ++d) edges.row(d) = result.row(d + 1) - result.row(0);
  // The first four span the plate: 0.01 of a spacing of 1/21 thick, area 1.
  REQUIRE(std::abs(edges.determinant()) > 0.9 * 0.01 / 21);
  // Opposite nodes stay together, as a leader and its follower, but for those of the simplex.
  const KdTree tree{RowMatrix(result)};
  Index apart = 0;
  for (Index i = 0; i < result.rows(); ++i) {
    const Index opposite = tree.nearest(result.row(i).data(), 2)[1].index;
    if (std::abs(opposite - i) != 1) ++apart;
  }
  REQUIRE(apart <= 8);
}

TEST_CASE("with full stencils the factor is the inverse on the constrained space", "[core][rbf]") {
  srand(2);
  const Points points = Points::Random(200, 3);
  const PointOrder order = farthest_point_order(points);
  const Points first = reorder(points, order.rows);
  const Points ordered = reorder(first, leader_follower_order(first, order.separation, 4));
  const SparseInverseCholesky factor(ordered, 4, {.dense_rows = 256});
  Sample s{RowMatrix(ordered)};
  const KernelSum sum(Kernel::triharmonic_3d());
  const MatrixXd image = sum(MatrixXd(ordered), MatrixXd(ordered), s.w);
  // Condition number 1e6 of the reduced matrix.
  REQUIRE((factor.apply(image) - s.w).cwiseAbs().maxCoeff() < 1e-8);
}

TEST_CASE("columns of the sparse factor annihilate linear polynomials", "[core][rbf]") {
  const test::RbfSet set = test::sphere_in_box(1500, 0);
  const PointOrder order = farthest_point_order(set.surface);
  const Points first = reorder(set.surface, order.rows);
  const Points ordered = reorder(first, leader_follower_order(first, order.separation, 4));
  const SparseInverseCholesky factor(ordered, 4);
  Sample s{RowMatrix(ordered)};
  const MatrixXd image = factor.apply(s.P);
  REQUIRE(image.cwiseAbs().maxCoeff() < 1e-7 * factor.apply(s.w).cwiseAbs().maxCoeff());
  set_thread_count(1);
  const MatrixXd one = factor.apply(s.w);
  set_thread_count(3);
  REQUIRE(factor.apply(s.w) == one);
  set_thread_count(0);
}

TEST_CASE("the H2 product equals direct sums below the local tolerance", "[core][rbf]") {
  srand(3);
  for (const test::RbfSet& set : {test::turning_hole(6000, 0), test::graded_wing(6000, 0)}) {
    const Sample s(set.surface);
    const Eigen::VectorXd h = spacing_of(set.surface) / s.frame.unit();
    const H2Matrix matrix(s.x, h, {.leaf_size = 100});
    const MatrixXd exact = KernelSum(Kernel::triharmonic_3d())(s.x, s.x, s.w);
    const MatrixXd found = matrix.multiply(s.w);
    // Absolute: relative to the sum of |w| r^3, about 6000 * 2.
    INFO(set.name);
    REQUIRE((found - exact).cwiseAbs().maxCoeff() < 1e-7);
    REQUIRE((found - exact).cwiseAbs().maxCoeff() > 0);
    set_thread_count(1);
    const MatrixXd one = matrix.multiply(s.w);
    set_thread_count(0);
    REQUIRE(found == one);
  }
}

TEST_CASE("the volume evaluator equals direct sums", "[core][rbf]") {
  srand(4);
  const test::RbfSet set = test::turning_hole(4000, 30000);
  const Sample s(set.surface);
  const H2Matrix matrix(s.x, spacing_of(set.surface) / s.frame.unit(), {.leaf_size = 100});
  const MatrixXd targets = s.frame.to_unit(set.volume);
  const H2Matrix::Sources sources = matrix.compress(s.w);
  const MatrixXd found = evaluate_field(matrix, sources, targets);
  const MatrixXd exact = KernelSum(Kernel::triharmonic_3d())(targets, s.x, s.w);
  REQUIRE((found - exact).cwiseAbs().maxCoeff() < 1e-7);
  set_thread_count(1);
  const MatrixXd one = evaluate_field(matrix, sources, targets);
  set_thread_count(0);
  REQUIRE(found == one);
}

TEST_CASE("Chebyshev interpolation converges with its order", "[core][rbf]") {
  srand(5);
  const test::RbfSet set = test::turning_hole(4000, 30000);
  const Sample s(set.surface);
  const H2Matrix matrix(s.x, spacing_of(set.surface) / s.frame.unit(),
                        {.leaf_size = 100, .accuracy = 1e-9});
  const MatrixXd targets = s.frame.to_unit(set.volume);
  const H2Matrix::Sources sources = matrix.compress(s.w);
  const MatrixXd exact = KernelSum(Kernel::triharmonic_3d())(targets, s.x, s.w);
  double previous = std::numeric_limits<double>::infinity();
  for (const int order : {4, 6, 8}) {
    const double error =
        (evaluate_field(matrix, sources, targets, {.order = order}) - exact).cwiseAbs().maxCoeff();
    // Separation 0.6 bounds the ratio by about 0.35 an order; two orders by an eighth.
    REQUIRE(error < previous / 5);
    previous = error;
  }
}

TEST_CASE("a residual that is no number counts as infinite", "[core][rbf]") {
  MatrixXd residual = MatrixXd::Zero(4, 3);
  residual(2, 1) = NAN;
  REQUIRE(relative_residual(residual, Eigen::VectorXd::Ones(4)) ==
          std::numeric_limits<double>::infinity());
}

TEST_CASE("the multiscale correction takes up what it is given", "[core][rbf]") {
  srand(6);
  const PointOrder order = farthest_point_order(Points::Random(2000, 3));
  const Points points = Points::Random(2000, 3);
  const PointOrder own = farthest_point_order(points);
  const Points ordered = reorder(points, own.rows);
  MatrixXd residual = MatrixXd::Zero(2000, 3);
  for (Index i = 500; i < 700; ++i) residual.row(i).setRandom();
  const Eigen::VectorXd allowed = Eigen::VectorXd::Constant(2000, 1e-6);
  const MultiscaleCorrection correction(ordered, own.separation, residual, allowed, 0.2);
  REQUIRE((correction.remainders().array() <= allowed.array()).all());
  REQUIRE((correction.evaluate(ordered) - residual).cwiseAbs().maxCoeff() <= 1e-6);
  // No reach beyond the supports.
  const MatrixXd away = MatrixXd::Constant(1, 3, 5);
  REQUIRE(correction.evaluate(away).norm() == 0);
  REQUIRE(MultiscaleCorrection(ordered, own.separation, MatrixXd::Zero(2000, 3), allowed, 0.2)
              .is_empty());
}
