#include <BRepAlgoAPI_Cut.hxx>
#include <BRepAlgoAPI_Fuse.hxx>
#include <BRepBuilderAPI_MakeEdge.hxx>
#include <BRepBuilderAPI_MakeFace.hxx>
#include <BRepBuilderAPI_MakeWire.hxx>
#include <BRepFilletAPI_MakeFillet.hxx>
#include <BRepPrimAPI_MakeBox.hxx>
#include <BRepPrimAPI_MakeCylinder.hxx>
#include <BRepPrimAPI_MakeRevol.hxx>
#include <BRepPrimAPI_MakeSphere.hxx>
#include <BRepPrimAPI_MakeTorus.hxx>
#include <Eigen/Geometry>
#include <GC_MakeArcOfCircle.hxx>
#include <TopExp_Explorer.hxx>
#include <TopoDS.hxx>
#include <catch2/catch.hpp>
#include <cmath>
#include <gp_Ax2.hxx>
#include <numbers>

#include "morph_case.h"
#include "triangulation.h"
#include "warped_shape.h"

using namespace cadmorph;
using namespace cadmorph::testing;
using Eigen::Vector2d;
using Eigen::Vector3d;
using std::numbers::pi;

namespace {

/// A cylinder with a hemisphere on top, as one turned part: no edge at the pole.
TopoDS_Shape capsule(double radius, double height, double seam) {
  const Vector2d x(std::cos(seam), std::sin(seam));
  const auto at = [&](double r, double z) { return gp_Pnt(r * x.x(), r * x.y(), z); };
  BRepBuilderAPI_MakeWire outline(
      BRepBuilderAPI_MakeEdge(at(0, 0), at(radius, 0)).Edge(),
      BRepBuilderAPI_MakeEdge(at(radius, 0), at(radius, height)).Edge(),
      BRepBuilderAPI_MakeEdge(
          GC_MakeArcOfCircle(at(radius, height),
                             at(radius * std::sqrt(0.5), height + radius * std::sqrt(0.5)),
                             at(0, height + radius))
              .Value())
          .Edge(),
      BRepBuilderAPI_MakeEdge(at(0, height + radius), at(0, 0)).Edge());
  return BRepPrimAPI_MakeRevol(BRepBuilderAPI_MakeFace(outline.Wire()),
                               gp_Ax1(gp_Pnt(0, 0, 0), gp_Dir(0, 0, 1)))
      .Shape();
}

}  // namespace

TEST_CASE("rounded corners follow a twist where the variant's u runs the other way",
          "[surface][pole]") {
  const TopoDS_Shape box = BRepPrimAPI_MakeBox(gp_Pnt(0, 0, 0), gp_Pnt(30, 20, 10)).Solid();
  BRepFilletAPI_MakeFillet rounding(box);
  for (TopExp_Explorer it(box, TopAbs_EDGE); it.More(); it.Next())
    rounding.Add(3, TopoDS::Edge(it.Current()));
  const TopoDS_Shape base = rounding.Shape();
  const auto twist = [](const Vector3d& x) -> Vector3d {
    return Eigen::AngleAxisd(0.01 * x.x(), Vector3d::UnitX()) * x;
  };
  const MorphCase c = mesh_case(to_model(base), triangulate(base, 0.1));
  const Shuffled variant = shuffle(
      warped(base, twist),
      {.seed = 1, .is_order_shuffled = false, .has_reversed_surfaces = true, .probability = 1});
  // The reader makes degenerate edges of its own, which run with u.
  const auto result = morph_surface(c, through_step(variant.shape));
  const Points expected = images(surface_points(c.boundary, c.mesh.points), twist);
  CHECK(largest_difference(result.positions, expected) < 1e-6 * c.diagonal);
}

TEST_CASE("a capsule that grows longer moves its dome as it is", "[surface][pole]") {
  const TopoDS_Shape base = capsule(10, 30, 0);
  const MorphCase c = mesh_case(to_model(base), triangulate(base, 0.05));
  const Points old = surface_points(c.boundary, c.mesh.points);
  for (const double seam : {0.0, 100.0}) {
    DYNAMIC_SECTION("seam at " << seam) {
      const auto result = morph_surface(c, to_model(capsule(10, 45, seam * pi / 180)));
      const Points expected = images(old, [](const Vector3d& x) -> Vector3d {
        return {x.x(), x.y(), x.z() <= 30 ? 1.5 * x.z() : x.z() + 15};
      });
      CHECK(largest_difference(result.positions, expected) <= 1e-8 * c.diagonal);
    }
  }
}

TEST_CASE("the poles of spheres and the seams of tori may lie anywhere", "[surface][pole][seam]") {
  const gp_Pnt middle(0, 0, 30);
  // A pin with a round head, a ball and a ring in blocks.
  const auto pin = [&](double radius, double height, const gp_Dir& pole) {
    const gp_Pnt top(0, 0, height);
    return BRepAlgoAPI_Fuse(BRepPrimAPI_MakeCylinder(radius, height).Solid(),
                            BRepPrimAPI_MakeSphere(gp_Ax2(top, pole), radius).Solid())
        .Shape();
  };
  const auto block = [&](const TopoDS_Shape& inside) {
    return BRepAlgoAPI_Cut(BRepPrimAPI_MakeBox(gp_Pnt(-30, -30, 0), gp_Pnt(30, 30, 60)).Solid(),
                           inside)
        .Shape();
  };
  const auto ball = [&](double radius, const gp_Dir& pole) {
    return block(BRepPrimAPI_MakeSphere(gp_Ax2(middle, pole), radius).Solid());
  };
  const auto ring = [&](double major, double minor, const gp_Dir& axis, const gp_Dir& start) {
    return block(BRepPrimAPI_MakeTorus(gp_Ax2(middle, axis, start), major, minor).Solid());
  };
  const auto check = [](const TopoDS_Shape& base, const TopoDS_Shape& variant,
                        const std::function<Vector3d(const Vector3d&)>& map) {
    const MorphCase c = mesh_case(to_model(base), triangulate(base, 0.2));
    const Points before = surface_points(c.boundary, c.mesh.points);
    const auto moved = morph_surface(c, to_model(variant));
    CHECK(largest_difference(moved.positions, images(before, map)) < 1e-6 * c.diagonal);
  };
  const gp_Dir up(0, 0, 1), down(0, 0, -1), aside(1, 0, 0), askew(1, 2, -2), tilted(2, 1, 1);
  for (const gp_Dir& pole : {up, down, askew, tilted})
    for (const bool is_of_base : {false, true}) {
      CAPTURE(pole.X(), pole.Z(), is_of_base);
      const gp_Dir before = is_of_base ? pole : up, after = is_of_base ? up : pole;
      check(ball(8, before), ball(11, after), [](const Vector3d& x) -> Vector3d {
        const Vector3d way = x - Vector3d(0, 0, 30);
        return way.norm() > 15 ? x : Vector3d(Vector3d(0, 0, 30) + 11.0 / 8 * way);
      });
      check(pin(10, 30, before), pin(12, 40, after), [](const Vector3d& x) -> Vector3d {
        const double z = x.z() < 30 ? 40.0 / 30 * x.z() : 40 + 1.2 * (x.z() - 30);
        return {1.2 * x.x(), 1.2 * x.y(), z};
      });
    }
  for (const gp_Dir& axis : {up, down}) {
    CAPTURE(axis.Z());
    check(ring(12, 4, up, aside), ring(14, 5, axis, gp_Dir(1, 1.3, 0)),
          [](const Vector3d& x) -> Vector3d {
            const Vector3d out(x.x(), x.y(), 0);
            if (out.norm() > 20 || std::abs(x.z() - 30) > 10) return x;
            const double height = 1.25 * (x.z() - 30), far = 14 + 1.25 * (out.norm() - 12);
            return far * out.normalized() + Vector3d(0, 0, 30 + height);
          });
  }
}
