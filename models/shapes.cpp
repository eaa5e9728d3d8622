#include "models/shapes.h"

#include <BRepAlgoAPI_Cut.hxx>
#include <BRepAlgoAPI_Fuse.hxx>
#include <BRepBuilderAPI_MakeEdge.hxx>
#include <BRepBuilderAPI_MakeFace.hxx>
#include <BRepBuilderAPI_MakePolygon.hxx>
#include <BRepBuilderAPI_MakeWire.hxx>
#include <BRepFilletAPI_MakeFillet.hxx>
#include <BRepOffsetAPI_ThruSections.hxx>
#include <BRepPrimAPI_MakeBox.hxx>
#include <BRepPrimAPI_MakeCone.hxx>
#include <BRepPrimAPI_MakeCylinder.hxx>
#include <BRepPrimAPI_MakePrism.hxx>
#include <BRepPrimAPI_MakeRevol.hxx>
#include <BRepPrimAPI_MakeSphere.hxx>
#include <BRepPrimAPI_MakeTorus.hxx>
#include <BRep_Builder.hxx>
#include <BRep_Tool.hxx>
#include <GeomAPI_PointsToBSpline.hxx>
#include <Geom_BSplineCurve.hxx>
#include <TColgp_Array1OfPnt.hxx>
#include <TopExp.hxx>
#include <TopExp_Explorer.hxx>
#include <TopoDS.hxx>
#include <TopoDS_Compound.hxx>
#include <cmath>
#include <gp_Ax2.hxx>
#include <numbers>
#include <utility>

namespace cadmorph::models {
namespace {

using std::numbers::pi;

TopoDS_Shape make_box(double x, double y, double z) { return BRepPrimAPI_MakeBox(x, y, z).Solid(); }

TopoDS_Shape cylinder_at(double x, double y, double z, double radius, double height) {
  return BRepPrimAPI_MakeCylinder(gp_Ax2(gp_Pnt(x, y, z), gp_Dir(0, 0, 1)), radius, height).Solid();
}

/// A plate with `columns` x `rows` equal through-holes, evenly spaced.
TopoDS_Shape make_plate(double length, double width, double height, int columns, int rows,
                        double radius) {
  TopoDS_Shape plate = make_box(length, width, height);
  for (int i = 0; i < columns; ++i) {
    for (int j = 0; j < rows; ++j) {
      const double x = length * (i + 0.5) / columns, y = width * (j + 0.5) / rows;
      plate = BRepAlgoAPI_Cut(plate, cylinder_at(x, y, -1, radius, height + 2)).Shape();
    }
  }
  return plate;
}

using Outline = std::vector<std::pair<double, double>>;

/// The face inside a closed polygon in the xz plane.
TopoDS_Face polygon_face(const Outline& outline) {
  BRepBuilderAPI_MakePolygon polygon;
  for (const auto& [x, z] : outline) polygon.Add(gp_Pnt(x, 0, z));
  polygon.Close();
  return BRepBuilderAPI_MakeFace(polygon.Wire());
}

/// True for a straight edge along y whose middle is at (x, z).
bool is_along_y(const TopoDS_Edge& edge, double x, double z) {
  const gp_Pnt a = BRep_Tool::Pnt(TopExp::FirstVertex(edge));
  const gp_Pnt b = BRep_Tool::Pnt(TopExp::LastVertex(edge));
  return std::abs(a.Y() - b.Y()) > 1 && gp_Pnt(x, 0, z).Distance({a.X(), 0, a.Z()}) < 1e-6 &&
         gp_Pnt(x, 0, z).Distance({b.X(), 0, b.Z()}) < 1e-6;
}

/// An angle bracket with a hole in either leg; its inner corner, outer corner and one end rounded.
TopoDS_Shape make_bracket(double length, double inner_radius, double hole_radius) {
  const TopoDS_Shape angle = BRepPrimAPI_MakePrism(
      polygon_face({{0, 0}, {length, 0}, {length, 10}, {10, 10}, {10, 50}, {0, 50}}),
      gp_Vec(0, 30, 0));
  BRepFilletAPI_MakeFillet fillet(angle);
  for (TopExp_Explorer edge(angle, TopAbs_EDGE); edge.More(); edge.Next()) {
    const TopoDS_Edge current = TopoDS::Edge(edge.Current());
    if (current.Orientation() != TopAbs_FORWARD) continue;
    if (is_along_y(current, 10, 10)) fillet.Add(inner_radius, current);
    if (is_along_y(current, 0, 0)) fillet.Add(14, current);
    if (is_along_y(current, length, 10)) fillet.Add(4, current);
  }
  const TopoDS_Shape lower_hole = cylinder_at(40, 15, -1, hole_radius, 12);
  const TopoDS_Shape upper_hole =
      BRepPrimAPI_MakeCylinder(gp_Ax2(gp_Pnt(-1, 15, 34), gp_Dir(1, 0, 0)), 5, 12).Solid();
  return BRepAlgoAPI_Cut(BRepAlgoAPI_Cut(fillet.Shape(), lower_hole).Shape(), upper_hole).Shape();
}

/// A shaft along z with three diameters and a chamfer.
TopoDS_Shape make_stepped_shaft(double radius, double shoulder) {
  const Outline half = {{0, 0},        {9, 0},  {10, 1}, {10, 20}, {radius, 20}, {radius, shoulder},
                        {7, shoulder}, {7, 70}, {0, 70}};
  return BRepPrimAPI_MakeRevol(polygon_face(half), gp_Ax1(gp_Pnt(0, 0, 0), gp_Dir(0, 0, 1)))
      .Shape();
}

/// One side of a blade section: a NACA 4-digit half thickness over a circular-arc camber line, from
/// the trailing to the leading edge, turned by `stagger` and raised to `height`.
TopoDS_Edge section_side(double chord, double camber, double stagger, double height, double side) {
  constexpr int count = 17;
  TColgp_Array1OfPnt points(1, count);
  for (int i = 0; i < count; ++i) {
    const double t = 0.5 * (1 + std::cos(pi * i / (count - 1)));  // 1 at the trailing edge
    const double thickness = 0.9 * (0.2969 * std::sqrt(t) - 0.126 * t - 0.3516 * t * t +
                                    0.2843 * t * t * t - 0.1036 * t * t * t * t);
    const double x = chord * (t - 0.5);
    const double y = chord * (4 * camber * t * (1 - t) + side * thickness);
    points(i + 1) = gp_Pnt(x * std::cos(stagger) - y * std::sin(stagger),
                           x * std::sin(stagger) + y * std::cos(stagger), height);
  }
  return BRepBuilderAPI_MakeEdge(GeomAPI_PointsToBSpline(points, 3, 8, GeomAbs_C2, 1e-3).Curve());
}

/// A twisted blade: B-spline pressure and suction sides through four sections, planar ends.
TopoDS_Shape make_blade(double twist, double height_step) {
  BRepOffsetAPI_ThruSections loft(true, false);
  for (int i = 0; i < 4; ++i) {
    const double chord = 40 - 4 * i, camber = 0.12 - 0.02 * i, stagger = 0.2 + twist * i;
    const double height = height_step * i;
    const TopoDS_Edge upper = section_side(chord, camber, stagger, height, 1);
    const TopoDS_Edge lower = section_side(chord, camber, stagger, height, -1);
    BRepBuilderAPI_MakeWire wire(upper);
    wire.Add(TopoDS::Edge(lower.Reversed()));
    loft.AddWire(wire.Wire());
  }
  loft.Build();
  return loft.Shape();
}

/// Two blocks of one width side by side; either has its own copy of the face between them.
TopoDS_Shape make_two_blocks(double middle, double end) {
  TopoDS_Compound blocks;
  BRep_Builder builder;
  builder.MakeCompound(blocks);
  builder.Add(blocks, BRepPrimAPI_MakeBox(gp_Pnt(0, 0, 0), gp_Pnt(middle, 20, 20)).Solid());
  builder.Add(blocks, BRepPrimAPI_MakeBox(gp_Pnt(middle, 0, 0), gp_Pnt(end, 20, 20)).Solid());
  return blocks;
}

TopoDS_Shape make_sphere_in_box(double x, double radius) {
  const TopoDS_Shape sphere = BRepPrimAPI_MakeSphere(gp_Pnt(x, 30, 30), radius).Solid();
  return BRepAlgoAPI_Cut(make_box(60, 60, 60), sphere).Shape();
}

TopoDS_Shape sphere(double radius) { return BRepPrimAPI_MakeSphere(radius).Solid(); }

TopoDS_Shape torus(double major, double minor) {
  return BRepPrimAPI_MakeTorus(major, minor).Solid();
}

TopoDS_Shape cone(double bottom, double top, double height) {
  return BRepPrimAPI_MakeCone(bottom, top, height).Solid();
}

TopoDS_Shape cylinder(double radius, double height) {
  return BRepPrimAPI_MakeCylinder(radius, height).Solid();
}

}  // namespace

std::vector<SmallShape> make_small_shapes() {
  return {
      {"box", make_box(40, 30, 20), make_box(46, 27, 24), {.size = 5}},
      {"plate_12_holes",
       make_plate(120, 90, 12, 4, 3, 8),
       make_plate(120, 96, 14, 4, 3, 9.5),
       {.size = 7, .elements_per_turn = 12}},
      {"plate_4_holes",
       make_plate(60, 60, 10, 2, 2, 8),
       make_plate(64, 60, 12, 2, 2, 10),
       {.size = 6, .elements_per_turn = 12}},
      {"bracket",
       make_bracket(60, 8, 6),
       make_bracket(66, 10, 7),
       {.size = 5, .minimum_size = 2, .elements_per_turn = 14}},
      {"stepped_shaft",
       make_stepped_shaft(15, 45),
       make_stepped_shaft(18, 49),
       {.size = 4, .minimum_size = 1.5, .elements_per_turn = 16}},
      {"sphere", sphere(20), sphere(24), {.size = 4}},
      {"torus", torus(30, 10), torus(34, 12), {.size = 4.5}},
      {"cone_frustum", cone(20, 8, 30), cone(22, 6, 34), {.size = 4}},
      {"cone", cone(15, 0, 30), cone(18, 0, 27), {.size = 3.5}},
      {"cylinder", cylinder(15, 40), cylinder(18, 34), {.size = 4}},
      {"blade", make_blade(0.17, 25), make_blade(0.23, 28), {.size = 3.5}},
      {"two_blocks", make_two_blocks(30, 50), make_two_blocks(34, 56), {.size = 4}},
      {"sphere_in_box",
       make_sphere_in_box(30, 12),
       make_sphere_in_box(35, 14),
       {.size = 8, .elements_per_turn = 20}},
      {"sphere_far_field",
       sphere(10),
       sphere(13),
       {.size = 12, .elements_per_turn = 20, .far_field_width = 80}},
      {"cylinder_quadratic", cylinder(15, 40), cylinder(18, 34), {.size = 8, .order = 2}},
  };
}

}  // namespace cadmorph::models
