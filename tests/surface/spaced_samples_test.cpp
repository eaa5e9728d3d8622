#include "surface/spaced_samples.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <random>
#include <set>

using namespace cadmorph;

namespace {

// A small body, finely sampled, in the middle of coarse walls.
struct FarField {
  FarField() {
    std::mt19937 random(5);
    std::uniform_real_distribution<double> uniform(-1, 1);
    points.resize(4000, 3);
    for (Index i = 0; i < points.rows(); ++i) {
      const bool is_body = i < 3000;
      for (int a = 0; a < 3; ++a) points(i, a) = (is_body ? 1 : 100) * uniform(random);
      points(i, i % 3) = is_body ? 1 : 100;
      spacing.push_back(is_body ? (i % 2 ? 0.1 : 0.3) : 20);
    }
  }
  RowMatrix points;
  std::vector<double> spacing;
};

}  // namespace

TEST_CASE("Samples are found within the radius of their own spacing", "[surface][samples]") {
  const FarField field;
  const SpacedSamples samples(field.points, field.spacing);
  const auto radius = [](double spacing) { return 1.3 * spacing + 0.05; };
  std::mt19937 random(7);
  std::uniform_real_distribution<double> uniform(-1.2, 1.2);
  for (int k = 0; k < 300; ++k) {
    const Eigen::Vector3d x =
        (k % 2 ? 1 : 90) * Eigen::Vector3d(uniform(random), uniform(random), uniform(random));
    std::set<Index> found;
    double last = 0;
    for (const Neighbour& near : samples.within(x, radius)) {
      const double distance = (field.points.row(near.index).transpose() - x).norm();
      REQUIRE(std::abs(std::sqrt(near.squared_distance) - distance) < 1e-9);
      REQUIRE(near.squared_distance >= last);
      REQUIRE(distance <= radius(4 * field.spacing[static_cast<std::size_t>(near.index)]));
      last = near.squared_distance;
      REQUIRE(found.insert(near.index).second);
    }
    for (Index i = 0; i < field.points.rows(); ++i)
      if ((field.points.row(i).transpose() - x).norm() <=
          radius(field.spacing[static_cast<std::size_t>(i)]))
        REQUIRE(found.contains(i));
  }
  CHECK(samples.within({0, 0, 0}, [](double) { return -1; }).empty());
}

TEST_CASE("A point of a body finds few of its samples, a point of the far field none",
          "[surface][samples]") {
  const FarField field;
  const SpacedSamples samples(field.points, field.spacing);
  const auto on_body = samples.near({1, 0.2, -0.3}, 0.01);
  REQUIRE_FALSE(on_body.empty());
  CHECK(on_body.size() < 300);  // of 3,000
  const auto on_wall = samples.near({100, 30, -20}, 0.01);
  REQUIRE_FALSE(on_wall.empty());
  for (const Neighbour& near : on_wall) CHECK(near.index >= 3000);
  CHECK(samples.near({40, 40, 500}, 0.01).empty());
  CHECK(SpacedSamples().near({0, 0, 0}, 1).empty());
}
