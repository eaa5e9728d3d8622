#include "cad/entity_motion.h"

#include <Eigen/Dense>
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <random>

using namespace cadmorph;
using Eigen::AngleAxisd;
using Eigen::Matrix3d;
using Eigen::Vector3d;

namespace {

constexpr double kExact = 1e-10;  // of places some tens large: rounding

std::vector<Vector3d> random_points(int count, double size = 10) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> unit(-size, size);
  std::vector<Vector3d> points;
  for (int i = 0; i < count; ++i) {
    const double x = unit(random), y = unit(random), z = unit(random);
    points.emplace_back(x, y, z);
  }
  return points;
}

/// All points of whole coordinates up to `reach` in each direction, up to `height` in the third.
std::vector<Vector3d> grid(int reach, int height) {
  std::vector<Vector3d> points;
  for (int x = -reach; x <= reach; ++x)
    for (int y = -reach; y <= reach; ++y)
      for (int z = -height; z <= height; ++z) points.emplace_back(x, y, z);
  return points;
}

int index_of(const std::vector<Vector3d>& points, const Vector3d& x) {
  return static_cast<int>(std::ranges::find(points, x) - points.begin());
}

/// Shear, unequal scales, a shift.
Vector3d affine(const Vector3d& x) {
  Matrix3d linear;
  linear << 1.3, 0.4, -0.2, 0.1, 0.8, 0.3, -0.5, 0.2, 1.1;
  return linear * x + Vector3d(7, -3, 2);
}

Matrix3d linear_part(const RoughMotion& motion) {
  Matrix3d linear;
  for (int a = 0; a < 3; ++a) linear.col(a) = motion(Vector3d::Unit(a)) - motion(Vector3d::Zero());
  return linear;
}

std::vector<Vector3d> images(const std::vector<Vector3d>& points, const RoughMotion& motion) {
  std::vector<Vector3d> moved;
  for (const Vector3d& x : points) moved.push_back(motion(x));
  return moved;
}

Vector3d stay(const Vector3d& x) { return x; }

Similarity a_similarity() {
  Similarity s;
  s.scale = 0.7;
  s.rotation = AngleAxisd(2.1, Vector3d(2, -1, 3).normalized()).toRotationMatrix();
  s.translation = Vector3d(-20, 5, 9);
  return s;
}

}  // namespace

TEST_CASE("an affine fit follows its points, by the closed form of what its prior leaves",
          "[cad][motion]") {
  // The scatter of these points is the same in all directions, a third of its trace: then the fit
  // is the mean of the map and the prior with weights 1 and 3e-6.
  const std::vector<Vector3d> points = grid(2, 2);
  const Similarity prior = a_similarity();
  const Matrix3d expected =
      (linear_part(affine) + 3e-6 * prior.scale * prior.rotation) / (1 + 3e-6);
  const RoughMotion motion = fit_affine(points, images(points, affine), prior);
  CHECK((linear_part(motion) - expected).norm() < kExact);
  CHECK((motion(Vector3d::Zero()) - affine(Vector3d::Zero())).norm() < kExact);
}

TEST_CASE("what points leave open an affine fit takes from its prior", "[cad][motion]") {
  const Similarity prior = a_similarity();
  const auto places = random_points(12);
  // Its own map it gives back, whatever the points span.
  for (const int dimensions : {1, 2, 3}) {
    INFO(dimensions);
    std::vector<Vector3d> points = places;
    for (Vector3d& x : points) x.tail(3 - dimensions).setZero();
    const RoughMotion motion =
        fit_affine(points, images(points, [&](const Vector3d& x) { return prior(x); }), prior);
    for (const Vector3d& x : places) CHECK((motion(x) - prior(x)).norm() < kExact);
  }
  // Of points in a plane it alone tells about the normal.
  std::vector<Vector3d> flat = places;
  for (Vector3d& x : flat) x.z() = 0;
  const Matrix3d linear = linear_part(fit_affine(flat, images(flat, affine), prior));
  CHECK((linear.col(2) - prior.scale * prior.rotation.col(2)).norm() < kExact);
  CHECK((linear - linear_part(affine)).leftCols<2>().norm() < 1e-4);
  // One point, or none.
  for (const std::size_t count : {0, 1}) {
    const std::vector<Vector3d> few(places.begin(), places.begin() + std::ptrdiff_t(count));
    const RoughMotion motion = fit_affine(few, images(few, affine), prior);
    CHECK((motion(places[5]) - prior(places[5])).norm() < kExact);
  }
}

TEST_CASE("a motion whose first guess is right keeps to it, one that is off by a shift makes it up",
          "[cad][motion]") {
  const auto points = random_points(60), places = random_points(90, 30);
  const Vector3d shift(4, -1, 2.5);
  const EntityMotion right(affine, points, images(points, affine), 12);
  const EntityMotion shifted([&](const Vector3d& x) -> Vector3d { return affine(x) + shift; },
                             points, images(points, affine), 12);
  for (const Vector3d& x : places) {
    CHECK((right(x) - affine(x)).norm() < kExact);
    CHECK((shifted(x) - affine(x)).norm() < kExact);
    double nearest = 1e300;
    for (const Vector3d& p : points) nearest = std::min(nearest, (p - x).norm());
    CHECK(right.place_of(x).reach == Approx(nearest).epsilon(1e-12));
  }
  const EntityMotion unknown(affine, {}, {}, 12);
  CHECK(unknown(places[0]) == affine(places[0]));
  CHECK(unknown.place_of(places[0]).reach == 0);
}

TEST_CASE("amid points that lie alike on all sides a motion gives back any affine map",
          "[cad][motion]") {
  // By symmetry slopes, however they are held back, have no part in the fit's value at the middle.
  const auto points = grid(3, 3);
  for (const int neighbours : {6, 18, 26}) {  // whole shells
    INFO(neighbours);
    const EntityMotion motion(stay, points, images(points, affine), neighbours);
    for (const Vector3d& x : grid(2, 2))
      CHECK((motion(x, index_of(points, x)) - affine(x)).norm() < kExact);
  }
  const EntityMotion cells(stay, points, images(points, affine), 8);
  for (const Vector3d& x : grid(2, 2)) {
    const Vector3d middle = x + Vector3d::Constant(0.5);
    CHECK((cells(middle) - affine(middle)).norm() < kExact);
  }
}

TEST_CASE("a point that is left out has no part in what its neighbours say of it",
          "[cad][motion]") {
  const auto points = grid(3, 3);
  auto to = images(points, affine);
  const int odd = index_of(points, Vector3d(1, 0, -1));
  const Vector3d away(5, 5, 5);
  to[odd] += away;
  const EntityMotion motion(stay, points, to, 26);
  CHECK((motion(points[odd], odd) - affine(points[odd])).norm() < kExact);
  // With a weight 1 / 0.04 against those of its 26 neighbours, at distances up to sqrt(3) of the
  // radius.
  const double others = 6 / (1 / 3. + 0.04) + 12 / (2 / 3. + 0.04) + 8 / (1 + 0.04);
  const EntityMotion whole(stay, points, to, 27);
  const Vector3d pulled = away * 25 / (25 + others);
  CHECK((whole(points[odd]) - affine(points[odd]) - pulled).norm() < kExact);
}

TEST_CASE("off the plane of all known points a motion corrects as at the foot", "[cad][motion]") {
  const auto points = grid(3, 0);
  const EntityMotion motion(stay, points, images(points, affine), 9);
  for (const Vector3d& foot : grid(2, 0))
    for (const double height : {-0.8, 0.3, 20.0}) {
      const Vector3d x = foot + Vector3d(0, 0, height);
      CHECK((motion(x) - x - (affine(foot) - foot)).norm() < 1e-8);
    }
}

TEST_CASE("a motion turns, scales and shifts with its points, in any order of them",
          "[cad][motion]") {
  const auto points = random_points(80);
  const auto bent = [](const Vector3d& x) -> Vector3d {
    return x + Vector3d(0.02 * x.y() * x.z(), 0.3 * std::sin(x.x() / 3), 0.01 * x.x() * x.x());
  };
  const auto to = images(points, bent);
  const EntityMotion motion(stay, points, to, 12);
  const Similarity s = a_similarity();
  const auto seen = [&](const Vector3d& x) { return s(x); };
  auto seen_from = images(points, seen), seen_to = images(to, seen);
  std::ranges::reverse(seen_from);
  std::ranges::reverse(seen_to);
  const EntityMotion other(stay, seen_from, seen_to, 12);
  for (const Vector3d& x : random_points(40, 12)) {
    CHECK((other(s(x)) - s(motion(x))).norm() < kExact);
    CHECK(other.place_of(s(x)).reach == Approx(s.scale * motion.place_of(x).reach));
  }
  const int last = static_cast<int>(points.size()) - 1;
  for (int i = 0; i <= last; ++i)
    CHECK((other(s(points[i]), last - i) - s(motion(points[i], i))).norm() < kExact);
}
