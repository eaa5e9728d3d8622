#include <BRepAlgoAPI_Cut.hxx>
#include <BRepAlgoAPI_Fuse.hxx>
#include <BRepBuilderAPI_MakeEdge.hxx>
#include <BRepBuilderAPI_MakeWire.hxx>
#include <BRepOffsetAPI_ThruSections.hxx>
#include <BRepPrimAPI_MakeBox.hxx>
#include <BRepPrimAPI_MakeCylinder.hxx>
#include <BRepPrimAPI_MakeTorus.hxx>
#include <GeomAPI_Interpolate.hxx>
#include <TColgp_HArray1OfPnt.hxx>
#include <TopoDS_Edge.hxx>
#include <catch2/catch.hpp>
#include <cmath>
#include <gp_Ax2.hxx>
#include <numbers>

#include "known_parts.h"
#include "morph_case.h"
#include "surface_parts.h"
#include "triangulation.h"

using namespace cadmorph;
using namespace cadmorph::testing;
using Eigen::Vector2d;
using Eigen::Vector3d;
using std::numbers::pi;

namespace {

// A bent loft that tapers, with a hole across its middle, whose rims begin where a kernel began to
// trace them.
TopoDS_Shape stem(double length) {
  constexpr int kPoints = 24;
  BRepOffsetAPI_ThruSections loft(true);
  for (const double part : {0.0, 0.25, 0.5, 0.75, 1.0}) {
    const Handle(TColgp_HArray1OfPnt) points = new TColgp_HArray1OfPnt(1, kPoints);
    for (int i = 0; i < kPoints; ++i) {
      const double angle = 2 * pi * i / kPoints;
      points->SetValue(i + 1, {14 * part * part + 12 * (1 - 0.5 * part) * std::cos(angle),
                               9 * (1 - 0.3 * part) * std::sin(angle), part * length});
    }
    GeomAPI_Interpolate section(points, true, 1e-9);
    section.Perform();
    const TopoDS_Edge edge = BRepBuilderAPI_MakeEdge(section.Curve());
    loft.AddWire(BRepBuilderAPI_MakeWire(edge));
  }
  const gp_Ax2 across(gp_Pnt(4, -30, 0.55 * length), gp::DY());
  return BRepAlgoAPI_Cut(loft.Shape(), BRepPrimAPI_MakeCylinder(across, 3, 60).Shape());
}

}  // namespace

TEST_CASE(
    "the rims of a hole keep their angles about it, whatever an intersection's parameters are",
    "[surface][parameters]") {
  const auto drilled_ring = [](double tube) {
    const gp_Ax2 hole(gp_Pnt(19, 6, -20), gp_Dir(0, 0, 1), gp_Dir(1, 0, 0));
    return BRepAlgoAPI_Cut(BRepPrimAPI_MakeTorus(20, tube).Shape(),
                           BRepPrimAPI_MakeCylinder(hole, 2.5, 40).Shape())
        .Shape();
  };
  const TopoDS_Shape base = drilled_ring(6);
  const MorphCase c = mesh_case(to_model(base), triangulate(base, 0.02));
  const Points before = surface_points(c.boundary, c.mesh.points);
  const CadModel variant = to_model(drilled_ring(7.2));
  const double tolerance = std::max(largest_tolerance(*c.base), largest_tolerance(variant));
  const SurfaceMorphResult result = morph_surface(c, variant);
  int in_hole = 0;
  for (Index i = 0; i < before.rows(); ++i) {
    const Vector2d x = before.row(i).head<2>().transpose() - Vector2d(19, 6);
    if (std::abs(x.norm() - 2.5) > 10 * tolerance) continue;
    ++in_hole;
    const Vector2d y = result.positions.row(i).head<2>().transpose() - Vector2d(19, 6);
    CHECK((y - x).norm() < 10 * tolerance);
  }
  CHECK(in_hole > 20);
}

TEST_CASE("a hole that tilts is not twisted from one end to the other", "[surface][seam]") {
  // Two holes, tilted against each other; what is round about them turns one rim more than the
  // other.
  struct Holes {
    double radius, across, along;

    gp_Ax2 place(double side) const {
      const gp_Pnt middle(15 * side, 0, 15);
      gp_Ax2 axes(gp_Pnt(15 * side, 0, -30), gp_Dir(0, 0, 1), gp_Dir(1, 0, 0));
      axes.Rotate(gp_Ax1(middle, gp_Dir(1, 0, 0)), along);
      axes.Rotate(gp_Ax1(middle, gp_Dir(0, 1, 0)), -side * across);
      return axes;
    }

    TopoDS_Shape block() const {
      TopoDS_Shape shape = BRepPrimAPI_MakeBox(gp_Pnt(-30, -20, 0), gp_Pnt(30, 20, 30)).Shape();
      for (const double side : {-1.0, 1.0})
        shape = BRepAlgoAPI_Cut(shape, BRepPrimAPI_MakeCylinder(place(side), radius, 90).Shape())
                    .Shape();
      return shape;
    }

    /// About the hole from the seam of its wall, times the radius.
    Vector2d around(double side, const Vector3d& x) const {
      const gp_Ax2 axes = place(side);
      const gp_Vec from(axes.Location(), gp_Pnt(x.x(), x.y(), x.z()));
      return {from.Dot(gp_Vec(axes.XDirection())), from.Dot(gp_Vec(axes.YDirection()))};
    }
  };
  const Holes before{5, 20 * pi / 180, 0};
  const TopoDS_Shape base = before.block();
  const MorphCase c = mesh_case(to_model(base), triangulate(base, 0.02));
  const Points from = surface_points(c.boundary, c.mesh.points);
  for (const double along : {5, 8, 10, 12, 15}) {
    const Holes after{6, before.across, along * pi / 180};
    const SurfaceMorphResult result = morph_surface(c, to_model(after.block()));
    for (const double side : {-1.0, 1.0}) {
      double most = 0;
      int in_hole = 0;
      for (Index i = 0; i < from.rows(); ++i) {
        const Vector2d x = before.around(side, from.row(i));
        if (std::abs(x.norm() - before.radius) > 1e-6) continue;
        ++in_hole;
        const Vector2d y = after.around(side, result.positions.row(i));
        most = std::max(most, (y / after.radius - x / before.radius).norm());
      }
      CAPTURE(along, side);
      CHECK(in_hole > 20);
      CHECK(most < 1e-6);
    }
  }
}

TEST_CASE("a tilted hole does not turn with the seam of its wall", "[surface][seam]") {
  // As kernels choose the first axis of a cylinder by its direction: it jumps as the hole tilts.
  const auto plate = [](double tilt, double seam) {
    const gp_Dir along(std::sin(tilt), 0, std::cos(tilt));
    const gp_Ax1 axis(gp_Pnt(0, 0, 0), along);
    gp_Ax2 place(gp_Pnt(-60 * along.X(), 0, -60 * along.Z()), along,
                 gp_Dir(std::cos(tilt), 0, -std::sin(tilt)));
    place.Rotate(axis, seam);
    return BRepAlgoAPI_Cut(BRepPrimAPI_MakeBox(gp_Pnt(-40, -30, -10), gp_Pnt(40, 30, 10)).Shape(),
                           BRepPrimAPI_MakeCylinder(place, 3, 120).Shape())
        .Shape();
  };
  const TopoDS_Shape base = plate(0.17, 0);
  const MorphCase c = mesh_case(to_model(base), triangulate(base, 0.02));
  const Points before = surface_points(c.boundary, c.mesh.points);
  for (const double seam : {0.0, 0.5 * pi, pi}) {
    const SurfaceMorphResult result = morph_surface(c, to_model(plate(0.21, seam)));
    CAPTURE(seam);
    CHECK(largest_difference(result.positions, before) < 0.5);  // tan 0.21 - tan 0.17 is 0.04
  }
}

TEST_CASE("rims of a hole across a free form do not turn, wherever they begin", "[surface][seam]") {
  constexpr double kBefore = 80;
  const CadModel base = to_model(stem(kBefore));
  const auto is_traced = [](const CadEdge& edge) { return edge.is_free_form && !edge.is_seam; };
  REQUIRE(std::ranges::count_if(base.edges(), is_traced) == 6);  // two rims in two pieces each
  CHECK(base.skeleton().corners.empty());
  const MorphCase c = mesh_case(base, triangulate(stem(kBefore), 0.2));
  for (const double length : {72.0, 84.0, 88.0, 92.0, 100.0}) {
    const SurfaceMorphResult result = morph_surface(c, to_model(stem(length)));
    double most = 0;
    Index nodes = 0;
    for (std::size_t i = 0; i < c.boundary.nodes.size(); ++i) {
      const Vector3d from = c.mesh.points.row(c.boundary.nodes[i]), to = result.positions.row(i);
      const Eigen::Vector2d before(from.x() - 4, from.z() - 0.55 * kBefore),
          after(to.x() - 4, to.z() - 0.55 * length);
      if (std::abs(before.norm() - 3) > 1e-3) continue;
      ++nodes;
      most = std::max(most, (after.normalized() - before.normalized()).norm());
    }
    CAPTURE(length, nodes);
    CHECK(nodes > 30);
    CHECK(most < 0.002);
  }
}

TEST_CASE("a sheet's rim goes with the tube, whichever seams cut it", "[surface][seam]") {
  const KnownPart& part = known_part("welded_tubes");
  const TopoDS_Shape base = part.make(part.sizes).shape;
  const CadModel model = to_model(base);
  CHECK(model.skeleton().corners.empty());
  const MorphCase c = mesh_case(model, triangulate(base, 0.5));
  constexpr double kShift = -50;
  for (const double seam : {0.0, pi}) {
    Sizes sizes = part.sizes;
    sizes["x"] += kShift;
    sizes["seam"] = seam;
    const SurfaceMorphResult result = morph_surface(c, to_model(part.make(sizes).shape));
    double most = 0;
    Index nodes = 0;
    for (std::size_t i = 0; i < c.boundary.nodes.size(); ++i) {
      const Vector3d from = c.mesh.points.row(c.boundary.nodes[i]), to = result.positions.row(i);
      if (std::hypot(from.y(), from.z()) < sizes("radius") + 1e-3) continue;  // of the chord
      ++nodes;
      most = std::max(most, (to - from - Vector3d(kShift, 0, 0)).norm());
    }
    CAPTURE(seam, nodes);
    CHECK(nodes > 20);
    CHECK(most < 1e-6 * c.diagonal);  // the kernel's tolerance of intersections
  }
}

TEST_CASE("rims without a corner keep their sense and phase when what stands beside them moves",
          "[surface][seam]") {
  // A ring with a hole; a boss on it goes round. Nothing else is there to predict the rims from.
  const auto ring = [](double azimuth) {
    const auto pin = [](double at, double z, double radius, double height) {
      const gp_Pnt place(21 * std::cos(at), 21 * std::sin(at), z);
      return BRepPrimAPI_MakeCylinder(gp_Ax2(place, gp_Dir(0, 0, 1)), radius, height).Solid();
    };
    TopoDS_Shape part = BRepAlgoAPI_Cut(BRepPrimAPI_MakeCylinder(30, 20).Solid(),
                                        BRepPrimAPI_MakeCylinder(12, 20).Solid())
                            .Shape();
    part = BRepAlgoAPI_Cut(part, pin(1.97, -1, 4, 40)).Shape();
    return BRepAlgoAPI_Fuse(part, pin(azimuth, 10, 3, 16)).Shape();
  };
  const TopoDS_Shape base = ring(4.87);
  const MorphCase c = mesh_case(to_model(base), triangulate(base, 0.2));
  for (const double azimuth : {4.6, 5.2, 5.5}) {
    const SurfaceMorphResult result = morph_surface(c, to_model(ring(azimuth)));
    const Points before = surface_points(c.boundary, c.mesh.points);
    double moved = 0;
    for (Index n = 0; n < before.rows(); ++n) {
      const double radius = before.row(n).head<2>().norm();
      if (std::abs(radius - 30) < 1e-6 || std::abs(radius - 12) < 1e-6)
        moved = std::max(moved, (result.positions.row(n) - before.row(n)).norm());
    }
    CAPTURE(azimuth);
    CHECK(moved < 1e-9 * c.diagonal);
  }
}
