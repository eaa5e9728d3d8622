#include <BRepAlgoAPI_Cut.hxx>
#include <BRepAlgoAPI_Fuse.hxx>
#include <BRepPrimAPI_MakeBox.hxx>
#include <BRepPrimAPI_MakeCone.hxx>
#include <BRepPrimAPI_MakeCylinder.hxx>
#include <BRepPrimAPI_MakeSphere.hxx>
#include <Eigen/Geometry>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <gp_Ax2.hxx>
#include <numbers>

#include "cad/topology_match.h"
#include "morph_case.h"
#include "surface_parts.h"
#include "triangulation.h"
#include "warped_shape.h"

using namespace cadmorph;
using namespace cadmorph::testing;
using Eigen::Vector3d;
using std::numbers::pi;

namespace {

gp_Ax2 axes(double seam) {
  return gp_Ax2(gp_Pnt(0, 0, 0), gp_Dir(0, 0, 1), gp_Dir(std::cos(seam), std::sin(seam), 0));
}

/// A cylinder with a radial hole at angle 0, which the seam crosses when it is there too.
TopoDS_Shape drilled_shaft(double hole, double seam) {
  return BRepAlgoAPI_Cut(
             BRepPrimAPI_MakeCylinder(axes(seam), 15, 40).Solid(),
             BRepPrimAPI_MakeCylinder(gp_Ax2(gp_Pnt(0, 0, 20), gp_Dir(1, 0, 0)), hole, 30).Solid())
      .Shape();
}

// Morphs the surface of a part along a twist about the z axis.
void check_twist(const TopoDS_Shape& part) {
  const auto twist = [](const Vector3d& x) -> Vector3d {
    return Eigen::AngleAxisd(0.02 * x.z(), Vector3d::UnitZ()) * x;
  };
  const MorphCase c = mesh_case(to_model(part), triangulate(part, 0.1));
  const auto result = morph_surface(c, to_model(warped(part, twist)));
  const Points expected = images(surface_points(c.boundary, c.mesh.points), twist);
  // What the B-splines of the warped shape interpolate.
  CHECK(largest_difference(result.positions, expected) < 1e-6 * c.diagonal);
}

}  // namespace

TEST_CASE("a ball with a hole that turns about its axis turns with the hole", "[surface][seam]") {
  const TopoDS_Shape ball =
      BRepAlgoAPI_Cut(
          sphere_at({0, 0, 0}, 30),
          BRepPrimAPI_MakeCylinder(gp_Ax2(gp_Pnt(12, 0, -40), gp_Dir(0, 0, 1)), 5, 80).Solid())
          .Shape();
  const gp_Trsf turn = turn_about_z(0.35);
  const MorphCase c = mesh_case(to_model(ball), triangulate(ball, 0.2));
  const auto result = morph_surface(c, to_model(transformed(ball, turn)));
  const Points old = surface_points(c.boundary, c.mesh.points);
  for (Index n = 0; n < old.rows(); ++n)
    CHECK((Vector3d(result.positions.row(n)) - apply(turn, old.row(n))).norm() <=
          1e-6 * c.diagonal);
}

TEST_CASE("the seam of a shaft with an off-centre bore turns alone", "[surface][seam]") {
  // The bore fixes the part's position; the seam of the shaft's mantle moves by 70 degrees.
  const auto shaft = [](double radius, double height, double seam) -> TopoDS_Shape {
    const gp_Ax2 axes(gp_Pnt(0, 0, 0), gp_Dir(0, 0, 1), gp_Dir(std::cos(seam), std::sin(seam), 0));
    const gp_Ax2 bore(gp_Pnt(radius / 2, 0, -1), gp_Dir(0, 0, 1));
    return BRepAlgoAPI_Cut(BRepPrimAPI_MakeCylinder(axes, radius, height).Solid(),
                           BRepPrimAPI_MakeCylinder(bore, radius / 5, height + 2).Solid())
        .Shape();
  };
  const TopoDS_Shape base = shaft(20, 30, 0);
  const MorphCase c = mesh_case(to_model(base), triangulate(base, 0.1));
  for (const double seam : {0.0, 70.0, 180.0, -45.0}) {
    DYNAMIC_SECTION("seam at " << seam) {
      // Larger and taller too: an affine map that keeps the angles.
      const auto result = morph_surface(c, to_model(shaft(24, 45, seam * pi / 180)));
      const Points expected = moved_by(c, [](const Vector3d& x) -> Vector3d {
        return {1.2 * x.x(), 1.2 * x.y(), 1.5 * x.z()};
      });
      // The phase of a circle whose seam moved is found by least motion, not by parameters.
      CHECK(largest_difference(result.positions, expected) <= 1e-3 * c.diagonal);
    }
  }
}

TEST_CASE("a seam that crosses a hole leaves every node in place when it moves away",
          "[surface][seam]") {
  const TopoDS_Shape base = drilled_shaft(5, 0);
  const MorphCase c = mesh_case(to_model(base), triangulate(base, 0.05));
  const Points old = surface_points(c.boundary, c.mesh.points);
  for (const double seam : {0.0, 20.0, 90.0, 180.0}) {
    DYNAMIC_SECTION("seam at " << seam) {
      const CadModel variant = to_model(drilled_shaft(5, seam * pi / 180));
      const auto result = morph_surface(c, variant);
      // The curve where hole and shaft meet is computed anew each time, to its tolerance.
      const double tolerance = 2 * std::max(largest_tolerance(*c.base), largest_tolerance(variant));
      CHECK(largest_difference(result.positions, old) <= tolerance + 1e-8 * c.diagonal);
    }
  }
}

TEST_CASE("a growing radial hole keeps its nodes on all faces, wherever the seams are",
          "[surface][seam]") {
  const TopoDS_Shape base = drilled_shaft(5, 0);
  const MorphCase c = mesh_case(to_model(base), triangulate(base, 0.05));
  for (const double seam : {0.0, 90.0, 180.0}) {
    DYNAMIC_SECTION("seam at " << seam) {
      const TopoDS_Shape shape = drilled_shaft(6.5, seam * pi / 180);
      const CadModel variant = to_model(shape);
      const TopologyMatch match = match_topology(*c.base, variant);
      const auto result = SurfaceMorph(c.base, c.mesh, c.boundary).morph(variant, match);
      const OnCad judged = judge(c, result.positions, match, variant, shape);
      CHECK(judged.farthest <= 2 * largest_tolerance(variant));
      CHECK(judged.folded == 0);
    }
  }
}

TEST_CASE("a narrow groove follows a twist of the part", "[surface][seam]") {
  // Both circles of the groove's floor turn by nearly one angle, as if only their seam had moved.
  TopoDS_Shape part = BRepPrimAPI_MakeBox(gp_Pnt(-15, -12, 0), gp_Pnt(15, 12, 10)).Solid();
  double z = 10;
  for (const auto& [height, from, to] : std::initializer_list<std::array<double, 3>>{
           {30, 6, 6}, {1, 6, 5}, {0.005, 5, 5}, {1, 5, 6}, {3, 6, 6}, {1, 6, 5}, {3, 5, 5}}) {
    const gp_Ax2 at(gp_Pnt(0, 0, z), gp_Dir(0, 0, 1));
    const TopoDS_Shape piece = from == to ? BRepPrimAPI_MakeCylinder(at, from, height).Solid()
                                          : BRepPrimAPI_MakeCone(at, from, to, height).Solid();
    part = BRepAlgoAPI_Fuse(part, piece).Shape();
    z += height;
  }
  check_twist(part);
}

TEST_CASE("a groove between plane walls follows a twist of the part", "[surface][seam]") {
  // The walls link no seams, and both circles of the floor turn by nearly one angle.
  for (const bool has_flat : {false, true}) {
    DYNAMIC_SECTION((has_flat ? "in a shaft with a flat" : "in a round shaft")) {
      TopoDS_Shape part = BRepPrimAPI_MakeBox(gp_Pnt(-15, -12, 0), gp_Pnt(15, 12, 10)).Solid();
      double z = 10;
      for (const auto& [height, radius] :
           std::initializer_list<std::array<double, 2>>{{30, 6}, {0.05, 3}, {3, 6}}) {
        TopoDS_Shape piece =
            BRepPrimAPI_MakeCylinder(gp_Ax2(gp_Pnt(0, 0, z), gp_Dir(0, 0, 1)), radius, height)
                .Solid();
        const TopoDS_Shape beyond =
            BRepPrimAPI_MakeBox(gp_Pnt(5, -9, z - 1), gp_Pnt(9, 9, z + height + 1)).Solid();
        if (has_flat) piece = BRepAlgoAPI_Cut(piece, beyond).Shape();
        part = BRepAlgoAPI_Fuse(part, piece).Shape();
        z += height;
      }
      check_twist(part);
    }
  }
}

TEST_CASE("a rib's foot is spread evenly where the shaft's seam crosses it", "[surface][seam]") {
  // The seam cuts the arcs of the foot, not always at the same place of the rib.
  const auto ribbed = [](double half, double seam) {
    const gp_Ax2 from(gp_Pnt(0, 0, 15), gp_Dir(0, 0, 1),
                      gp_Dir(std::cos(half), -std::sin(half), 0));
    return BRepAlgoAPI_Fuse(BRepPrimAPI_MakeCylinder(axes(seam), 15, 40).Shape(),
                            BRepPrimAPI_MakeCylinder(from, 25, 10, 2 * half).Shape())
        .Shape();
  };
  const double half = 0.5, wider = 0.6;
  const TopoDS_Shape base = ribbed(half, 0.1);
  const MorphCase c = mesh_case(to_model(base), triangulate(base, 0.02));
  const Points before = surface_points(c.boundary, c.mesh.points);
  for (const double seam : {0.1, -0.3, 0.4}) {
    const SurfaceMorphResult result = morph_surface(c, to_model(ribbed(wider, seam)));
    int on_foot = 0;
    for (Index i = 0; i < before.rows(); ++i) {
      const Vector3d x = before.row(i), y = result.positions.row(i);
      const double angle = std::atan2(x.y(), x.x()), after = std::atan2(y.y(), y.x());
      if (std::abs(x.head<2>().norm() - 15) > 1e-6 || std::abs(std::abs(x.z() - 20) - 5) > 1e-6 ||
          std::abs(angle) > half)
        continue;
      ++on_foot;
      CAPTURE(seam, angle);
      CHECK(std::abs(after - angle * wider / half) < 1e-6);
    }
    CHECK(on_foot > 20);
  }
}

TEST_CASE("a ball with one hole is not spun about it", "[surface][seam]") {
  const auto ball = [](double hole) {
    const TopoDS_Shape shell =
        BRepAlgoAPI_Cut(BRepPrimAPI_MakeSphere(20).Shape(), BRepPrimAPI_MakeSphere(16).Shape())
            .Shape();
    const gp_Ax2 along(gp_Pnt(0, 0, 0), gp_Dir(3, 1, 2));
    return BRepAlgoAPI_Cut(shell, BRepPrimAPI_MakeCylinder(along, hole, 30).Shape()).Shape();
  };
  const TopoDS_Shape base = ball(8);
  const MorphCase c = mesh_case(to_model(base), triangulate(base, 0.2));
  const SurfaceMorphResult result = morph_surface(c, to_model(ball(10)));
  CHECK(largest_difference(result.positions, surface_points(c.boundary, c.mesh.points)) < 4);
}
