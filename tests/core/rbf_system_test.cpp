#include "core/rbf/rbf_system.h"

#include <Eigen/Dense>
#include <catch2/catch.hpp>
#include <cmath>

#include "core/errors.h"
#include "core/parallel.h"

using namespace cadmorph;

namespace {

const std::vector<SolverKind> kDense = {SolverKind::Lu, SolverKind::Ldlt, SolverKind::Cholesky};

double largest(const RowMatrix& m) { return m.cwiseAbs().maxCoeff(); }

RowMatrix affine_image(const RowMatrix& x, const Eigen::MatrixXd& A, const Eigen::RowVectorXd& b) {
  return (x * A).rowwise() + b;
}

}  // namespace

TEST_CASE("affine values are reproduced away from the centres", "[core][rbf]") {
  srand(1);
  for (const Kernel& kernel :
       {Kernel::biharmonic_2d(), Kernel::triharmonic_3d(), Kernel::biharmonic_3d()})
    for (const SolverKind solver : kDense)
      for (const Index dimension : {2, 3, 4}) {
        const RowMatrix centres = 50 * RowMatrix::Random(80, dimension),
                        targets = 60 * RowMatrix::Random(30, dimension);
        const Eigen::MatrixXd A = Eigen::MatrixXd::Random(dimension, 3);
        const Eigen::RowVectorXd b = 1e3 * Eigen::RowVectorXd::Random(3);
        const RbfSystem system(centres, kernel, {.solver = solver});
        const RbfField field = system.solve(affine_image(centres, A, b));
        // Values of 1e3: rounding.
        REQUIRE(largest(field.evaluate(targets) - affine_image(targets, A, b)) < 1e-11);
      }
}

TEST_CASE("a sum of kernels in the interpolant's own space is found again everywhere",
          "[core][rbf]") {
  srand(2);
  const Index n = 120;
  for (const Kernel& kernel :
       {Kernel::biharmonic_2d(), Kernel::triharmonic_3d(), Kernel::biharmonic_3d()})
    for (const Index dimension : {2, 3, 4}) {
      const RowMatrix centres = 7 * RowMatrix::Random(n, dimension),
                      targets = 8 * RowMatrix::Random(40, dimension);
      Eigen::MatrixXd P(n, dimension + 1);
      P << Eigen::VectorXd::Ones(n), centres;
      Eigen::MatrixXd w = Eigen::MatrixXd::Random(n, 2);
      w -= P * P.householderQr().solve(w);
      const auto truth = [&](const RowMatrix& x) {
        RowMatrix values = RowMatrix::Zero(x.rows(), 2);
        for (Index i = 0; i < x.rows(); ++i)
          for (Index j = 0; j < n; ++j)
            values.row(i) += kernel((x.row(i) - centres.row(j)).norm()) * w.row(j);
        return values;
      };
      for (const SolverKind solver : kDense) {
        const RbfSystem system(centres, kernel, {.solver = solver});
        const RowMatrix values = truth(centres);
        const RbfField field = system.solve(values);
        // Condition numbers up to 1e6.
        REQUIRE(largest(field.evaluate(targets) - truth(targets)) < 1e-9 * largest(values));
        REQUIRE(system.report().reciprocal_condition > 1e-9);
        REQUIRE(system.report().reciprocal_condition <= 1);
      }
    }
}

TEST_CASE("positive definite kernels interpolate, with linear polynomials too", "[core][rbf]") {
  srand(3);
  const RowMatrix centres = RowMatrix::Random(60, 2), values = RowMatrix::Random(60, 2);
  for (const KernelKind kind :
       {KernelKind::Gaussian, KernelKind::Multiquadric, KernelKind::InverseMultiquadric})
    for (const SolverKind solver : kDense) {
      const RbfSystem system(centres, Kernel{kind, 0, 0, 8.0}, {.solver = solver});
      REQUIRE(largest(system.solve(values).evaluate(centres) - values) < 1e-8);
      REQUIRE(largest(system.solve(centres).evaluate(2 * centres) - 2 * centres) < 1e-12);
    }
}

TEST_CASE("the choice of solver is reported with its reason", "[core][rbf]") {
  srand(4);
  const RowMatrix x = RowMatrix::Random(50, 3);
  CHECK(RbfSystem(x, Kernel::triharmonic_3d()).report().solver == SolverKind::Cholesky);
  CHECK(RbfSystem(x, Kernel::quadharmonic_3d()).report().solver == SolverKind::Ldlt);
  CHECK_FALSE(RbfSystem(x, Kernel::triharmonic_3d()).report().reason.empty());
}

TEST_CASE("dense results do not depend on the number of threads", "[core][rbf]") {
  srand(12);
  const RowMatrix centres = RowMatrix::Random(900, 3), values = RowMatrix::Random(900, 3);
  for (const SolverKind solver : kDense) {
    const auto run = [&](int threads) {
      set_thread_count(threads);
      const RbfSystem system(centres, Kernel::triharmonic_3d(), {.solver = solver});
      return system.solve(values).evaluate(0.5 * centres);
    };
    const RowMatrix one = run(1), three = run(3);
    set_thread_count(0);
    REQUIRE(one == three);
  }
}

TEST_CASE("scaled coordinates give the same thin-plate spline", "[core][rbf]") {
  srand(5);
  const RowMatrix centres = RowMatrix::Random(90, 2), values = RowMatrix::Random(90, 2),
                  targets = RowMatrix::Random(50, 2);
  const RowMatrix expected =
      RbfSystem(centres, Kernel::biharmonic_2d()).solve(values).evaluate(targets);
  for (const double scale : {1e-4, 1e5}) {
    const RowMatrix moved = (scale * centres).array() + 3 * scale,
                    there = (scale * targets).array() + 3 * scale;
    const RbfSystem system(moved, Kernel::biharmonic_2d());
    REQUIRE(largest(system.solve(values).evaluate(there) - expected) < 1e-9);
  }
}

TEST_CASE("one to D + 1 centres give the constant, or the linear map they determine",
          "[core][rbf]") {
  srand(6);
  for (const Index dimension : {2, 3})
    for (Index n = 1; n <= dimension + 1; ++n)
      for (const SolverKind solver : {SolverKind::Auto, SolverKind::Lu, SolverKind::Ldlt}) {
        const RowMatrix centres = RowMatrix::Random(n, dimension), values = RowMatrix::Random(n, 2);
        const RbfSystem system(centres, Kernel::triharmonic_3d(), {.solver = solver});
        REQUIRE(system.report().polynomial_terms == n);
        const RbfField field = system.solve(values);
        REQUIRE(largest(field.evaluate(centres) - values) < 1e-12);
        const RowMatrix middle = centres.colwise().mean();
        REQUIRE(largest(field.evaluate(middle) - RowMatrix(values.colwise().mean())) < 1e-12);
      }
}

TEST_CASE("flat sets lose the directions that they can't determine", "[core][rbf]") {
  srand(7);
  const Eigen::Matrix3d turn =
      Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, 3).normalized()).matrix();
  RowMatrix plane = RowMatrix::Random(40, 3), line = plane;
  plane.col(2).setZero();
  line.rightCols(2).setZero();
  for (const SolverKind solver : kDense) {
    const RbfSystem in_plane(plane * turn, Kernel::triharmonic_3d(), {.solver = solver});
    CHECK(in_plane.report().polynomial_terms == 3);
    const RbfSystem on_line(line * turn, Kernel::triharmonic_3d(), {.solver = solver});
    CHECK(on_line.report().polynomial_terms == 2);
    const RowMatrix shift = plane * turn * 1.5;
    REQUIRE(largest(in_plane.solve(shift).evaluate(shift) - 1.5 * shift) < 1e-12);
    const RowMatrix values = RowMatrix::Random(40, 3);
    REQUIRE(largest(in_plane.solve(values).evaluate(plane * turn) - values) < 1e-8);
  }
}

TEST_CASE("exact duplicates are merged, contradictory ones refused", "[core][rbf]") {
  srand(8);
  RowMatrix centres = RowMatrix::Random(30, 3), values = RowMatrix::Random(30, 3);
  centres.row(20) = centres.row(3);
  centres.row(21) = centres.row(3);
  values.row(20) = values.row(21) = values.row(3);
  const RbfSystem system(centres, Kernel::triharmonic_3d());
  CHECK(system.report().merged == 2);
  CHECK(system.report().centres == 28);
  REQUIRE(largest(system.solve(values).evaluate(centres) - values) < 1e-10);
  values(20, 1) += 1e-6;
  REQUIRE_THROWS_AS(system.solve(values), InvalidInputError);
}

TEST_CASE("centres that nearly coincide are served or refused, never silently wrong",
          "[core][rbf]") {
  srand(9);
  RowMatrix centres = RowMatrix::Random(50, 2);
  RowMatrix values = centres.array().sin();
  centres.row(49) = centres.row(0);
  centres(49, 0) += 1e-14;
  values.row(49) = values.row(0);
  try {
    const RbfField field = RbfSystem(centres, Kernel::biharmonic_2d()).solve(values);
    REQUIRE(largest(field.evaluate(centres) - values) < 1e-6);
  } catch (const SolverError&) {
    SUCCEED("refused");
  }
}

TEST_CASE("bad arguments are refused with the type that says so", "[core][rbf]") {
  srand(10);
  const RowMatrix centres = RowMatrix::Random(20, 3);
  const Kernel kernel = Kernel::triharmonic_3d();
  REQUIRE_THROWS_AS(RbfSystem(RowMatrix(0, 3), kernel), InvalidInputError);
  RowMatrix bad = centres;
  bad(4, 2) = INFINITY;
  REQUIRE_THROWS_AS(RbfSystem(bad, kernel), InvalidInputError);
  const RbfSystem system(centres, kernel);
  REQUIRE_THROWS_AS(system.solve(RowMatrix::Zero(19, 3)), InvalidInputError);
  REQUIRE_THROWS_AS(system.solve(bad), InvalidInputError);
  REQUIRE_THROWS_AS(system.solve(centres).evaluate(RowMatrix::Zero(5, 2)), InvalidInputError);
  REQUIRE_THROWS_AS(RbfSystem(centres, kernel, {.local_length = Eigen::VectorXd::Ones(7)}),
                    InvalidInputError);
  REQUIRE_THROWS_AS(RbfSystem(centres, kernel, {.local_length = Eigen::VectorXd::Zero(20)}),
                    InvalidInputError);
  REQUIRE_THROWS_AS(RbfSystem(centres, kernel, {.tolerance = 0}), InvalidInputError);
  REQUIRE_THROWS_AS(
      RbfSystem(centres, kernel, {.solver = SolverKind::Cholesky, .memory_limit = 1000}),
      SolverError);
  // Room for one matrix of 24 rows, and not for two.
  REQUIRE_NOTHROW(
      RbfSystem(centres, kernel, {.solver = SolverKind::Cholesky, .memory_limit = 6000}));
  for (const SolverKind two : {SolverKind::Lu, SolverKind::Ldlt})
    REQUIRE_THROWS_AS(RbfSystem(centres, kernel, {.solver = two, .memory_limit = 6000}),
                      SolverError);
  REQUIRE_THROWS_AS(RbfSystem(centres, Kernel::quadharmonic_3d(), {.solver = SolverKind::Cholesky}),
                    InvalidInputError);
  REQUIRE_THROWS_AS(RbfSystem(centres, Kernel::biharmonic_3d(), {.solver = SolverKind::Fast}),
                    InvalidInputError);
}

TEST_CASE("a singular system is refused", "[core][rbf]") {
  // A Gaussian far wider than the set is constant to rounding: nothing can be interpolated with it.
  srand(11);
  const RowMatrix centres = RowMatrix::Random(60, 2), values = RowMatrix::Random(60, 1);
  for (const SolverKind solver : {SolverKind::Auto, SolverKind::Lu, SolverKind::Ldlt})
    REQUIRE_THROWS_AS(
        RbfSystem(centres, Kernel{KernelKind::Gaussian, 0, 0, 1e-6}, {.solver = solver})
            .solve(values),
        SolverError);
}

TEST_CASE("noise on centres that nearly coincide is interpolated to a part of their distance",
          "[core][rbf]") {
  // Twins 1e-5 apart with values that differ by 1e-10: the system misses more than a millionth of
  // the values, and by far less than the twins are apart.
  srand(12);
  RowMatrix centres = RowMatrix::Random(400, 3);
  centres.bottomRows(200) = centres.topRows(200) + 1e-5 * RowMatrix::Random(200, 3);
  const RowMatrix values = 1e-10 * RowMatrix::Random(400, 3);
  const RbfField field = RbfSystem(centres, Kernel::triharmonic_3d()).solve(values);
  CHECK((field.evaluate(centres) - values).cwiseAbs().maxCoeff() < 1e-10);
  CHECK(field.report().max_residual <= 1e-5);
  // Values as large as the set is wide would be missed by more.
  CHECK_THROWS_AS(RbfSystem(centres, Kernel::triharmonic_3d(), {.solver = SolverKind::Cholesky})
                      .solve(1e10 * values),
                  SolverError);
}

TEST_CASE("centres that nearly coincide and move apart are left to the adaptive solver",
          "[core][rbf]") {
  // A flat body of nodes 3 apart that turns; two nodes 6e-5 apart, one of which moves by 0.1 more.
  const Index count = 800, twin = 400;
  RowMatrix centres(count, 3);
  const double radius = 30, golden_angle = 2.4;
  for (Index i = 0; i < count; ++i) {
    const double z = 1 - (2. * static_cast<double>(i) + 1) / count, r = std::sqrt(1 - z * z),
                 angle = golden_angle * static_cast<double>(i);
    centres.row(i) << radius * r * std::cos(angle), 0.1 * radius * r * std::sin(angle), radius * z;
  }
  centres.row(twin + 1) = centres.row(twin) + Eigen::RowVector3d(0, 0, 6e-5);
  RowMatrix values = 0.3 * centres;
  values.col(2) = values.col(0).cwiseProduct(values.col(2)) / radius;
  values(twin, 0) += 0.1;
  const Kernel kernel = Kernel::triharmonic_3d();
  try {
    RbfSystem(centres, kernel, {.solver = SolverKind::Ldlt}).solve(values);
    FAIL("a dense solver met the values");
  } catch (const SolverError& error) {  // names the two
    CHECK_THAT(error.what(), Catch::Contains("centres 400 and 401 are closest"));
  }
  const RbfSystem system(centres, kernel);
  const RbfField field = system.solve(values);
  CHECK(field.report().solver == SolverKind::Adaptive);
  CHECK(field.report().max_residual <= 1e-5);
  CHECK(largest(field.evaluate(centres) - values) < 1e-4);
  CHECK(largest(RowMatrix(system.derivative(field, centres).forward(values)) - values) < 1e-4);
  // What goes well by the dense solver still does.
  CHECK(system.solve(0.3 * centres).report().solver == SolverKind::Cholesky);
}
