#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <numeric>
#include <random>

#include "core/errors.h"
#include "core/kd_tree.h"
#include "core/parallel.h"
#include "core/rbf/exact_sum.h"
#include "core/rbf/kernel_sum.h"
#include "core/rbf/pointwise_field.h"
#include "core/rbf/rbf_system.h"
#include "rbf_sets.h"

using namespace cadmorph;

namespace {

RbfField solve(const test::RbfSet& set, const Kernel& kernel, SolverKind solver) {
  return RbfSystem(set.surface, kernel, {.solver = solver}).solve(set.displacement);
}

// Largest difference over the distance of the nearest surface nodes to each other.
double largest_difference(const test::RbfSet& set, const RowMatrix& a, const RowMatrix& b) {
  const KdTree tree(set.surface);
  double largest = 0;
  for (Index i = 0; i < a.rows(); ++i) {
    const Index nearest = tree.nearest(set.volume.row(i).data(), 1).front().index;
    const double spacing =
        std::sqrt(tree.nearest(set.surface.row(nearest).data(), 2)[1].squared_distance);
    largest = std::max(largest, (a.row(i) - b.row(i)).norm() / spacing);
  }
  return largest;
}

std::vector<Index> shuffled(Index count, unsigned seed) {
  std::vector<Index> rows(static_cast<std::size_t>(count));
  std::iota(rows.begin(), rows.end(), Index{0});
  std::shuffle(rows.begin(), rows.end(), std::mt19937(seed));
  return rows;
}

Points select(const RowMatrix& from, const std::vector<Index>& rows) {
  Points result(static_cast<Index>(rows.size()), 3);
  for (Index i = 0; i < result.rows(); ++i) result.row(i) = from.row(rows[i]);
  return result;
}

// Pieces of random sizes, 1 to 700 points, from points in random order.
std::vector<std::vector<Index>> random_pieces(Index count) {
  std::mt19937 random(4);
  std::vector<std::vector<Index>> pieces;
  const std::vector<Index> rows = shuffled(count, 5);
  for (auto begin = rows.begin(); begin != rows.end();) {
    const auto size = std::min<std::ptrdiff_t>(1 + random() % 700, rows.end() - begin);
    pieces.emplace_back(begin, begin + size);
    begin += size;
  }
  return pieces;
}

void require_same_bits_in_pieces(const PointwiseField& field, const RowMatrix& points) {
  const RowMatrix whole = field.evaluate(points);
  for (const auto& piece : random_pieces(points.rows())) {
    const RowMatrix values = field.evaluate(select(points, piece));
    for (std::size_t i = 0; i < piece.size(); ++i)
      REQUIRE(values.row(static_cast<Index>(i)) == whole.row(piece[i]));
  }
  set_thread_count(1);
  const RowMatrix alone = field.evaluate(points);
  set_thread_count(0);
  REQUIRE(alone == whole);
}

}  // namespace

TEST_CASE("exact sums have the same bits for each instruction set", "[core][rbf][pointwise]") {
  std::srand(1);
  const Eigen::MatrixXd targets = Eigen::MatrixXd::Random(101, 3),
                        sources = Eigen::MatrixXd::Random(77, 3),
                        weights = Eigen::MatrixXd::Random(77, 4);
  for (const Kernel& kernel :
       {Kernel::biharmonic_3d(), Kernel::triharmonic_3d(), Kernel::quadharmonic_3d(),
        Kernel{.kind = KernelKind::Multiquadric, .shape = 2}}) {
    Eigen::MatrixXd expected = Eigen::MatrixXd::Zero(101, 4);
    for (Index i = 0; i < 101; ++i)
      for (Index j = 0; j < 77; ++j)
        expected.row(i) += kernel((targets.row(i) - sources.row(j)).norm()) * weights.row(j);
    Eigen::MatrixXd baseline = Eigen::MatrixXd::Zero(101, 4);
    ExactSum(kernel, InstructionSet::Baseline).add(targets, sources, weights, baseline);
    // Rounding of 77 terms of up to 150.
    REQUIRE((baseline - expected).cwiseAbs().maxCoeff() < 1e-11);
    for (const InstructionSet set : {InstructionSet::Avx2, InstructionSet::Avx512}) {
      Eigen::MatrixXd sums = Eigen::MatrixXd::Zero(101, 4);
      ExactSum(kernel, set).add(targets, sources, weights, sums);
      REQUIRE(sums == baseline);
    }
  }
}

TEST_CASE("a field by points is the field", "[core][rbf][pointwise]") {
  const test::RbfSet set = test::turning_hole(1200, 1500);
  const auto difference = [&](const Kernel& kernel, SolverKind solver) {
    const RbfField field = solve(set, kernel, solver);
    return largest_difference(set, field.evaluate(set.volume),
                              PointwiseField(field.terms()).evaluate(set.volume));
  };
  // Rounding of direct sums with large weights of both signs.
  REQUIRE(difference(Kernel::triharmonic_3d(), SolverKind::Cholesky) < 1e-9);
  REQUIRE(difference(Kernel::biharmonic_3d(), SolverKind::Ldlt) < 1e-9);
  REQUIRE(difference(Kernel::triharmonic_3d(), SolverKind::Fast) < 1e-9);
  const double spacing = 0.05;
  const Kernel multiquadric{.kind = KernelKind::Multiquadric, .shape = 1 / spacing};
  REQUIRE(difference(multiquadric, SolverKind::Ldlt) < 1e-9);
}

TEST_CASE("a field by points has the same bits in any company", "[core][rbf][pointwise]") {
  const test::RbfSet set = test::turning_hole(1200, 4000);
  require_same_bits_in_pieces(
      PointwiseField(solve(set, Kernel::triharmonic_3d(), SolverKind::Cholesky).terms()),
      set.volume);
}

TEST_CASE("a field of many centres by points", "[core][rbf][pointwise]") {
  const test::RbfSet set = test::turning_hole(13000, 8000);
  const RbfField field = solve(set, Kernel::triharmonic_3d(), SolverKind::Fast);
  const PointwiseField pointwise(field.terms());
  REQUIRE(!pointwise.terms().tree.nodes.empty());
  // The far field's share of the solver's tolerance, 1e-5 local lengths.
  REQUIRE(largest_difference(set, field.evaluate(set.volume), pointwise.evaluate(set.volume)) <
          1e-5);
  require_same_bits_in_pieces(pointwise, set.volume);
}

TEST_CASE("a field with a correction by points", "[core][rbf][pointwise]") {
  test::RbfSet set = test::turning_hole(3000, 3000);
  // A second sheet of centres closer than the fast solver keeps.
  const Index n = set.surface.rows();
  set.surface.conservativeResize(n + 50, 3);
  set.displacement.conservativeResize(n + 50, 3);
  for (Index i = 0; i < 50; ++i) {
    set.surface.row(n + i) = set.surface.row(i) + 2e-6 * RowMatrix::Ones(1, 3).row(0);
    set.displacement.row(n + i) = set.displacement.row(i) * 1.00001;
  }
  const RbfField field = solve(set, Kernel::triharmonic_3d(), SolverKind::Fast);
  const PointwiseField pointwise(field.terms());
  REQUIRE(!pointwise.terms().correction.empty());
  const Points near = set.surface.bottomRows(100);
  const auto difference = [&](const FieldTerms& terms) {
    return (field.evaluate(near) - PointwiseField(terms).evaluate(near)).cwiseAbs().maxCoeff();
  };
  FieldTerms terms = field.terms();
  REQUIRE(difference(terms) < 1e-10);  // rounding
  terms.correction.clear();
  REQUIRE(difference(terms) > 1e-8);
  require_same_bits_in_pieces(pointwise, set.volume);
}

TEST_CASE("terms are given for fields in space alone", "[core][rbf][pointwise]") {
  const RowMatrix plane = RowMatrix::Random(20, 2);
  REQUIRE_THROWS_AS(RbfSystem(plane, Kernel::biharmonic_2d()).solve(plane).terms(),
                    InvalidInputError);
}
