#include <Eigen/Dense>
#include <catch2/catch.hpp>
#include <cmath>

#include "core/errors.h"
#include "core/parallel.h"
#include "core/rbf/centre_frame.h"
#include "core/rbf/incremental_qr.h"
#include "core/rbf/rbf_system.h"
#include "rbf_sets.h"

using namespace cadmorph;
using Eigen::MatrixXd;

namespace {

const Kernel kTriharmonic = Kernel::triharmonic_3d();

RbfOptions qr(double tolerance) {
  RbfOptions options;
  options.solver = SolverKind::Iqr;
  options.tolerance = tolerance;
  return options;
}

// Root mean square of rows over one length.
double mean(const RowMatrix& missed, double length) {
  return std::sqrt(missed.rowwise().squaredNorm().mean()) / length;
}

}  // namespace

TEST_CASE("the incremental QR gives the least-squares solution of the centres it takes",
          "[core][rbf][qr]") {
  const test::RbfSet set = test::sphere_in_box(900, 0);
  const CentreFrame frame(set.surface);
  const auto x = std::make_shared<const MatrixXd>(frame.to_unit(set.surface));
  const MatrixXd P = frame.polynomials(*x);
  const Index n = x->rows(), q = P.cols();
  const double h = 0.1;
  const KernelSum sum(kTriharmonic);
  const IncrementalQr solver(sum, x, P, Eigen::VectorXd::Constant(n, h), {.tolerance = 0.1});
  const QrSolution found = solver.solve(set.displacement);
  const auto k = static_cast<Index>(found.rows.size());
  REQUIRE(k > 20);
  REQUIRE(k < n / 2);
  const auto least_squares = [&](Index kernels) {
    MatrixXd A = MatrixXd::Zero(n + q, q + kernels), B = MatrixXd::Zero(n + q, 3);
    A.topLeftCorner(n, q) = P;
    for (Index j = 0; j < kernels; ++j) {
      for (Index i = 0; i < n; ++i)
        A(i, q + j) = kTriharmonic((x->row(i) - x->row(found.rows[j])).norm());
      A.col(q + j).tail(q) = P.row(found.rows[j]);
    }
    B.topRows(n) = set.displacement;
    const MatrixXd X = A.colPivHouseholderQr().solve(B);
    return std::pair(X, std::sqrt((A * X - B).squaredNorm() / static_cast<double>(n)) / h);
  };
  const auto [X, error] = least_squares(k);
  CHECK((found.coefficients - X.topRows(q)).norm() < 1e-8 * X.norm());
  CHECK((found.weights - X.bottomRows(k)).norm() < 1e-8 * X.norm());
  CHECK(found.error == Approx(error).epsilon(1e-8));
  CHECK(error <= 0.1);
  CHECK(least_squares(k - 1).second > 0.1);
}

TEST_CASE("the incremental QR reaches its tolerance, with more kernels the smaller it is",
          "[core][rbf][qr]") {
  const test::RbfSet set = test::sphere_in_box(1200, 200);
  RbfOptions options = qr(0);
  options.local_length = Eigen::VectorXd::Constant(set.surface.rows(), 0.1);
  int previous = 0;
  for (const double tolerance : {0.1, 0.03, 0.01}) {
    options.tolerance = tolerance;
    const RbfField field = RbfSystem(set.surface, kTriharmonic, options).solve(set.displacement);
    CHECK(mean(field.evaluate(set.surface) - set.displacement, 0.1) <= 1.001 * tolerance);
    CHECK(field.report().solver == SolverKind::Iqr);
    CHECK(field.report().iterations > previous);
    CHECK(field.report().iterations < set.surface.rows());
    previous = field.report().iterations;
  }
}

TEST_CASE("with all its centres the incremental QR interpolates as the dense solvers do",
          "[core][rbf][qr]") {
  srand(1);
  const RowMatrix x = RowMatrix::Random(150, 3), values = RowMatrix::Random(150, 3),
                  targets = RowMatrix::Random(50, 3);
  const RowMatrix expected =
      RbfSystem(x, kTriharmonic, {.solver = SolverKind::Cholesky}).solve(values).evaluate(targets);
  const RbfField field = RbfSystem(x, kTriharmonic, qr(1e-9)).solve(values);
  CHECK(field.report().iterations == 150);
  CHECK((field.evaluate(targets) - expected).cwiseAbs().maxCoeff() < 1e-7);
}

TEST_CASE("affine values take no kernel at all", "[core][rbf][qr]") {
  srand(2);
  for (const Index dimension : {2, 3}) {
    const RowMatrix x = RowMatrix::Random(80, dimension);
    const RowMatrix values = (2 * x).array() + 1;
    const RbfField field = RbfSystem(x, kTriharmonic, qr(1e-8)).solve(values);
    CHECK(field.report().iterations == 0);
    CHECK((field.evaluate(3 * x) - RowMatrix((6 * x).array() + 1)).cwiseAbs().maxCoeff() < 1e-12);
  }
}

TEST_CASE("a value set comes out the same whatever was solved before and beside it",
          "[core][rbf][qr]") {
  const test::RbfSet set = test::sphere_in_box(700, 100);
  const auto run = [&](int threads, bool is_second) {
    set_thread_count(threads);
    const RbfSystem system(set.surface, kTriharmonic, qr(0.05));
    if (is_second) system.solve((30 * set.surface).array().sin());
    return system.solve(set.displacement).evaluate(set.volume);
  };
  const RowMatrix alone = run(1, false), after = run(3, true);
  set_thread_count(0);
  CHECK(alone == after);
}

TEST_CASE("the incremental QR says when memory or the dimension is beyond it", "[core][rbf][qr]") {
  const test::RbfSet set = test::sphere_in_box(1000, 0);
  RbfOptions options = qr(1e-7);
  options.memory_limit = 2e6;
  const RbfSystem system(set.surface, kTriharmonic, options);
  CHECK_THROWS_AS(system.solve(set.displacement), SolverError);
  CHECK_THROWS_AS(RbfSystem(RowMatrix::Random(40, 4), kTriharmonic, qr(0.1)), InvalidInputError);
}
