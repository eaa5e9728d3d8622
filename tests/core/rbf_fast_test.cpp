#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>

#include "core/errors.h"
#include "core/kd_tree.h"
#include "core/parallel.h"
#include "core/rbf/rbf_system.h"
#include "rbf_sets.h"

using namespace cadmorph;

namespace {

RbfOptions fast() { return {.solver = SolverKind::Fast}; }

RbfOptions dense() { return {.solver = SolverKind::Cholesky}; }

// Differences at volume points over the local edge: the spacing of the nearest surface node or the
// distance to it, whichever is larger.
std::vector<double> in_local_edges(const test::RbfSet& set, const RowMatrix& a,
                                   const RowMatrix& b) {
  const KdTree tree(set.surface);
  std::vector<double> result;
  for (Index i = 0; i < set.volume.rows(); ++i) {
    const Neighbour nearest = tree.nearest(set.volume.row(i).data(), 1).front();
    const double spacing =
        tree.nearest(set.surface.row(nearest.index).data(), 2)[1].squared_distance;
    const double edge = std::sqrt(std::max(spacing, nearest.squared_distance));
    result.push_back((a.row(i) - b.row(i)).norm() / edge);
  }
  std::sort(result.begin(), result.end());
  return result;
}

}  // namespace

TEST_CASE("the fast solver agrees with the dense one", "[core][rbf][fast]") {
  for (const test::RbfSet& set :
       {test::turning_hole(2000, 3000), test::sphere_in_box(2000, 3000)}) {
    INFO(set.name);
    const RbfField a =
        RbfSystem(set.surface, Kernel::triharmonic_3d(), dense()).solve(set.displacement);
    const RbfField b =
        RbfSystem(set.surface, Kernel::triharmonic_3d(), fast()).solve(set.displacement);
    REQUIRE(b.report().solver == SolverKind::Fast);
    REQUIRE(b.report().max_residual <= 1e-5);
    REQUIRE(b.report().iterations <= 12);
    const auto difference = in_local_edges(set, a.evaluate(set.volume), b.evaluate(set.volume));
    REQUIRE(difference.back() < 1e-4);
    REQUIRE(difference[difference.size() * 99 / 100] < 1e-5);
  }
}

TEST_CASE("trees resolve layers of 1e-5 of an edge as direct sums do", "[core][rbf][fast]") {
  const test::RbfSet set = test::turning_hole(13000, 3000);
  const RbfField field =
      RbfSystem(set.surface, Kernel::triharmonic_3d(), fast()).solve(set.displacement);
  // Nodes of the first layer above nodes of the hole, and points all over the volume.
  const double edge = 0.03, layer = 1e-5 * edge;
  RowMatrix targets(6000, 3);
  targets << set.surface.bottomRows(3000), set.volume;
  for (Index i = 0; i < 3000; ++i)
    targets.row(i).head<2>() *= 1 + layer / targets.row(i).head<2>().norm();
  const RowMatrix through_trees = field.evaluate(targets);
  RowMatrix directly(6000, 3);  // few targets at a time are summed directly
  for (Index i = 0; i < 6000; i += 1500)
    directly.middleRows(i, 1500) = field.evaluate(targets.middleRows(i, 1500));
  REQUIRE((through_trees - directly).cwiseAbs().maxCoeff() < 1e-3 * layer);
  REQUIRE((through_trees - directly).cwiseAbs().maxCoeff() > 0);
}

TEST_CASE("a graded wing is solved at all its nodes", "[core][rbf][fast]") {
  const test::RbfSet set = test::graded_wing(4000, 1000);
  const RbfField field =
      RbfSystem(set.surface, Kernel::triharmonic_3d(), fast()).solve(set.displacement);
  REQUIRE(field.report().solver == SolverKind::Fast);
  REQUIRE(field.report().iterations <= 25);
  REQUIRE(field.report().max_residual <= 1e-5);
  const KdTree tree(set.surface);
  const RowMatrix found = field.evaluate(set.surface);
  for (Index i = 0; i < set.surface.rows(); ++i) {
    const double spacing =
        std::sqrt(tree.nearest(set.surface.row(i).data(), 2)[1].squared_distance);
    // The tolerance, and rounding of the sums.
    REQUIRE((found.row(i) - set.displacement.row(i)).norm() < 1e-5 * spacing + 2e-9);
  }
}

TEST_CASE("thin sheets converge, with nodes matched or not", "[core][rbf][fast]") {
  struct Expected {
    double gap;
    int iterations;
  };
  for (const test::SheetShape shape : {test::SheetShape::Plate, test::SheetShape::Tube})
    for (const bool is_matched : {true, false})
      for (const Expected& expected : {Expected{0.2, 12}, Expected{0.05, 12}, Expected{0.02, 25}}) {
        const test::RbfSet set = test::thin_sheets(shape, 4000, expected.gap, is_matched);
        const RbfField field =
            RbfSystem(set.surface, Kernel::triharmonic_3d(), fast()).solve(set.displacement);
        INFO(set.name << " gap " << expected.gap);
        CHECK(field.report().solver == SolverKind::Fast);
        CHECK(field.report().iterations <= expected.iterations);
        REQUIRE(field.report().max_residual <= 1e-5);
      }
}

TEST_CASE(
    "where walls are so thin that the far field misses sums, the residual told is the true one",
    "[core][rbf][fast]") {
  const test::RbfSet set = test::thin_sheets(test::SheetShape::Tube, 13000, 0.005, true);
  const RbfField field =
      RbfSystem(set.surface, Kernel::triharmonic_3d(), fast()).solve(set.displacement);
  REQUIRE(field.report().solver == SolverKind::Fast);
  CHECK_THAT(field.report().reason, Catch::Matchers::Contains("direct sums"));
  CHECK(field.report().iterations <= 15);
  const Eigen::VectorXd spacing = nearest_distances(set.surface);
  double worst = 0;
  constexpr Index kFew = 1000;  // so few targets are summed directly
  for (Index first = 0; first < set.surface.rows(); first += kFew) {
    const Index count = std::min(kFew, set.surface.rows() - first);
    const RowMatrix missed = field.evaluate(set.surface.middleRows(first, count)) -
                             set.displacement.middleRows(first, count);
    for (Index i = 0; i < count; ++i)
      worst = std::max(worst, missed.row(i).norm() / spacing(first + i));
  }
  CHECK(worst <= 1e-5);
  // Up to what the far field misses of the last small steps.
  CHECK(field.report().max_residual == Approx(worst).margin(2e-6));
}

TEST_CASE("centres that nearly coincide and move apart are solved to the rounding of the sums",
          "[core][rbf][fast]") {
  const test::RbfSet set = test::turning_hole(2500, 10);
  const Index sound = set.surface.rows(), twins = 12;
  const double diagonal =
      (set.surface.colwise().maxCoeff() - set.surface.colwise().minCoeff()).norm();
  const double apart = 3e-5 * diagonal;  // just too far for the correction
  RowMatrix centres(sound + twins, 3), values(sound + twins, 3);
  centres.topRows(sound) = set.surface;
  values.topRows(sound) = set.displacement;
  for (Index i = 0; i < twins; ++i) {
    const Index of = i * sound / twins;
    centres.row(sound + i) = centres.row(of) + apart * Eigen::RowVector3d(0.6, 0, 0.8);
    values.row(sound + i) = values.row(of) + 100 * apart * Eigen::RowVector3d(0, 1, 0);
  }
  const RbfField field =
      RbfSystem(centres, Kernel::triharmonic_3d(), {.solver = SolverKind::Fast}).solve(values);
  REQUIRE(field.report().solver == SolverKind::Fast);
  CHECK_THAT(field.report().reason, Catch::Matchers::Contains("rounding"));
  const RowMatrix missed = field.evaluate(centres) - values;
  // A thousandth of the pairs' distance, 3e-8 of the size.
  CHECK(missed.rowwise().norm().maxCoeff() < 1e-3 * apart);
  CHECK(field.report().max_residual ==
        Approx((missed.rowwise().norm().array() / nearest_distances(centres).array()).maxCoeff())
            .epsilon(0.5));
}

TEST_CASE("hopeless gaps are solved or handed on with the reason, never silently wrong",
          "[core][rbf][fast]") {
  const test::RbfSet set = test::thin_sheets(test::SheetShape::Plate, 1500, 0.0005, false);
  const RbfField field =
      RbfSystem(set.surface, Kernel::triharmonic_3d(), fast()).solve(set.displacement);
  const KdTree tree(set.surface);
  const RowMatrix found = field.evaluate(set.surface);
  double worst = 0;
  for (Index i = 0; i < set.surface.rows(); ++i)
    worst = std::max(worst,
                     (found.row(i) - set.displacement.row(i)).norm() /
                         std::sqrt(tree.nearest(set.surface.row(i).data(), 2)[1].squared_distance));
  REQUIRE(worst < 1e-3);
  REQUIRE_FALSE(field.report().reason.empty());
}

TEST_CASE("tolerances below rounding are served as far as rounding goes", "[core][rbf][fast]") {
  srand(1);
  const RowMatrix x = RowMatrix::Random(500, 3), values = RowMatrix::Random(500, 3);
  RbfOptions options = fast();
  options.tolerance = 1e-30;
  const RbfField field = RbfSystem(x, Kernel::triharmonic_3d(), options).solve(values);
  REQUIRE(field.report().solver == SolverKind::Fast);
  REQUIRE((field.evaluate(x) - values).cwiseAbs().maxCoeff() < 3e-9);
}

TEST_CASE("too little memory is an error that says how much is needed", "[core][rbf][fast]") {
  srand(3);
  RbfOptions options = fast();
  options.memory_limit = 1e6;
  const RowMatrix x = RowMatrix::Random(500, 3);
  REQUIRE_THROWS_AS(RbfSystem(x, Kernel::triharmonic_3d(), options), SolverError);
}

TEST_CASE("a plane full of centres is solved", "[core][rbf][fast]") {
  srand(2);
  RowMatrix x = RowMatrix::Random(800, 3);
  x.col(2).setZero();
  const RowMatrix values = (3 * x).array().sin();
  const RbfSystem system(x, Kernel::triharmonic_3d(), fast());
  CHECK(system.report().polynomial_terms == 3);
  const RbfField field = system.solve(values);
  REQUIRE(field.report().solver == SolverKind::Fast);
  REQUIRE((field.evaluate(x) - values).cwiseAbs().maxCoeff() < 1e-5);
}

TEST_CASE("duplicates are merged before the fast solver sees them", "[core][rbf][fast]") {
  const test::RbfSet set = test::sphere_in_box(600, 0);
  RowMatrix x(set.surface.rows() + 50, 3), values(x.rows(), 3);
  x << set.surface, set.surface.topRows(50);
  values << set.displacement, set.displacement.topRows(50);
  const RbfField field = RbfSystem(x, Kernel::triharmonic_3d(), fast()).solve(values);
  REQUIRE(field.report().merged == 50);
  REQUIRE(field.report().max_residual <= 1e-5);
}

TEST_CASE("value sets solved together equal those solved alone to the last bit",
          "[core][rbf][fast]") {
  // Direct sums; trees; points left to the correction.
  for (const test::RbfSet& set : {test::turning_hole(1500, 2500), test::turning_hole(12500, 2500),
                                  test::graded_wing(3000, 2500)}) {
    INFO(set.name << " " << set.surface.rows());
    const RbfSystem system(set.surface, Kernel::triharmonic_3d(), fast());
    const RbfTargets targets(system, set.volume);
    // Sets that take different numbers of iterations, one of them none at all.
    std::vector<RowMatrix> sets = {set.displacement, 1e-4 * set.displacement,
                                   RowMatrix::Zero(set.surface.rows(), 3),
                                   (40 * set.surface).array().sin()};
    std::vector<RbfField> together;
    for (RbfSolution& solution : system.solve_each(sets)) {
      REQUIRE_FALSE(solution.error);
      together.push_back(std::move(solution.field));
    }
    const std::vector<RowMatrix> values = targets.evaluate(together);
    for (std::size_t s = 0; s < sets.size(); ++s) {
      const RbfField alone = system.solve(sets[s]);
      REQUIRE(alone.report().iterations == together[s].report().iterations);
      REQUIRE(alone.evaluate(set.volume) == values[s]);
      // Few targets are summed directly.
      REQUIRE(alone.evaluate(set.volume.topRows(100)) ==
              together[s].evaluate(set.volume.topRows(100)));
    }
    REQUIRE(together[1].report().iterations < together[3].report().iterations);
  }
}

TEST_CASE("an unsound value set leaves the others of its block alone", "[core][rbf][fast]") {
  for (const SolverKind solver : {SolverKind::Fast, SolverKind::Cholesky}) {
    const test::RbfSet set = test::sphere_in_box(800, 50);
    const RbfSystem system(set.surface, Kernel::triharmonic_3d(), {.solver = solver});
    RowMatrix bad = set.displacement;
    bad(17, 1) = NAN;
    const std::vector<RbfSolution> solutions =
        system.solve_each({bad, set.displacement, set.displacement.topRows(5)});
    REQUIRE_THROWS_AS(std::rethrow_exception(solutions[0].error), InvalidInputError);
    REQUIRE_THROWS_AS(std::rethrow_exception(solutions[2].error), InvalidInputError);
    REQUIRE_FALSE(solutions[1].error);
    REQUIRE(solutions[1].field.evaluate(set.volume) ==
            system.solve(set.displacement).evaluate(set.volume));
  }
}

TEST_CASE("the fast solver's result does not depend on the number of threads",
          "[core][rbf][fast]") {
  const test::RbfSet set = test::graded_wing(2500, 500);
  const auto run = [&](int threads) {
    set_thread_count(threads);
    return RbfSystem(set.surface, Kernel::triharmonic_3d(), fast())
        .solve(set.displacement)
        .evaluate(set.volume);
  };
  const RowMatrix one = run(1), three = run(3);
  set_thread_count(0);
  REQUIRE(one == three);
}

TEST_CASE("the residual reported is the true one in local lengths", "[core][rbf][fast]") {
  const test::RbfSet set = test::sphere_in_box(1500, 0);
  RbfOptions options = fast();
  options.local_length = Eigen::VectorXd::Constant(set.surface.rows(), 0.05);
  options.local_length.tail(100).setConstant(1e-8);  // less than rounding allows
  const RbfField field =
      RbfSystem(set.surface, Kernel::triharmonic_3d(), options).solve(set.displacement);
  const RowMatrix missed = field.evaluate(set.surface) - set.displacement;
  const double worst = (missed.rowwise().norm().array() / options.local_length.array()).maxCoeff();
  REQUIRE(worst > 1e-5);
  REQUIRE(field.report().max_residual == Approx(worst).epsilon(0.1));
}

TEST_CASE("given local lengths tighten the residual where they are short", "[core][rbf][fast]") {
  const test::RbfSet set = test::sphere_in_box(1500, 0);
  RbfOptions options = fast();
  options.local_length = Eigen::VectorXd::Constant(set.surface.rows(), 0.05);
  options.local_length.tail(100).setConstant(1e-4);
  const RbfField field =
      RbfSystem(set.surface, Kernel::triharmonic_3d(), options).solve(set.displacement);
  const RowMatrix missed = field.evaluate(set.surface) - set.displacement;
  REQUIRE(missed.rowwise().norm().maxCoeff() < 1e-5 * 0.05);
  REQUIRE(missed.bottomRows(100).rowwise().norm().maxCoeff() < 1e-5 * 1e-4 + 1e-12);
}
