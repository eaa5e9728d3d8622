#include <BRepAlgoAPI_Cut.hxx>
#include <BRepPrimAPI_MakeBox.hxx>
#include <BRepPrimAPI_MakeCylinder.hxx>
#include <Eigen/Geometry>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <gp_Ax2.hxx>
#include <numbers>

#include "morph_case.h"
#include "surface_parts.h"
#include "triangulation.h"

using namespace cadmorph;
using namespace cadmorph::testing;
using Eigen::Vector2d;
using Eigen::Vector3d;
using std::numbers::pi;

TEST_CASE("a flow in a plane, one cell thick, stays extruded", "[surface][far-field]") {
  // Cells grow from the cylinder out to 30 of its radii.
  const Mesh mesh = hex_grid(
      {30, 36, 1},
      [](const Vector3d& s) -> Vector3d {
        const double r = std::pow(30, s.x()), a = 2 * pi * s.y();
        return {r * std::cos(a), r * std::sin(a), s.z() - 0.5};
      },
      true);
  const auto body = [](double x, double y, double radius) {
    return to_model(
        BRepPrimAPI_MakeCylinder(gp_Ax2(gp_Pnt(x, y, -0.5), gp_Dir(0, 0, 1)), radius, 1).Solid());
  };
  const MorphCase c = mesh_case(body(0, 0, 1), mesh);
  const Morphed m = morph(c, body(0.1, -0.07, 1.2));
  double apart = 0, off_plane = 0, farthest = 0, off_body = 0;
  Index pairs = 0;
  for (Index n = 0; n < mesh.node_count(); ++n) {
    const Vector3d x = mesh.points.row(n), y = m.points.row(n);
    farthest = std::max(farthest, (y - x).norm());
    off_plane = std::max(off_plane, std::abs(y.z() - x.z()));
    if (std::hypot(x.x(), x.y()) < 1 + 1e-9)
      off_body = std::max(off_body, std::abs(std::hypot(y.x() - 0.1, y.y() + 0.07) - 1.2));
    if (x.z() > 0) continue;
    for (Index k = 0; k < mesh.node_count(); ++k)
      if ((mesh.points.row(k).transpose() - x - Vector3d(0, 0, 1)).norm() < 1e-9) {
        ++pairs;
        apart = std::max(apart, (m.points.row(k).transpose() - y - Vector3d(0, 0, 1)).norm());
      }
  }
  CHECK(pairs == mesh.node_count() / 2);
  CHECK(apart <= 1e-12 * 60);
  CHECK(off_plane <= 1e-12 * 60);
  CHECK(off_body <= 1e-9);
  CHECK(farthest <= 1.2 * (0.2 + std::hypot(0.1, 0.07)));
}

TEST_CASE("the sides of a sector move alike, turned", "[surface][far-field]") {
  const double angle = 200 * pi / 180;
  const std::array<int, 3> n{16, 30, 4};
  const Mesh mesh = hex_grid(n, [&](const Vector3d& s) -> Vector3d {
    const double r = 5 * std::pow(30, s.x()), a = angle * s.y();
    return {r * std::cos(a), r * std::sin(a), 20 * s.z()};
  });
  const MorphCase c = mesh_case(to_model(cylinder(5, 20)), mesh);
  const Morphed m = morph(c, to_model(cylinder(7, 20)));
  const Eigen::AngleAxisd turn(angle, Vector3d::UnitZ());
  double apart = 0, farthest = 0;
  Index pairs = 0;
  for (Index i = 0; i < mesh.node_count(); ++i) {
    const Vector3d x = mesh.points.row(i), y = m.points.row(i);
    farthest = std::max(farthest, (y - x).norm());
    if (std::abs(x.y()) > 1e-9 || x.x() < 0) continue;
    for (Index k = 0; k < mesh.node_count(); ++k)
      if ((mesh.points.row(k).transpose() - turn * x).norm() < 1e-9) {
        ++pairs;
        apart = std::max(apart, (m.points.row(k).transpose() - turn * y).norm());
      }
  }
  CHECK(pairs == 17 * 5);
  CHECK(apart <= 1e-12 * 300);
  CHECK(farthest <= 1.2 * 1.2 * 2);  // space follows the planes, these the body
}

TEST_CASE("a duct of the CAD with two like sides moves them alike", "[surface][far-field]") {
  // A square hole through a plate that is one cell thick: both sides of the plate are CAD faces.
  const auto plate = [](double x, double size) -> TopoDS_Shape {
    const TopoDS_Shape hole =
        BRepPrimAPI_MakeBox(gp_Pnt(x - size, -size, -1), gp_Pnt(x + size, size, 2)).Solid();
    return BRepAlgoAPI_Cut(BRepPrimAPI_MakeBox(gp_Pnt(-40, -40, 0), gp_Pnt(40, 40, 1)).Solid(),
                           hole)
        .Shape();
  };
  const Mesh mesh = hex_grid(
      {20, 40, 1},
      [](const Vector3d& s) -> Vector3d {
        const double side = 4 * s.y() - std::floor(4 * s.y()), r = std::pow(40, s.x());
        const Vector2d along(2 * side - 1, 1);
        const Vector2d at = r * (Eigen::Rotation2Dd(pi / 2 * std::floor(4 * s.y() + 1e-9)) * along);
        return {at.x(), at.y(), s.z()};
      },
      true);
  const MorphCase c = mesh_case(to_model(plate(0, 1)), mesh);
  const Morphed m = morph(c, to_model(plate(0.1, 1.2)));
  double apart = 0, farthest = 0;
  Index pairs = 0;
  for (Index i = 0; i < mesh.node_count(); ++i) {
    farthest = std::max(farthest, (m.points.row(i) - mesh.points.row(i)).norm());
    for (Index k = 0; k < mesh.node_count(); ++k)
      if ((mesh.points.row(k) - mesh.points.row(i) - Eigen::RowVector3d(0, 0, 1)).norm() < 1e-9) {
        ++pairs;
        apart = std::max(apart,
                         (m.points.row(k) - m.points.row(i) - Eigen::RowVector3d(0, 0, 1)).norm());
      }
  }
  CHECK(pairs == mesh.node_count() / 2);
  CHECK(apart <= 1e-12 * 100);
  CHECK(farthest <= 1.2 * std::hypot(0.3, 0.2));
}
