#include <BRepAlgoAPI_Common.hxx>
#include <BRepBuilderAPI_MakeEdge.hxx>
#include <BRepBuilderAPI_MakeWire.hxx>
#include <BRepOffsetAPI_ThruSections.hxx>
#include <BRepPrimAPI_MakeBox.hxx>
#include <GeomAPI_Interpolate.hxx>
#include <TColgp_HArray1OfPnt.hxx>
#include <TopoDS_Edge.hxx>
#include <catch2/catch.hpp>
#include <cmath>
#include <gp_Ax2.hxx>
#include <numbers>

#include "morph_case.h"
#include "triangulation.h"

using namespace cadmorph;
using namespace cadmorph::testing;
using std::numbers::pi;

namespace {

// A loft of three equal profiles, round at (-20, 1.5) and sharper at (20, 1.5), whose spline starts
// at a point of 40.
TopoDS_Shape blade(int start, double thickness) {
  constexpr int kPoints = 40;
  BRepOffsetAPI_ThruSections loft(true);
  for (const double height : {0.0, 15.0, 30.0}) {
    const Handle(TColgp_HArray1OfPnt) points = new TColgp_HArray1OfPnt(1, kPoints);
    for (int i = 0; i < kPoints; ++i) {
      const double angle = 2 * pi * (i + start) / kPoints, x = std::cos(angle);
      const double y = thickness * std::sin(angle) * (1 - 0.6 * x) + 1.5 * x * x;
      points->SetValue(i + 1, {20 * x, y, height});
    }
    GeomAPI_Interpolate section(points, true, 1e-9);
    section.Perform();
    const TopoDS_Edge edge = BRepBuilderAPI_MakeEdge(section.Curve());
    loft.AddWire(BRepBuilderAPI_MakeWire(edge));
  }
  return loft.Shape();
}

}  // namespace

TEST_CASE("a blade keeps its leading edge when its section starts elsewhere and changes",
          "[surface][seam]") {
  const TopoDS_Shape base = blade(0, 3);
  const MorphCase c = mesh_case(to_model(base), triangulate(base, 0.1));
  const Points before = surface_points(c.boundary, c.mesh.points);
  for (const int start : {0, 2, 5, 16}) {
    CAPTURE(start);
    const SurfaceMorphResult result = morph_surface(c, to_model(blade(start, 4)));
    // The thicker section is up to 1.4 farther out; along it nodes go a little as well.
    CHECK(largest_difference(result.positions, before) < 2);
  }
}

TEST_CASE("a blade keeps its leading edge where what cuts it moves along it", "[surface]") {
  // As the halves of a cylinder cut a blade that stands on it: the thicker it is, the farther the
  // slanted cut runs along its sides, from one towards the nose and from the other away.
  const auto cut = [](double thickness) {
    const gp_Ax2 slanted(gp_Pnt(-45, -30, -1), gp_Dir(0, 0, 1), gp_Dir(1.5, 1, 0));
    return BRepAlgoAPI_Common(blade(0, thickness),
                              BRepPrimAPI_MakeBox(slanted, 100, 60, 60).Shape())
        .Shape();
  };
  const TopoDS_Shape base = cut(3);
  const MorphCase c = mesh_case(to_model(base), triangulate(base, 0.1, 0.1));
  const Points before = surface_points(c.boundary, c.mesh.points);
  const SurfaceMorphResult result = morph_surface(c, to_model(cut(3.6)));
  int at_nose = 0;
  for (Index i = 0; i < before.rows(); ++i) {
    if (before(i, 0) > -19.99) continue;
    ++at_nose;
    // 0.75 by parameters, on a nose of 1.2 in radius.
    CHECK((result.positions.row(i) - before.row(i)).norm() < 0.35);
  }
  CHECK(at_nose > 6);
}
