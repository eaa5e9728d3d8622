#include <BRepAlgoAPI_Cut.hxx>
#include <BRepAlgoAPI_Fuse.hxx>
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

/// A cylinder through the origin at an angle to z in the x-z plane, its seam turned about its axis.
TopoDS_Shape tilted_tube(double radius, double depth, double length, double tilt, double seam) {
  const gp_Dir axis(std::sin(tilt), 0, std::cos(tilt));
  const gp_Pnt start = point(Vector3d(-depth * axis.X(), 0, -depth * axis.Z()));
  const gp_Dir to_seam = gp_Dir(0, 1, 0).Rotated(gp_Ax1(start, axis), seam);
  return BRepPrimAPI_MakeCylinder(gp_Ax2(start, axis, to_seam), radius, depth + length).Solid();
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
      Index at_ends = 0;
      for (Index n = 0; n < change.before.rows(); ++n) {
        if (change.before(n, 0) != 0 && change.before(n, 0) != 120) continue;
        ++at_ends;
        CHECK((change.surface.positions.row(n) - change.before.row(n)).head<2>().norm() < 1e-9);
      }
      CHECK(at_ends >= 8);  // the corners
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
      CHECK(change.surface.folded_facets.empty());
      for (Index n = 0; n < change.before.rows(); ++n) {
        const Vector3d moved = (change.surface.positions.row(n) - change.before.row(n)).transpose();
        const bool is_inside = change.before.row(n).cwiseAbs().maxCoeff() < 8 - 1e-9;
        CHECK((moved - (is_inside ? way : Vector3d::Zero())).norm() < 1e-6);
      }
    }
  }
}

// Kernels choose where a cylinder's seam lies by its direction: it jumps where the tilt passes 45
// degrees.
TEST_CASE("tubes whose seams jump as they tilt are not turned", "[surface][turn][seam]") {
  const TopoDS_Shape plate = BRepPrimAPI_MakeBox(gp_Pnt(-30, -20, -20), gp_Pnt(30, 20, 0)).Solid();
  const gp_Ax2 along(gp_Pnt(-40, 0, 0), gp_Dir(1, 0, 0));
  const TopoDS_Shape pipe = BRepPrimAPI_MakeCylinder(along, 12, 80).Solid();
  const double from = 46 * pi / 180, length = 40;
  const auto branched = [&](const TopoDS_Shape& body, double depth, double tilt, double seam) {
    return BRepAlgoAPI_Fuse(body, tilted_tube(6, depth, length, tilt, seam)).Shape();
  };
  const auto drilled = [&](double tilt, double seam) {
    return BRepAlgoAPI_Cut(plate, tilted_tube(4, 12, 15, pi - tilt, seam)).Shape();
  };
  for (const double to : {44 * pi / 180, 38 * pi / 180})
    for (const double seam : {0.0, pi / 2, -pi / 2, pi}) {
      CAPTURE(to, seam);
      const double most = 1.5 * (from - to) * length;
      const Change peg(branched(plate, 12, from, 0), branched(plate, 12, to, seam), 0.3);
      CHECK(peg.largest_move() < most);
      CHECK(peg.surface.folded_facets.empty());
      const Change tee(branched(pipe, 6, from, 0), branched(pipe, 6, to, seam), 0.3);
      CHECK(tee.largest_move() < most);
      CHECK(tee.surface.folded_facets.empty());
      const Change hole(drilled(from, 0), drilled(to, seam), 0.3);
      CHECK(hole.largest_move() < most);
      CHECK(hole.surface.folded_facets.empty());
    }
}
