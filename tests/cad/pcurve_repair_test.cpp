#include <BRepPrimAPI_MakeCylinder.hxx>
#include <BRepPrimAPI_MakeSphere.hxx>
#include <BRepPrimAPI_MakeTorus.hxx>
#include <BRep_Builder.hxx>
#include <BRep_Tool.hxx>
#include <Geom2dAPI_Interpolate.hxx>
#include <Geom2d_BSplineCurve.hxx>
#include <Geom2d_Line.hxx>
#include <TColStd_HArray1OfReal.hxx>
#include <TColgp_HArray1OfPnt2d.hxx>
#include <TopExp.hxx>
#include <TopExp_Explorer.hxx>
#include <TopoDS.hxx>
#include <TopoDS_Edge.hxx>
#include <TopoDS_Face.hxx>
#include <TopoDS_Wire.hxx>
#include <catch2/catch.hpp>
#include <cmath>
#include <functional>
#include <numbers>

#include "cad_variants.h"
#include "warped_shape.h"

using namespace cadmorph;
using namespace cadmorph::testing;
using Eigen::Vector2d;
using Eigen::Vector3d;
using std::numbers::pi;

namespace {

/// The lateral face of a cylinder of radius 5 and height 8: analytic and periodic, or a B-spline
/// that isn't, in the same parameters.
TopoDS_Face tube(bool is_spline) {
  TopoDS_Shape shape = BRepPrimAPI_MakeCylinder(5, 8).Solid();
  if (is_spline) shape = warped(shape, [](const Vector3d& x) { return x; });
  return TopoDS::Face(
      TopoDS::Face(TopExp_Explorer(shape, TopAbs_FACE).Current()).Oriented(TopAbs_FORWARD));
}

Vector2d value(const Handle(Geom2d_Curve) & curve, double t) {
  const gp_Pnt2d p = curve->Value(t);
  return {p.X(), p.Y()};
}

Handle(Geom2d_Curve) line(const Vector2d& from, const Vector2d& to) {
  return new Geom2d_Line(gp_Pnt2d(from.x(), from.y()),
                         gp_Dir2d(to.x() - from.x(), to.y() - from.y()));
}

/// The curve through `count` values at equal steps of [first, last].
Handle(Geom2d_Curve)
    through(double first, double last, int count, const std::function<Vector2d(double)>& at) {
  const Handle(TColgp_HArray1OfPnt2d) points = new TColgp_HArray1OfPnt2d(1, count);
  const Handle(TColStd_HArray1OfReal) parameters = new TColStd_HArray1OfReal(1, count);
  for (int i = 0; i < count; ++i) {
    const double t = first + (last - first) * i / (count - 1);
    points->SetValue(i + 1, gp_Pnt2d(at(t).x(), at(t).y()));
    parameters->SetValue(i + 1, t);
  }
  Geom2dAPI_Interpolate curve(points, parameters, false, 1e-12);
  curve.Perform();
  return Handle(Geom2d_Curve)(curve.Curve());
}

std::vector<TopoDS_Edge> edges_of(const TopoDS_Face& face) {
  std::vector<TopoDS_Edge> edges;
  for (TopExp_Explorer it(face, TopAbs_EDGE); it.More(); it.Next())
    edges.push_back(TopoDS::Edge(it.Current()));
  return edges;
}

TopoDS_Edge circle(const TopoDS_Face& face, double z) {
  for (const TopoDS_Edge& edge : edges_of(face)) {
    double first, last;
    const Handle(Geom_Curve) curve = BRep_Tool::Curve(edge, first, last);
    if (!BRep_Tool::IsClosed(edge, face) && std::abs(curve->Value(first).Z() - z) < 1e-6)
      return edge;
  }
  throw std::logic_error("no circle there");
}

/// The distance of the pcurves of all edges from their edges, in their inner parts.
double worst_deviation(const CadModel& model) {
  double worst = 0;
  for (const CoedgeId c : model.coedges().ids()) {
    const CadCoedge& use = model.coedges()[c];
    const CadEdge& edge = model.edges()[use.edge];
    for (int i = 1; i < 40; ++i) {
      const double t = edge.first + (edge.last - edge.first) * i / 40;
      const Vector3d on_edge = edge.is_degenerate ? model.vertices()[edge.start].point
                                                  : model.evaluate_edge(use.edge, t).point;
      worst =
          std::max(worst, (model.evaluate(use.face, model.pcurve(c, t)).point - on_edge).norm());
    }
  }
  return worst;
}

void check_tube(const TopoDS_Face& face) {
  const CadModel model = to_model(face);
  REQUIRE(model.faces().size() == 1);
  const CadFace& f = model.faces()[FaceId(0)];
  CHECK(f.period[0] == Approx(2 * pi).margin(1e-5));
  CHECK(f.period[1] == 0);
  CHECK(f.upper[0] - f.lower[0] == Approx(2 * pi).margin(1e-5));
  for (const double u : {0.3, 2.0, 4.0, 6.0}) {
    CHECK(model.is_inside(FaceId(0), {u, 4}));
    CHECK(!model.is_inside(FaceId(0), {u, 9}));
  }
  CHECK(f.wires.size() == 1);
  CHECK(f.wires[0].size() == 4);
  CHECK(worst_deviation(model) < 1e-5);
}

}  // namespace

TEST_CASE("a seam with both pcurves on one side is found by the surface", "[cad][pcurves]") {
  for (const bool is_spline : {false, true})
    for (const double side : {0.0, 2 * pi}) {
      DYNAMIC_SECTION((is_spline ? "B-spline " : "analytic ") << side) {
        const TopoDS_Face face = tube(is_spline);
        for (const TopoDS_Edge& edge : edges_of(face)) {
          if (!BRep_Tool::IsClosed(edge, face)) continue;
          const Handle(Geom2d_Curve) up = line({side, 0}, {side, 1});
          BRep_Builder().UpdateEdge(edge, up, up, face, 1e-7);
        }
        check_tube(face);
      }
    }
}

TEST_CASE("wires that lie a period apart and are joined by edges of no length are put together",
          "[cad][pcurves]") {
  for (const int periods : {1, -2}) {
    DYNAMIC_SECTION(periods << " periods") {
      const TopoDS_Face old = tube(false);
      const TopoDS_Edge top = circle(old, 8);
      const double shift = 2 * pi * periods;
      BRep_Builder builder;
      builder.UpdateEdge(top, line({shift, 8}, {shift + 1, 8}), old, 1e-7);
      TopoDS_Face face;
      builder.MakeFace(face, BRep_Tool::Surface(old), 1e-7);
      TopoDS_Wire wire;
      builder.MakeWire(wire);
      for (const TopoDS_Edge& edge : edges_of(old)) {
        const auto link = [&](double from, double to) {
          TopoDS_Edge none;
          builder.MakeEdge(none);
          builder.UpdateEdge(none, line({from, 8}, {to, 8}), face, 1e-7);
          builder.Range(none, 0, std::abs(to - from));
          builder.Degenerated(none, true);
          const TopoDS_Vertex end = TopExp::FirstVertex(top);
          builder.Add(none, end.Oriented(TopAbs_FORWARD));
          builder.Add(none, end.Oriented(TopAbs_REVERSED));
          builder.Add(wire, none);
        };
        double first, last;
        if (BRep_Tool::IsClosed(edge, old)) {
          const auto up = BRep_Tool::CurveOnSurface(TopoDS::Edge(edge.Oriented(TopAbs_FORWARD)),
                                                    old, first, last);
          const auto down = BRep_Tool::CurveOnSurface(TopoDS::Edge(edge.Oriented(TopAbs_REVERSED)),
                                                      old, first, last);
          builder.UpdateEdge(edge, up, down, face, 1e-7);
        } else {
          builder.UpdateEdge(edge, BRep_Tool::CurveOnSurface(edge, old, first, last), face, 1e-7);
        }
        const bool runs_back = edge.Orientation() == TopAbs_REVERSED;
        if (edge.IsSame(top)) link(runs_back ? 2 * pi : 0, shift + (runs_back ? 2 * pi : 0));
        builder.Add(wire, edge);
        if (edge.IsSame(top)) link(shift + (runs_back ? 0 : 2 * pi), runs_back ? 0 : 2 * pi);
      }
      builder.Add(face, wire);
      check_tube(face);
    }
  }
}

TEST_CASE("both seams of a torus on the wrong sides are put right", "[cad][pcurves]") {
  const TopoDS_Shape torus = BRepPrimAPI_MakeTorus(20, 6).Solid();
  const TopoDS_Face face =
      TopoDS::Face(TopExp_Explorer(torus, TopAbs_FACE).Current().Oriented(TopAbs_FORWARD));
  for (const TopoDS_Edge& edge : edges_of(face)) {
    if (edge.Orientation() == TopAbs_REVERSED) continue;
    double first, last;
    const auto one = BRep_Tool::CurveOnSurface(edge, face, first, last);
    const auto two = BRep_Tool::CurveOnSurface(TopoDS::Edge(edge.Reversed()), face, first, last);
    BRep_Builder().UpdateEdge(edge, two, one, face, 1e-7);
  }
  const CadModel model = to_model(face);
  CHECK(model.is_inside(FaceId(0), {1, 2}));
  CHECK(model.diagonal() == Approx(std::hypot(52, 52, 12)).epsilon(1e-3));
}

TEST_CASE("a pcurve that leaves its edge is made anew", "[cad][pcurves]") {
  for (const bool is_spline : {false, true}) {
    DYNAMIC_SECTION((is_spline ? "B-spline" : "analytic")) {
      const TopoDS_Face face = tube(is_spline);
      const TopoDS_Edge top = circle(face, 8);
      // Starts a period away and overshoots, as an interpolation through a wrong first point does.
      const auto wrong =
          through(0, 2 * pi, 25, [](double t) { return Vector2d(t == 0 ? 2 * pi : t, 8); });
      BRep_Builder().UpdateEdge(top, wrong, face, 1e-7);
      check_tube(face);
    }
  }
}

TEST_CASE("at a pole the edges beside it tell the parameters", "[cad][pcurves][pole]") {
  const TopoDS_Shape octant = BRepPrimAPI_MakeSphere(10, 0, pi / 2, pi / 2).Solid();
  const TopoDS_Face face =
      TopoDS::Face(TopExp_Explorer(octant, TopAbs_FACE).Current().Oriented(TopAbs_FORWARD));
  REQUIRE(to_model(face).faces()[FaceId(0)].type == SurfaceType::Sphere);
  int blurred = 0;
  for (const TopoDS_Edge& edge : edges_of(face)) {
    double first, last;
    const auto curve = BRep_Tool::CurveOnSurface(edge, face, first, last);
    const Vector2d from = value(curve, first), to = value(curve, last);
    if (BRep_Tool::Degenerated(edge)) {
      BRep_Builder().UpdateEdge(
          edge,
          through(first, last, 2,
                  [&](double t) { return Vector2d(0.1 + 0.9 * value(curve, t).x(), pi / 2); }),
          face, 1e-7);
    } else if (std::abs(from.x() - to.x()) < 1e-9) {
      // Right but at the pole itself and very near.
      const auto wrong = through(first, last, 400, [&](double t) {
        const Vector2d uv = value(curve, t);
        return Vector2d(uv.y() > pi / 2 - 1e-6 ? 0.1 + 0.9 * uv.x() : uv.x(), uv.y());
      });
      BRep_Builder().UpdateEdge(edge, wrong, face, 1e-7);
      ++blurred;
    }
  }
  REQUIRE(blurred == 2);
  const CadModel model = to_model(face);
  for (const CoedgeId c : model.coedges().ids()) {
    const CadEdge& edge = model.edges()[model.coedges()[c].edge];
    for (const double t : {edge.first, edge.last}) {
      const double u = model.pcurve(c, t).x();
      CHECK(std::min(std::abs(u), std::abs(u - pi / 2)) < 1e-6);
    }
  }
}
