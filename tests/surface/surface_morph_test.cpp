#include <BRepPrimAPI_MakeCylinder.hxx>
#include <BRep_Builder.hxx>
#include <BRep_Tool.hxx>
#include <Geom2dAPI_Interpolate.hxx>
#include <Geom2d_BSplineCurve.hxx>
#include <TColStd_HArray1OfReal.hxx>
#include <TColgp_HArray1OfPnt2d.hxx>
#include <TopExp_Explorer.hxx>
#include <TopoDS.hxx>
#include <TopoDS_Edge.hxx>
#include <TopoDS_Face.hxx>
#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>

#include "cad/topology_match.h"
#include "core/parallel.h"
#include "morph_case.h"
#include "surface_parts.h"
#include "triangulation.h"
#include "warped_shape.h"

using namespace cadmorph;
using namespace cadmorph::testing;
using Eigen::Vector2d;
using Eigen::Vector3d;
using std::numbers::pi;

TEST_CASE("mid-side nodes of quadratic cells are carried by their own parameters",
          "[surface][quadratic]") {
  const MorphCase c = shape_case("cylinder_quadratic");
  const auto result = morph_surface(c, to_model(cylinder(22, 30)));
  const Points expected = moved_by(c, [](const Vector3d& x) -> Vector3d {
    return {x.x() * 22 / 15, x.y() * 22 / 15, x.z() * 30 / 40};
  });
  CHECK(largest_difference(result.positions, expected) <= kKnown * c.diagonal);
}

TEST_CASE("a shell mesh of a part is morphed by its surface alone", "[surface][shell]") {
  const TopoDS_Shape part = read_shape(model_file("shapes/bracket.step"));
  const MorphCase c = mesh_case(to_model(part), triangulate(part, 0.2));
  const gp_Trsf map = similarity(0.5, 1.7, gp_Vec(30, -20, 11));
  const Morphed m = morph(c, to_model(transformed(part, map)));
  const Points expected = images(c.mesh.points, [&](const Vector3d& x) { return apply(map, x); });
  CHECK(largest_difference(m.points, expected) <= kKnown * 1.7 * c.diagonal);
}

TEST_CASE("holes that move carry their own walls", "[surface][match]") {
  const std::vector<Vector2d> old_centres{{15, 15}, {15, 45}, {45, 15}, {45, 45}};
  const std::vector<Vector2d> new_centres{{16, 17}, {13, 44}, {46, 14}, {44, 47}};
  const TopoDS_Shape base = drilled_plate(60, 60, 10, 8, old_centres);
  const MorphCase c = mesh_case(to_model(base), triangulate(base, 0.2));
  const CadModel variant = to_model(drilled_plate(
      60, 60, 10, 7, {new_centres[2], new_centres[0], new_centres[3], new_centres[1]}));
  const auto result = morph_surface(c, variant);
  Index on_walls = 0;
  for (std::size_t i = 0; i < c.boundary.nodes.size(); ++i) {
    const Vector3d x = c.mesh.points.row(c.boundary.nodes[i]);
    for (int h = 0; h < 4; ++h) {
      const Vector2d from = x.head<2>() - old_centres[h];
      if (std::abs(from.norm() - 8) > 1e-6) continue;
      ++on_walls;
      const Vector2d at = new_centres[h] + from * 7 / 8;
      const Vector3d expected(at.x(), at.y(), x.z());
      CHECK((result.positions.row(static_cast<Index>(i)).transpose() - expected).norm() <=
            kKnown * c.diagonal);
    }
  }
  CHECK(on_walls > 100);
}

TEST_CASE("a pcurve that runs unevenly along its edge moves no node", "[surface][pcurves]") {
  const TopoDS_Shape even = BRepPrimAPI_MakeCylinder(15, 40).Solid();
  const TopoDS_Shape uneven = BRepPrimAPI_MakeCylinder(15, 40).Solid();
  const TopoDS_Face face =
      TopoDS::Face(TopExp_Explorer(uneven, TopAbs_FACE).Current().Oriented(TopAbs_FORWARD));
  for (TopExp_Explorer it(face, TopAbs_EDGE); it.More(); it.Next()) {
    const TopoDS_Edge edge = TopoDS::Edge(it.Current());
    if (BRep_Tool::IsClosed(edge, face)) continue;
    double first, last;
    const double v = BRep_Tool::CurveOnSurface(edge, face, first, last)->Value(first).Y();
    constexpr int n = 60;
    const Handle(TColgp_HArray1OfPnt2d) points = new TColgp_HArray1OfPnt2d(1, n + 1);
    const Handle(TColStd_HArray1OfReal) parameters = new TColStd_HArray1OfReal(1, n + 1);
    for (int i = 0; i <= n; ++i) {
      const double t = 2 * pi * i / n;
      points->SetValue(i + 1, gp_Pnt2d(t + 0.002 * std::sin(3 * t), v));
      parameters->SetValue(i + 1, t);
    }
    Geom2dAPI_Interpolate pcurve(points, parameters, false, 1e-12);
    pcurve.Perform();
    BRep_Builder().UpdateEdge(edge, pcurve.Curve(), face, 1e-7);
  }
  const auto bend = [](const Vector3d& x) -> Vector3d {
    return x + Vector3d(0.004 * x.z() * x.z(), 0, 0.05 * x.x());
  };
  const MorphCase c = mesh_case(to_model(uneven), triangulate(even, 0.1));
  const auto result = morph_surface(c, to_model(warped(even, bend)));
  const Points expected = images(surface_points(c.boundary, c.mesh.points), bend);
  CHECK(largest_difference(result.positions, expected) < 1e-6 * c.diagonal);
}

TEST_CASE("the surface is the same to the last bit on any number of threads",
          "[surface][parallel]") {
  const MorphCase c = file_case("bore/base.step", "bore/tet.vtu");
  const CadModel variant = to_model(read_shape(model_file("bore/step20.step")));
  std::vector<Points> results;
  for (const int threads : {1, 2, 3}) {
    set_thread_count(threads);
    results.push_back(morph_surface(c, variant).positions);
  }
  set_thread_count(0);
  CHECK(results[0] == results[1]);
  CHECK(results[0] == results[2]);
}

TEST_CASE("one surface morph serves any number of variants", "[surface]") {
  const MorphCase c = file_case("pipe/base.step", "pipe/tet.vtu");
  const SurfaceMorph surface(c.base, c.mesh, c.boundary);
  const CadModel near = to_model(read_shape(model_file("pipe/step05.step")));
  const CadModel far = to_model(read_shape(model_file("pipe/step20.step")));
  const auto first = surface.morph(far, match_topology(*c.base, far));
  surface.morph(near, match_topology(*c.base, near));
  const auto again = surface.morph(far, match_topology(*c.base, far));
  CHECK(first.positions == again.positions);
  CHECK(first.positions == morph_surface(c, far).positions);
}
