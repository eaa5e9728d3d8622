#include "cad/alignment.h"

#include <BRepAlgoAPI_Cut.hxx>
#include <BRepBuilderAPI_Transform.hxx>
#include <BRepPrimAPI_MakeBox.hxx>
#include <BRepPrimAPI_MakeCylinder.hxx>
#include <Eigen/Dense>
#include <catch2/catch.hpp>
#include <cmath>
#include <gp_Trsf.hxx>
#include <numbers>
#include <random>

#include "cad_variants.h"

using namespace cadmorph;
using namespace cadmorph::testing;
using Eigen::AngleAxisd;
using Eigen::Matrix3d;
using Eigen::Vector3d;
using std::numbers::pi;

namespace {

std::vector<Vector3d> random_points(int count) {
  std::mt19937 random(9);
  std::uniform_real_distribution<double> unit(-10, 10);
  std::vector<Vector3d> points;
  for (int i = 0; i < count; ++i) {
    const double x = unit(random), y = unit(random), z = unit(random);
    points.emplace_back(x, y, z);
  }
  return points;
}

Similarity known() {
  Similarity s;
  s.scale = 1.7;
  s.rotation = AngleAxisd(2.3, Vector3d(1, -2, 0.5).normalized()).toRotationMatrix();
  s.translation = Vector3d(100, -20, 3);
  return s;
}

std::vector<Vector3d> images(const Similarity& s, const std::vector<Vector3d>& points) {
  std::vector<Vector3d> moved;
  for (const auto& p : points) moved.push_back(s(p));
  return moved;
}

double turn(const Matrix3d& rotation) { return AngleAxisd(rotation).angle(); }

}  // namespace

TEST_CASE("a known similarity is found", "[cad][alignment]") {
  for (const int count : {3, 4, 50}) {
    const auto from = random_points(count);
    const auto to = images(known(), from);
    const Similarity s = fit_similarity(from, to);
    CHECK(std::abs(s.scale - 1.7) < 1e-10);
    CHECK((s.rotation - known().rotation).norm() < 1e-10);
    CHECK((s.translation - known().translation).norm() < 1e-8);
    CHECK(residual(s, from, to) < 1e-10);
  }
}

TEST_CASE("the fit is the least-squares one", "[cad][alignment]") {
  const auto from = random_points(30);
  auto to = images(known(), from);
  std::mt19937 random(4);
  std::normal_distribution<double> noise(0, 0.5);
  for (auto& p : to) p += Vector3d(noise(random), noise(random), noise(random));
  const Similarity best = fit_similarity(from, to);
  const double least = residual(best, from, to);
  for (int i = 0; i < 60; ++i) {
    Similarity other = best;
    const Vector3d axis(noise(random), noise(random), noise(random));
    other.rotation = AngleAxisd(0.01, axis.normalized()).toRotationMatrix() * best.rotation;
    other.scale *= 1 + 0.01 * noise(random);
    other.translation += 0.1 * Vector3d(noise(random), noise(random), noise(random));
    CHECK(residual(other, from, to) >= least);
  }
}

TEST_CASE("mirrored points get a proper rotation", "[cad][alignment]") {
  const auto from = random_points(20);
  std::vector<Vector3d> to;
  for (const auto& p : from) to.emplace_back(-p.x(), p.y(), p.z());
  CHECK(std::abs(fit_similarity(from, to).rotation.determinant() - 1) < 1e-12);
}

TEST_CASE("points that leave a rotation open get the smallest one", "[cad][alignment]") {
  const std::vector<Vector3d> line{{0, 0, 0}, {0, 0, 5}, {0, 0, 7}};
  const Similarity same = fit_similarity(line, line);
  CHECK((same.rotation - Matrix3d::Identity()).norm() < 1e-9);
  const std::vector<Vector3d> tilted{{1, 2, 3},
                                     {1, 2 + 10 * std::sin(0.2), 3 + 10 * std::cos(0.2)},
                                     {1, 2 + 14 * std::sin(0.2), 3 + 14 * std::cos(0.2)}};
  const Similarity s = fit_similarity(line, tilted);
  CHECK(std::abs(turn(s.rotation) - 0.2) < 1e-7);
  CHECK(std::abs(s.scale - 2) < 1e-9);
  CHECK(residual(s, line, tilted) < 1e-9);
  const Similarity single = fit_similarity({Vector3d(1, 2, 3)}, {Vector3d(5, 5, 5)});
  CHECK((single.rotation - Matrix3d::Identity()).norm() < 1e-12);
  CHECK((single.translation - Vector3d(4, 3, 2)).norm() < 1e-12);
}

TEST_CASE("the residual is the root mean square distance", "[cad][alignment]") {
  const std::vector<Vector3d> from{{0, 0, 0}, {1, 0, 0}}, to{{0, 3, 0}, {1, 0, 4}};
  CHECK(std::abs(residual({}, from, to) - std::sqrt((9.0 + 16.0) / 2)) < 1e-12);
}

TEST_CASE("features are centroids and sizes, whatever the parameters", "[cad][alignment]") {
  for (const bool is_nurbs : {false, true}) {
    TopoDS_Shape shape = read_shape(model_file("shapes/cylinder.step"));
    if (is_nurbs) shape = to_nurbs(shape);
    const CadModel cylinder = to_model(shape);
    const auto features = entity_features(cylinder);
    REQUIRE(features.size() == 5);  // 3 faces, 2 curves
    for (int f = 0; f < 3; ++f) {
      const Vector3d c = features[f].centre;
      CHECK(std::hypot(c.x(), c.y()) < 0.2);
      const bool is_mantle = std::abs(c.z() - 20) < 1;
      const double area = is_mantle ? 2 * pi * 15 * 40 : pi * 15 * 15;
      CHECK(std::abs(features[f].size / std::sqrt(area) - 1) < 0.03);
    }
    for (int c = 3; c < 5; ++c) {
      CHECK(std::hypot(features[c].centre.x(), features[c].centre.y()) < 1e-2);
      CHECK(std::abs(features[c].size / (2 * pi * 15) - 1) < 1e-3);
    }
  }
}

TEST_CASE("a mirror image is told from a change of parameters", "[cad][alignment]") {
  gp_Trsf mirror;
  mirror.SetMirror(gp_Ax2(gp_Pnt(1, 2, 3), gp_Dir(1, 0.5, -2)));
  // A box without one of its corners, with a hole along z and a pocket along x: no axis can take
  // the place of another.
  const auto chiral = [](double x, double y, double z) -> TopoDS_Shape {
    const TopoDS_Shape notched = BRepAlgoAPI_Cut(BRepPrimAPI_MakeBox(30, 20, 10).Shape(),
                                                 BRepPrimAPI_MakeBox(x, y, z).Shape());
    const gp_Ax2 axis(gp_Pnt(20, 14, -1), gp_Dir(0, 0, 1));
    const TopoDS_Shape drilled =
        BRepAlgoAPI_Cut(notched, BRepPrimAPI_MakeCylinder(axis, 2, 12).Shape());
    return BRepAlgoAPI_Cut(drilled, BRepPrimAPI_MakeBox(gp_Pnt(26, 4, 3), 9, 6, 4).Shape());
  };
  const CadModel base = to_model(chiral(12, 5, 7));
  for (const TopoDS_Shape& shape : {chiral(12, 5, 7), chiral(15, 6, 6)}) {
    const CadModel variant = to_model(shape),
                   mirrored = to_model(BRepBuilderAPI_Transform(shape, mirror, true).Shape());
    CHECK_FALSE(is_mirror_image(base, variant, match_topology(base, variant)));
    CHECK(is_mirror_image(base, mirrored, match_topology(base, mirrored)));
    CHECK(is_mirror_image(mirrored, base, match_topology(mirrored, base)));
  }
  // Of a part that is its own mirror image there is a match without.
  const TopoDS_Shape cylinder = read_shape(model_file("shapes/cylinder.step"));
  const CadModel one = to_model(cylinder),
                 other = to_model(BRepBuilderAPI_Transform(cylinder, mirror, true).Shape());
  CHECK_FALSE(is_mirror_image(one, other, match_topology(one, other)));
}
