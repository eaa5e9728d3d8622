#include "surface/motion_path.h"

#include <Eigen/Geometry>
#include <catch2/catch.hpp>
#include <functional>
#include <numbers>

#include "../core/sample_meshes.h"
#include "core/errors.h"

using namespace cadmorph;
using namespace cadmorph::testing;
using Eigen::Vector3d;

namespace {

constexpr double kPi = std::numbers::pi;

// The six sides of a cube of hexahedra around `centre`, a patch each.
struct Body {
  explicit Body(int n) : mesh(cube(CellType::Hexahedron, n)), boundary(extract_boundary(mesh)) {
    for (Index f = 0; f < boundary.facet_count(); ++f) {
      Vector3d centre = Vector3d::Zero();
      for (const Index node : boundary.facet(f)) centre += mesh.points.row(node).transpose() / 4;
      int side;
      const double farthest = (centre - Vector3d::Constant(0.5)).cwiseAbs().maxCoeff(&side);
      REQUIRE(farthest > 0.5 - 1e-9);
      patch.emplace_back(2 * side + (centre[side] > 0.5));
    }
    start.resize(static_cast<Index>(boundary.nodes.size()), 3);
    for (Index i = 0; i < start.rows(); ++i) start.row(i) = mesh.points.row(boundary.nodes[i]);
  }

  Points moved(const std::function<Vector3d(const Vector3d&)>& map) const {
    Points result = start;
    for (Index i = 0; i < start.rows(); ++i)
      result.row(i) = map(start.row(i).transpose()).transpose();
    return result;
  }

  Mesh mesh;
  Boundary boundary;
  IdVector<FacetId, FaceId> patch;
  Points start;
};

double worst(const Points& a, const Points& b) { return (a - b).cwiseAbs().maxCoeff(); }

Vector3d turned(const Vector3d& x, const Vector3d& centre, const Vector3d& axis, double angle) {
  return centre + Eigen::AngleAxisd(angle, axis.normalized()) * (x - centre);
}

}  // namespace

TEST_CASE("a half-turn keeps the body's size all the way", "[surface][path]") {
  const Body body(4);
  const Vector3d axis(1, 2, 3), centre(0.4, 0.7, 2);
  // Half a turn has two ways round: either, but all faces the same.
  const Points end = body.moved([&](const Vector3d& x) { return turned(x, centre, axis, kPi); });
  const MotionPath path(body.boundary, body.start, end, body.patch);
  REQUIRE(path.is_turning());
  const auto at = [&](double angle) {
    return body.moved([&](const Vector3d& x) { return turned(x, centre, axis, angle); });
  };
  const double way = worst(path(0.5), at(kPi / 2)) < worst(path(0.5), at(-kPi / 2)) ? 1 : -1;
  for (const double s : {0.1, 0.25, 0.5, 0.75, 0.9})
    CHECK(worst(path(s), at(way * s * kPi)) < 1e-12);
  CHECK(worst(path(0), body.start) < 1e-13);
  CHECK(worst(path(1), end) < 1e-12);
  // Straight lines would flatten it in the middle.
  const Points chord = (body.start + end) / 2;
  CHECK((chord.rowwise() - chord.colwise().mean()).squaredNorm() <
        0.7 * (end.rowwise() - end.colwise().mean()).squaredNorm());
}

TEST_CASE("a body that turns, grows and travels does so evenly", "[surface][path]") {
  const Body body(3);
  const double angle = 2.5, scale = 1.8;
  // The flow x' = G x at time s: a turn about and a growth from one point, by closed form.
  const Vector3d axis(0, 0, 1), centre(3, 1, -2);
  const auto at = [&](double s) {
    return body.moved([&](const Vector3d& x) -> Vector3d {
      return centre + std::pow(scale, s) * (turned(x, centre, axis, s * angle) - centre);
    });
  };
  const MotionPath path(body.boundary, body.start, at(1), body.patch);
  REQUIRE(path.is_turning());
  for (const double s : {0.2, 0.5, 0.8}) CHECK(worst(path(s), at(s)) < 1e-11);
}

TEST_CASE("what turns little or only travels goes straight", "[surface][path]") {
  const Body body(3);
  const Vector3d axis(1, 0, 1), shift(4, -1, 2);
  const Points end = body.moved([&](const Vector3d& x) -> Vector3d {
    return turned(x, Vector3d::Zero(), axis, 0.4) + shift;
  });
  const MotionPath path(body.boundary, body.start, end, body.patch);
  CHECK_FALSE(path.is_turning());
  CHECK(path(0.3) == body.start + 0.3 * (end - body.start));
  const Points far = body.moved([&](const Vector3d& x) -> Vector3d { return x + shift; });
  CHECK_FALSE(MotionPath(body.boundary, body.start, far, body.patch).is_turning());
}

TEST_CASE("between a side at rest and one that turns the surface twists without a gap",
          "[surface][path]") {
  const Body body(8);
  const Vector3d up = Vector3d::UnitZ(), centre(0.5, 0.5, 0);
  // The bottom rests, the top makes a half-turn, the walls are twisted.
  const auto twist = [&](double s) {
    return body.moved([&](const Vector3d& x) { return turned(x, centre, up, s * kPi * x[2]); });
  };
  const Points end = twist(1);
  const MotionPath path(body.boundary, body.start, end, body.patch);
  REQUIRE(path.is_turning());
  const Points middle = path(0.5);
  CHECK(worst(path(1), end) < 1e-12);
  // Top and bottom as they are; halfway up the walls half of the chord's shrinking is gone.
  const double way = (middle - twist(0.5)).norm() < (middle - twist(-0.5)).norm() ? 0.5 : -0.5;
  const Points exact = twist(way), chord = (body.start + end) / 2;
  double off = 0, off_chord = 0;
  int at_bottom = 0, on_top = 0;
  for (Index i = 0; i < exact.rows(); ++i) {
    const double error = (middle.row(i) - exact.row(i)).norm();
    const double height = body.start(i, 2);
    at_bottom += height == 0;
    on_top += height == 1;
    if (height == 0) CHECK(error < 0.02);
    if (height == 1) CHECK(error < 0.05);
    off = std::max(off, error);
    off_chord = std::max(off_chord, (chord.row(i) - exact.row(i)).norm());
  }
  CHECK(at_bottom == 9 * 9);
  CHECK(on_top == 9 * 9);
  CHECK(off < off_chord / 3);
  // No gap: neighbours stay neighbours.
  for (Index f = 0; f < body.boundary.facet_count(); ++f)
    for (int i = 0; i < 4; ++i) {
      const auto row = [&](int k) {
        return std::ranges::lower_bound(body.boundary.nodes, body.boundary.facet(f)[k % 4]) -
               body.boundary.nodes.begin();
      };
      CHECK((middle.row(row(i)) - middle.row(row(i + 1))).norm() < 0.3);
    }
}

TEST_CASE("wrong sizes of a motion path are refused", "[surface][path]") {
  const Body body(2);
  CHECK_THROWS_AS(MotionPath(body.boundary, body.start.topRows(3), body.start, body.patch),
                  InvalidInputError);
  CHECK_THROWS_AS(MotionPath(body.boundary, body.start, body.start, {}), InvalidInputError);
}
