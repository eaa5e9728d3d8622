#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>

#include "core/errors.h"
#include "core/kd_tree.h"
#include "core/parallel.h"
#include "core/rbf/adaptive_solver.h"
#include "core/rbf/compact_sum.h"
#include "core/rbf/compact_system.h"
#include "core/rbf/point_order.h"
#include "core/rbf/pointwise_field.h"
#include "core/rbf/rbf_system.h"
#include "rbf_sets.h"

using namespace cadmorph;
using Eigen::MatrixXd;
using simd::InstructionSet;

namespace {

const Kernel kTriharmonic = Kernel::triharmonic_3d();

RbfSystem adaptive(const RowMatrix& centres) {
  return RbfSystem(centres, kTriharmonic, {.solver = SolverKind::Adaptive});
}

double wendland_c2(double r) { return r < 1 ? std::pow(1 - r, 4) * (4 * r + 1) : 0; }

// The values of a set, and others that ask for other centres.
std::vector<RowMatrix> three_motions(const test::RbfSet& set) {
  RowMatrix bump = RowMatrix::Zero(set.surface.rows(), 3);
  const Eigen::RowVectorXd top = set.surface.row(0);
  for (Index i = 0; i < bump.rows(); ++i)
    bump(i, 2) = 0.1 * std::exp(-50 * (set.surface.row(i) - top).squaredNorm());
  return {set.displacement, bump, -0.3 * set.displacement};
}

}  // namespace

TEST_CASE("compact sums are those over all pairs, the same bits on every processor",
          "[core][rbf][adaptive]") {
  srand(7);
  const Points points = Points::Random(700, 3);
  const MatrixXd coefficients = MatrixXd::Random(700, 4), targets = 1.2 * MatrixXd::Random(501, 3);
  for (const double support : {0.05, 0.4, 5.0}) {
    MatrixXd expected = MatrixXd::Zero(501, 4);
    for (Index i = 0; i < 501; ++i)
      for (Index j = 0; j < 700; ++j)
        expected.row(i) +=
            wendland_c2((targets.row(i) - points.row(j)).norm() / support) * coefficients.row(j);
    const CompactSum sum(points, support, InstructionSet::Baseline);
    const MatrixXd found = sum(targets, coefficients);
    REQUIRE((found - expected).cwiseAbs().maxCoeff() < 1e-12);  // rounding of 700 terms
    for (const InstructionSet set : {InstructionSet::Avx2, InstructionSet::Avx512})
      REQUIRE(CompactSum(points, support, set)(targets, coefficients) == found);
    // Alone and in another company.
    for (const Index i : {0, 17, 500}) REQUIRE(sum(targets.row(i), coefficients) == found.row(i));
    REQUIRE(CompactMatrix(sum) * coefficients == sum(points, coefficients));
  }
}

TEST_CASE("interpolation by compact functions takes few iterations", "[core][rbf][adaptive]") {
  const test::RbfSet set = test::graded_wing(6000, 0);
  const PointOrder order = farthest_point_order(set.surface);
  const Points points = set.surface(order.rows, Eigen::all);
  const double support = 4 * order.separation.back();
  const CompactSystem system(points, support);
  const MatrixXd values = set.displacement(order.rows, Eigen::all);
  const double largest = values.rowwise().norm().maxCoeff();
  for (const auto& [part, most] : {std::pair(1e-5, 15), std::pair(1e-13, 45)}) {
    const CgResult solved =
        system.solve(values, Eigen::VectorXd::Constant(points.rows(), part * largest));
    CHECK(solved.has_converged());
    CHECK(solved.iterations <= most);
    // Rounding of the sums.
    const MatrixXd missed = values - system.sum()(points, solved.weights);
    CHECK(missed.rowwise().norm().maxCoeff() <= (part + 1e-12) * largest);
  }
}

TEST_CASE("with full stencils the factor of compact functions is the inverse",
          "[core][rbf][adaptive]") {
  srand(8);
  const Points points = Points::Random(150, 3);
  const Points ordered = points(farthest_point_order(points).rows, Eigen::all);
  const MatrixXd weights = MatrixXd::Random(150, 3);
  const double support = 4;  // which all points are within
  const auto factor = SparseInverseCholesky::of_compact(ordered, support, 150);
  const MatrixXd image = CompactSum(ordered, support)(ordered, weights);
  REQUIRE((factor.apply(image) - weights).cwiseAbs().maxCoeff() < 1e-8);
}

TEST_CASE("the adaptive solver meets all values with few centres", "[core][rbf][adaptive]") {
  for (const test::RbfSet& set :
       {test::turning_hole(6000, 10), test::sphere_in_box(6000, 10), test::graded_wing(6000, 10),
        test::thin_sheets(test::SheetShape::Plate, 6000, 0.05, false)}) {
    INFO(set.name);
    const RbfField field = adaptive(set.surface).solve(set.displacement);
    CHECK(field.report().solver == SolverKind::Adaptive);
    CHECK(field.report().iterations < 3000);
    CHECK(field.report().max_residual <= 1e-5);
    const RowMatrix missed = field.evaluate(set.surface) - set.displacement;
    const Eigen::VectorXd nearest = nearest_distances(set.surface);
    // The tolerance, and rounding of the sums.
    for (Index i = 0; i < missed.rows(); ++i)
      REQUIRE(missed.row(i).norm() < 1e-5 * nearest(i) + 3e-9);
  }
}

TEST_CASE("the adaptive field is near that of all centres", "[core][rbf][adaptive]") {
  for (const test::RbfSet& set :
       {test::turning_hole(3000, 3000), test::sphere_in_box(3000, 3000)}) {
    INFO(set.name);
    const RowMatrix all = RbfSystem(set.surface, kTriharmonic, {.solver = SolverKind::Cholesky})
                              .solve(set.displacement)
                              .evaluate(set.volume);
    const RowMatrix few = adaptive(set.surface).solve(set.displacement).evaluate(set.volume);
    // What the centres alone may miss: 0.3 of the spacing of the surface.
    const double spacing = nearest_distances(set.surface).maxCoeff();
    REQUIRE((all - few).rowwise().norm().maxCoeff() < 0.3 * spacing);
    REQUIRE((all - few).rowwise().norm().maxCoeff() > 1e-6 * spacing);
  }
}

TEST_CASE("the adaptive solver reproduces affine motions", "[core][rbf][adaptive]") {
  const test::RbfSet set = test::turning_hole(3000, 500);
  Eigen::Matrix3d A;
  A << 0.3, -0.2, 0.1, 0.05, 0.4, -0.3, 0.2, 0.1, -0.25;
  const auto affine = [&](const RowMatrix& x) {
    return RowMatrix((x * A).rowwise() + Eigen::RowVector3d(3, -2, 1));
  };
  const RbfField field = adaptive(set.surface).solve(affine(set.surface));
  REQUIRE((field.evaluate(set.volume) - affine(set.volume)).cwiseAbs().maxCoeff() < 1e-12);
  REQUIRE(field.terms().correction.empty());
}

TEST_CASE("with its centres fixed the adaptive solver is linear", "[core][rbf][adaptive]") {
  const test::RbfSet set = test::turning_hole(3000, 10);
  const MatrixXd points = set.surface;
  const Eigen::VectorXd nearest = nearest_distances(set.surface);
  const AdaptiveSolver solver(points, nearest, {.tolerance = 1e-7});
  const std::vector<RowMatrix> motions = three_motions(set);
  const MatrixXd a = motions[0], b = motions[1];
  const std::vector<Index> centres = solver.solve(a).centres;
  const auto at_volume = [&](const MatrixXd& values) {
    const AdaptiveSolution solution = solver.solve(values, centres);
    REQUIRE(solution.field);
    REQUIRE(solution.centres == centres);
    FieldTerms terms;
    terms.kernel = kTriharmonic;
    describe(*solution.field, terms);
    return MatrixXd(PointwiseField(std::move(terms)).evaluate(set.volume));
  };
  const MatrixXd combined = 0.7 * a - 1.9 * b;
  const MatrixXd difference = at_volume(combined) - (0.7 * at_volume(a) - 1.9 * at_volume(b));
  // The levels are solved to the tolerance; their coefficients reach a few supports.
  REQUIRE(difference.cwiseAbs().maxCoeff() < 1e-5 * nearest.minCoeff());
}

TEST_CASE("centres go where the values need them", "[core][rbf][adaptive]") {
  const test::RbfSet set = test::sphere_in_box(8000, 10);
  const RowMatrix bump = three_motions(set)[1];
  const AdaptiveSolver solver(set.surface, nearest_distances(set.surface));
  const std::vector<Index> none = solver.solve(RowMatrix::Zero(bump.rows(), 3)).centres;
  const std::vector<Index> centres = solver.solve(10 * bump).centres;
  REQUIRE(centres.size() > none.size());
  const auto is_near = [&](Index row) {
    return (set.surface.row(row) - set.surface.row(0)).norm() < 0.6;
  };
  REQUIRE(std::equal(none.begin(), none.end(), centres.begin()));
  const auto added = centres.begin() + static_cast<Index>(none.size());
  REQUIRE(std::count_if(added, centres.end(), is_near) > 0.8 * std::distance(added, centres.end()));
}

TEST_CASE("an adaptive field is the same on any number of threads and in any company",
          "[core][rbf][adaptive]") {
  const test::RbfSet set = test::turning_hole(4000, 3000);
  const std::vector<RowMatrix> motions = three_motions(set);
  set_thread_count(1);
  std::vector<RowMatrix> alone;
  for (const RowMatrix& motion : motions)
    alone.push_back(adaptive(set.surface).solve(motion).evaluate(set.volume));
  set_thread_count(5);
  const RbfSystem system = adaptive(set.surface);
  const RbfTargets targets(system, set.volume);
  for (const std::vector<int>& block : {std::vector{0, 1, 2}, {2, 0}, {1}}) {
    std::vector<RowMatrix> values;
    for (const int i : block) values.push_back(motions[i]);
    std::vector<RbfField> fields;
    for (RbfSolution& solution : system.solve_each(values)) {
      REQUIRE_FALSE(solution.error);
      fields.push_back(std::move(solution.field));
    }
    const std::vector<RowMatrix> together = targets.evaluate(fields);
    for (std::size_t k = 0; k < block.size(); ++k) REQUIRE(together[k] == alone[block[k]]);
  }
  set_thread_count(0);
}

TEST_CASE("an adaptive field by points is the field", "[core][rbf][adaptive][pointwise]") {
  const test::RbfSet set = test::turning_hole(4000, 3000);
  const RbfField field = adaptive(set.surface).solve(set.displacement);
  const PointwiseField pointwise(field.terms());
  REQUIRE_FALSE(pointwise.terms().correction.empty());
  const RowMatrix values = pointwise.evaluate(set.volume);
  // Rounding of direct sums with large weights of both signs.
  REQUIRE((values - field.evaluate(set.volume)).cwiseAbs().maxCoeff() < 1e-9);
  REQUIRE(pointwise.evaluate(set.volume.middleRows(77, 5)) == values.middleRows(77, 5));
}

TEST_CASE("the adaptive solver is the default for many centres of r^3 alone",
          "[core][rbf][adaptive]") {
  srand(3);
  const RowMatrix many = RowMatrix::Random(2500, 3), few = many.topRows(50);
  CHECK(RbfSystem(many, kTriharmonic).report().solver == SolverKind::Adaptive);
  CHECK(adaptive(few).report().solver == SolverKind::Cholesky);
  CHECK_THROWS_AS(RbfSystem(many, Kernel::biharmonic_3d(), {.solver = SolverKind::Adaptive}),
                  InvalidInputError);
  CHECK_THROWS_AS(
      RbfSystem(many.leftCols(2), Kernel::biharmonic_2d(), {.solver = SolverKind::Adaptive}),
      InvalidInputError);
}
