#include "core/kd_tree.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>

#include "core/errors.h"

using namespace cadmorph;

namespace {

// All points by distance, then by index.
std::vector<Neighbour> brute_force(const RowMatrix& points, const Eigen::RowVectorXd& query) {
  std::vector<Neighbour> all;
  for (Index i = 0; i < points.rows(); ++i)
    all.push_back({i, (points.row(i) - query).squaredNorm()});
  std::stable_sort(all.begin(), all.end(), [](const Neighbour& a, const Neighbour& b) {
    return a.squared_distance < b.squared_distance;
  });
  return all;
}

void require_equal(const std::vector<Neighbour>& found, const std::vector<Neighbour>& expected) {
  REQUIRE(found.size() == expected.size());
  for (std::size_t i = 0; i < found.size(); ++i) REQUIRE(found[i].index == expected[i].index);
}

}  // namespace

TEST_CASE("nearest finds what brute force finds, in every dimension", "[core][kd_tree]") {
  srand(1);
  for (const int dimension : {1, 2, 3, 4}) {
    const RowMatrix points = RowMatrix::Random(500, dimension);
    const KdTree tree(points);
    REQUIRE(tree.size() == 500);
    for (int trial = 0; trial < 20; ++trial) {
      const Eigen::RowVectorXd query = Eigen::RowVectorXd::Random(dimension);
      auto expected = brute_force(points, query);
      expected.resize(7);
      require_equal(tree.nearest(query.data(), 7), expected);
    }
  }
}

TEST_CASE("equal distances come in the order of their index", "[core][kd_tree]") {
  RowMatrix points(400, 2);
  for (Index i = 0; i < 400; ++i)
    points.row(i) << static_cast<double>(i % 4 / 2), static_cast<double>(i % 2);
  const KdTree tree(points);
  const Eigen::RowVector2d middle(0.5, 0.5);
  const auto found = tree.nearest(middle.data(), 9);
  REQUIRE(found.size() == 9);
  for (Index i = 0; i < 9; ++i) REQUIRE(found[i].index == i);
}

TEST_CASE("within finds all points of the closed ball", "[core][kd_tree]") {
  srand(2);
  const RowMatrix points = RowMatrix::Random(1000, 3);
  const KdTree tree(points);
  const Eigen::RowVector3d query(0.1, -0.2, 0.3);
  auto expected = brute_force(points, query);
  const double radius = std::sqrt(expected[42].squared_distance) * (1 + 1e-15);
  expected.resize(43);
  require_equal(tree.within(query.data(), radius), expected);
  REQUIRE(tree.within(query.data(), -1).empty());
}

TEST_CASE("more neighbours than points gives all points", "[core][kd_tree]") {
  const KdTree tree(RowMatrix::Random(5, 3));
  const Eigen::RowVector3d query(0, 0, 0);
  REQUIRE(tree.nearest(query.data(), 9).size() == 5);
  REQUIRE(tree.nearest(query.data(), 0).empty());
}

TEST_CASE("nearest distances are those to the nearest other point", "[core][kd_tree]") {
  srand(3);
  const RowMatrix points = RowMatrix::Random(300, 3);
  const Eigen::VectorXd found = nearest_distances(points);
  for (Index i = 0; i < 300; ++i)
    REQUIRE(
        found(i) ==
        Approx(std::sqrt(brute_force(points, points.row(i))[1].squared_distance)).epsilon(1e-14));
  REQUIRE_THROWS_AS(nearest_distances(points.topRows(1)), InvalidInputError);
}

TEST_CASE("empty and non-finite sets are refused", "[core][kd_tree]") {
  REQUIRE_THROWS_AS(KdTree(RowMatrix(0, 3)), InvalidInputError);
  RowMatrix points = RowMatrix::Random(4, 3);
  points(2, 1) = NAN;
  REQUIRE_THROWS_AS(KdTree(points), InvalidInputError);
}
