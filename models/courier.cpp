#include "models/courier.h"

#include <BRepAlgoAPI_Cut.hxx>
#include <BRepAlgoAPI_Fuse.hxx>
#include <BRepBuilderAPI_MakeEdge.hxx>
#include <BRepBuilderAPI_MakeFace.hxx>
#include <BRepBuilderAPI_MakeVertex.hxx>
#include <BRepBuilderAPI_MakeWire.hxx>
#include <BRepExtrema_DistShapeShape.hxx>
#include <BRepFilletAPI_MakeFillet.hxx>
#include <BRepPrimAPI_MakeCylinder.hxx>
#include <BRepPrimAPI_MakePrism.hxx>
#include <GC_MakeArcOfCircle.hxx>
#include <TopExp_Explorer.hxx>
#include <TopoDS.hxx>
#include <gp_Ax2.hxx>

#include "models/courier_parameters.h"

namespace cadmorph::models {
namespace {

using std::numbers::pi;

TopoDS_Edge make_edge(const PlanCurve& curve, double z) {
  const auto at = [&](double t) { return gp_Pnt(curve.at(t)[0], curve.at(t)[1], z); };
  if (curve.sweep == 0) return BRepBuilderAPI_MakeEdge(at(0), at(1));
  return BRepBuilderAPI_MakeEdge(GC_MakeArcOfCircle(at(0), at(0.5), at(1)).Value());
}

TopoDS_Shape prism(const std::vector<PlanCurve>& outline, double bottom, double top) {
  BRepBuilderAPI_MakeWire wire;
  for (const PlanCurve& curve : outline) wire.Add(make_edge(curve, bottom));
  return BRepPrimAPI_MakePrism(BRepBuilderAPI_MakeFace(wire.Wire()), gp_Vec(0, 0, top - bottom));
}

TopoDS_Shape cylinder(const Point2& centre, double radius, double bottom, double top) {
  return BRepPrimAPI_MakeCylinder(gp_Ax2(gp_Pnt(centre[0], centre[1], bottom), gp_Dir(0, 0, 1)),
                                  radius, top - bottom);
}

/// The edge of `shape` nearest to `point`.
TopoDS_Edge edge_at(const TopoDS_Shape& shape, const gp_Pnt& point) {
  const TopoDS_Shape vertex = BRepBuilderAPI_MakeVertex(point).Shape();
  TopoDS_Edge nearest;
  double least = INFINITY;
  for (TopExp_Explorer edge(shape, TopAbs_EDGE); edge.More(); edge.Next()) {
    const double distance = BRepExtrema_DistShapeShape(vertex, edge.Current()).Value();
    if (distance >= least) continue;
    least = distance;
    nearest = TopoDS::Edge(edge.Current());
  }
  return nearest;
}

/// Pan and flange with their four bends.
TopoDS_Shape make_pan(const CourierParameters& p) {
  const auto box = [&](double distance, double bottom, double top) {
    return prism(rounded_rectangle(p.corner_x, p.corner_y, distance), bottom, top);
  };
  const double under_flange = p.height - p.thickness;
  const TopoDS_Shape outside = BRepAlgoAPI_Fuse(box(p.wall, 0, under_flange + p.thickness / 2),
                                                box(p.flange, under_flange, p.height))
                                   .Shape();
  const TopoDS_Shape pan =
      BRepAlgoAPI_Cut(outside, box(p.wall_inside(), p.thickness, p.height + 1)).Shape();
  BRepFilletAPI_MakeFillet fillet(pan);
  const auto round = [&](double radius, double distance, double z) {
    fillet.Add(radius, edge_at(pan, gp_Pnt(p.corner_x + distance, 0, z)));
  };
  round(p.foot_outer_bend(), p.wall, 0);
  round(p.foot_bend, p.wall_inside(), p.thickness);
  round(p.neck_bend, p.wall, under_flange);
  round(p.neck_outer_bend(), p.wall_inside(), p.height);
  return fillet.Shape();
}

TopoDS_Shape add_bosses(const CourierParameters& p, TopoDS_Shape part) {
  for (const Point2& centre : mirrored({p.boss_x, p.boss_y})) {
    part = BRepAlgoAPI_Fuse(part, cylinder(centre, p.boss, p.thickness / 2, p.boss_top)).Shape();
  }
  BRepFilletAPI_MakeFillet fillet(part);
  for (const Point2& centre : mirrored({p.boss_x, p.boss_y})) {
    const Point2 rim = polar(centre, p.boss, 1);  // away from the seam
    fillet.Add(p.boss_fillet, edge_at(part, gp_Pnt(rim[0], rim[1], p.thickness)));
  }
  return fillet.Shape();
}

TopoDS_Shape drill(const CourierParameters& p, TopoDS_Shape part) {
  const auto drill_at = [&](const Point2& centre, double radius) {
    part = BRepAlgoAPI_Cut(part, cylinder(centre, radius, -1, p.height + 1)).Shape();
  };
  drill_at({0, 0}, p.hub_hole);
  for (const Point2& centre : mirrored({p.boss_x, p.boss_y})) drill_at(centre, p.boss_hole);
  for (const Point2& centre : mirrored({p.hole_x, p.hole_y})) drill_at(centre, p.hole);
  for (const Point2& centre : bolt_centres(p)) drill_at(centre, p.bolt);
  return part;
}

}  // namespace

std::array<Point2, 4> mirrored(const Point2& first) {
  const double x = first[0], y = first[1];
  return {Point2(x, y), Point2(-x, y), Point2(-x, -y), Point2(x, -y)};
}

std::vector<Point2> bolt_centres(const CourierParameters& p) {
  std::vector<Point2> centres;
  const double distance = p.bolt_distance();
  for (int corner = 0; corner < 4; ++corner) {
    centres.push_back(
        polar(mirrored({p.corner_x, p.corner_y})[corner], distance, pi / 4 + corner * pi / 2));
  }
  for (const double side : {1., -1.}) {
    centres.emplace_back(side * (p.corner_x + distance), 0);
    centres.emplace_back(0, side * (p.corner_y + distance));
  }
  return centres;
}

std::vector<PlanCurve> rib_outline(const CourierParameters& p) {
  const double w = p.rib_half_width, f = p.rib_fillet;
  const double x = std::sqrt((p.hub + f) * (p.hub + f) - (w + f) * (w + f));  // fillet's centre
  const double beta = std::atan2(w + f, x);
  std::vector<PlanCurve> outline;
  for (int rib = 0; rib < 4; ++rib) {
    const double direction = p.rib_turn_deg * pi / 180 + rib * pi / 2;
    const double end = (rib % 2 == 0 ? p.rib_reach_x : p.rib_reach_y) - w;
    const Eigen::Rotation2Dd turn(direction);
    const auto arc = [&](const Point2& centre, double radius, double from, double to) {
      outline.push_back(plan_arc(turn * centre, radius, from + direction, to + direction));
    };
    const auto line = [&](const Point2& a, const Point2& b) {
      outline.push_back({turn * a, turn * b});
    };
    arc({x, -w - f}, f, pi - beta, pi / 2);
    line({x, -w}, {end, -w});
    arc({end, 0}, w, -pi / 2, pi / 2);
    line({end, w}, {x, w});
    arc({x, w + f}, f, -pi / 2, beta - pi);
    arc({0, 0}, p.hub, beta, pi / 2 - beta);
  }
  return outline;
}

TopoDS_Shape make_courier(double change) {
  const CourierParameters p = courier_parameters(change);
  TopoDS_Shape part = add_bosses(p, make_pan(p));
  part = BRepAlgoAPI_Fuse(part, prism(rib_outline(p), p.thickness / 2, p.rib_top)).Shape();
  part = BRepAlgoAPI_Fuse(part, cylinder({0, 0}, p.collar, p.thickness / 2, p.collar_top)).Shape();
  return drill(p, part);
}

}  // namespace cadmorph::models
