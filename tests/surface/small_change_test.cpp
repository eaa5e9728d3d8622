#include <BRepAlgoAPI_Cut.hxx>
#include <BRepPrimAPI_MakeBox.hxx>
#include <BRepPrimAPI_MakeCylinder.hxx>
#include <BRepPrimAPI_MakeSphere.hxx>
#include <BRepPrimAPI_MakeTorus.hxx>
#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>

#include "morph_case.h"
#include "triangulation.h"

using namespace cadmorph;
using namespace cadmorph::testing;
using Eigen::Vector2d;
using Eigen::Vector3d;
using std::numbers::pi;

namespace {

gp_Pnt point(const Vector3d& x) { return gp_Pnt(x[0], x[1], x[2]); }

/// The surface nodes of a mesh of `base` morphed onto `variant`, and where they were.
struct Change {
  Change(const TopoDS_Shape& base, const TopoDS_Shape& variant, double deflection = 0.1)
      : c(mesh_case(to_model(base), triangulate(base, deflection))),
        before(surface_points(c.boundary, c.mesh.points)),
        surface(morph_surface(c, to_model(variant))) {}

  double largest_move() const { return largest_difference(surface.positions, before); }

  MorphCase c;
  Points before;
  SurfaceMorphResult surface;
};

/// A disc of radius 30 with a bore and n holes at radius 20, drilled in a given order.
TopoDS_Shape flange(double bore, int n, double clocking, int first) {
  TopoDS_Shape part = BRepAlgoAPI_Cut(BRepPrimAPI_MakeCylinder(30, 6).Solid(),
                                      BRepPrimAPI_MakeCylinder(bore, 6).Solid())
                          .Shape();
  for (int i = 0; i < n; ++i) {
    // The first two exchanged: as kernels do where a hole crosses an axis.
    const int hole = i < 2 ? (i + first) % 2 : i;
    const double at = 2 * pi * hole / n + clocking;
    const gp_Ax2 axis(gp_Pnt(20 * std::cos(at), 20 * std::sin(at), -1), gp_Dir(0, 0, 1));
    part = BRepAlgoAPI_Cut(part, BRepPrimAPI_MakeCylinder(axis, 3, 8).Solid()).Shape();
  }
  return part;
}

TopoDS_Shape disc_with_bore(double eccentricity) {
  const gp_Ax2 axis(gp_Pnt(eccentricity, 0, -1), gp_Dir(0, 0, 1));
  return BRepAlgoAPI_Cut(BRepPrimAPI_MakeCylinder(30, 10).Solid(),
                         BRepPrimAPI_MakeCylinder(axis, 12, 12).Solid())
      .Shape();
}

}  // namespace

TEST_CASE("a hole that crosses the middle does not turn the plate over", "[surface][turn]") {
  const Vector2d from{50, 48};
  const TopoDS_Shape base = drilled_plate(120, 80, 6, 6, {from});
  for (const Vector2d& to : {Vector2d(73, 49), Vector2d(70, 32), Vector2d(70, 48)})
    for (const double thickness : {6.0, 8.0}) {
      CAPTURE(to.transpose(), thickness);
      const Change change(base, drilled_plate(120, 80, thickness, 6, {to}));
      // The hole's own way, and the lid's.
      CHECK(change.largest_move() < 1.01 * Vector2d((to - from).norm(), thickness - 6).norm());
      for (Index n = 0; n < change.before.rows(); ++n)
        if (change.before(n, 0) == 0 || change.before(n, 0) == 120)
          CHECK((change.surface.positions.row(n) - change.before.row(n)).head<2>().norm() < 1e-9);
    }
}

TEST_CASE("a flange that is clocked turns no further, in whatever order its holes are",
          "[surface][turn]") {
  for (const int n : {3, 5, 9}) {
    const TopoDS_Shape base = flange(8, n, 0.1, 0);
    for (const double share : {0.1, 0.35})
      for (const double bore : {8.0, 9.5})
        for (const int first : {0, 1}) {
          CAPTURE(n, share, bore, first);
          const double angle = share * 2 * pi / n;
          const Change change(base, flange(bore, n, 0.1 + angle, first), 0.3);
          // The whole may turn: the same flange.
          CHECK(change.largest_move() < 2 * 30 * std::sin(angle / 2) + bore - 8 + 0.5);
        }
  }
}

TEST_CASE("a bore whose eccentricity changes its sign does not turn the disc", "[surface][turn]") {
  const Change gone(disc_with_bore(-4), disc_with_bore(0));
  CHECK(gone.largest_move() < 4.1);
  const Change across(disc_with_bore(-2), disc_with_bore(3));
  CHECK(across.largest_move() < 5.1);
}

TEST_CASE("closed faces without an edge are carried in one piece", "[surface][turn]") {
  const TopoDS_Shape block = BRepPrimAPI_MakeBox(gp_Pnt(-8, -8, -8), gp_Pnt(8, 8, 8)).Solid();
  const auto ball = [&](const Vector3d& at) {
    return BRepAlgoAPI_Cut(block, BRepPrimAPI_MakeSphere(point(at), 1).Solid()).Shape();
  };
  const auto ring = [&](const Vector3d& at) {
    const gp_Ax2 axis(point(at), gp_Dir(0, 0, 1));
    return BRepAlgoAPI_Cut(block, BRepPrimAPI_MakeTorus(axis, 2, 0.5).Solid()).Shape();
  };
  const Vector3d from(0.5, 0.3, -0.4);
  for (const bool is_ball : {true, false}) {
    const TopoDS_Shape base = is_ball ? ball(from) : ring(from);
    for (const Vector3d& way : {Vector3d(-1.5, 0, 0), Vector3d(2.5, 0, 0), Vector3d(0, -2.5, 0),
                                Vector3d(0, 0, 1.5), Vector3d(-3, 1, -3.5)}) {
      CAPTURE(is_ball, way.transpose());
      const Change change(base, is_ball ? ball(from + way) : ring(from + way), 0.05);
      CHECK(change.surface.folds.empty());
      for (Index n = 0; n < change.before.rows(); ++n) {
        const Vector3d moved = (change.surface.positions.row(n) - change.before.row(n)).transpose();
        const bool is_inside = change.before.row(n).cwiseAbs().maxCoeff() < 8 - 1e-9;
        CHECK((moved - (is_inside ? way : Vector3d::Zero())).norm() < 1e-6);
      }
    }
  }
}
