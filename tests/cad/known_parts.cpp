#include "known_parts.h"

#include <BOPAlgo_Builder.hxx>
#include <BRepAlgoAPI_Cut.hxx>
#include <BRepAlgoAPI_Fuse.hxx>
#include <BRepBuilderAPI_MakeEdge.hxx>
#include <BRepBuilderAPI_MakeFace.hxx>
#include <BRepBuilderAPI_MakePolygon.hxx>
#include <BRepBuilderAPI_MakeWire.hxx>
#include <BRepBuilderAPI_Transform.hxx>
#include <BRepFilletAPI_MakeChamfer.hxx>
#include <BRepFilletAPI_MakeFillet.hxx>
#include <BRepOffsetAPI_MakePipe.hxx>
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
#include <GC_MakeArcOfCircle.hxx>
#include <GeomAPI_Interpolate.hxx>
#include <Geom_BSplineCurve.hxx>
#include <NCollection_DataMap.hxx>
#include <TColgp_HArray1OfPnt.hxx>
#include <TopExp.hxx>
#include <TopTools_IndexedDataMapOfShapeListOfShape.hxx>
#include <TopTools_IndexedMapOfShape.hxx>
#include <TopTools_ListOfShape.hxx>
#include <TopTools_ShapeMapHasher.hxx>
#include <TopoDS.hxx>
#include <TopoDS_Compound.hxx>
#include <TopoDS_Edge.hxx>
#include <TopoDS_Face.hxx>
#include <TopoDS_Vertex.hxx>
#include <algorithm>
#include <cmath>
#include <gp_Circ.hxx>
#include <numbers>
#include <set>
#include <stdexcept>

namespace cadmorph::testing {
namespace {

using std::numbers::pi;
using Outline = std::vector<std::pair<double, double>>;

std::vector<TopoDS_Shape> parts_of(const TopoDS_Shape& shape, TopAbs_ShapeEnum kind) {
  TopTools_IndexedMapOfShape map;
  TopExp::MapShapes(shape, kind, map);
  std::vector<TopoDS_Shape> parts;
  for (int i = 1; i <= map.Extent(); ++i) parts.push_back(map(i));
  return parts;
}

std::vector<TopoDS_Shape> faces_of(const TopoDS_Shape& shape) {
  return parts_of(shape, TopAbs_FACE);
}

using FaceNames = NCollection_DataMap<TopoDS_Shape, std::string, TopTools_ShapeMapHasher>;

/// Names faces that an operation made, such as fillets, by the faces round about.
void name_others(const TopoDS_Shape& shape, FaceNames& names) {
  TopTools_IndexedDataMapOfShapeListOfShape faces_of_edge;
  TopExp::MapShapesAndAncestors(shape, TopAbs_EDGE, TopAbs_FACE, faces_of_edge);
  std::vector<std::pair<TopoDS_Shape, std::string>> found;
  do {
    for (const auto& [face, name] : found) names.Bind(face, name);
    found.clear();
    for (const TopoDS_Shape& face : faces_of(shape)) {
      if (names.IsBound(face)) continue;
      std::set<std::string> around;
      for (const TopoDS_Shape& edge : parts_of(face, TopAbs_EDGE))
        for (const TopoDS_Shape& other : faces_of_edge.FindFromKey(edge))
          if (names.IsBound(other)) around.insert(names.Find(other));
      std::string name;
      for (const std::string& other : around) name += '(' + other + ')';
      if (!name.empty()) found.emplace_back(face, name);
    }
  } while (!found.empty());
}

NamedShape named(const TopoDS_Shape& shape, FaceNames names) {
  name_others(shape, names);
  NamedShape result{shape, {}};
  for (const TopoDS_Shape& face : faces_of(shape)) result.names.push_back(names.Find(face));
  return result;
}

NamedShape made(const std::string& name, const TopoDS_Shape& shape) {
  NamedShape result{shape, {}};
  for (std::size_t f = 0; f < faces_of(shape).size(); ++f)
    result.names.push_back(name + '.' + std::to_string(f + 1));
  return result;
}

template <class Operation>
NamedShape followed(Operation& operation, const std::vector<NamedShape>& from) {
  FaceNames names;
  for (const NamedShape& one : from) {
    const auto faces = faces_of(one.shape);
    for (std::size_t f = 0; f < faces.size(); ++f) {
      if (operation.IsDeleted(faces[f])) continue;
      TopTools_ListOfShape images = operation.Modified(faces[f]);
      if (images.IsEmpty()) images.Append(faces[f]);
      for (const TopoDS_Shape& image : images)
        if (!names.IsBound(image)) names.Bind(image, one.names[f]);
    }
  }
  return named(operation.Shape(), names);
}

template <class Operation>
NamedShape combined(const NamedShape& body, const std::vector<NamedShape>& tools) {
  TopTools_ListOfShape bodies, others;
  bodies.Append(body.shape);
  std::vector<NamedShape> all{body};
  for (const NamedShape& tool : tools) {
    others.Append(tool.shape);
    all.push_back(tool);
  }
  Operation operation;
  operation.SetArguments(bodies);
  operation.SetTools(others);
  operation.Build();
  return followed(operation, all);
}

NamedShape cut(const NamedShape& body, const std::vector<NamedShape>& tools) {
  return combined<BRepAlgoAPI_Cut>(body, tools);
}

NamedShape fuse(const NamedShape& body, const std::vector<NamedShape>& tools) {
  return combined<BRepAlgoAPI_Fuse>(body, tools);
}

/// Solids side by side, nothing shared.
NamedShape together(const std::vector<NamedShape>& solids) {
  TopoDS_Compound all;
  BRep_Builder().MakeCompound(all);
  NamedShape result;
  for (const NamedShape& solid : solids) {
    BRep_Builder().Add(all, solid.shape);
    result.names.insert(result.names.end(), solid.names.begin(), solid.names.end());
  }
  result.shape = all;
  return result;
}

/// Solids that share the faces in which they touch.
NamedShape glued(const std::vector<NamedShape>& solids) {
  BOPAlgo_Builder builder;
  for (const NamedShape& solid : solids) builder.AddArgument(solid.shape);
  builder.Perform();
  return followed(builder, solids);
}

using IsWanted = std::function<bool(const TopoDS_Edge&)>;

bool is_any(const TopoDS_Edge&) { return true; }

bool is_upright(const TopoDS_Edge& edge) {
  TopoDS_Vertex a, b;
  TopExp::Vertices(edge, a, b);
  return gp_Vec(BRep_Tool::Pnt(a), BRep_Tool::Pnt(b)).IsParallel(gp_Vec(0, 0, 1), 1e-6);
}

template <class Operation>
NamedShape dressed(const NamedShape& body, double size, const IsWanted& is_wanted) {
  Operation operation(body.shape);
  for (const TopoDS_Shape& edge : parts_of(body.shape, TopAbs_EDGE))
    if (is_wanted(TopoDS::Edge(edge))) operation.Add(size, TopoDS::Edge(edge));
  operation.Build();
  return followed(operation, {body});
}

NamedShape filleted(const NamedShape& body, double radius, const IsWanted& is_wanted) {
  return dressed<BRepFilletAPI_MakeFillet>(body, radius, is_wanted);
}

NamedShape chamfered(const NamedShape& body, double size, const IsWanted& is_wanted) {
  return dressed<BRepFilletAPI_MakeChamfer>(body, size, is_wanted);
}

/// Axes at a place, the first one (where seams lie) turned by `seam` about the direction.
gp_Ax2 axes(const gp_Pnt& at, const gp_Dir& along, double seam = 0) {
  gp_Ax2 result(at, along);
  if (along.IsEqual(gp::DZ(), 1e-12)) result = gp_Ax2(at, along, gp::DX());
  result.Rotate(gp_Ax1(at, along), seam);
  return result;
}

gp_Ax2 upright(double x, double y, double z, double seam = 0) {
  return axes(gp_Pnt(x, y, z), gp::DZ(), seam);
}

NamedShape box(const std::string& name, const gp_Pnt& from, const gp_Pnt& to) {
  return made(name, BRepPrimAPI_MakeBox(from, to).Solid());
}

NamedShape rod(const std::string& name, const gp_Ax2& at, double radius, double length) {
  return made(name, BRepPrimAPI_MakeCylinder(at, radius, length).Solid());
}

NamedShape cone(const std::string& name, const gp_Ax2& at, double from, double to, double length) {
  return made(name, BRepPrimAPI_MakeCone(at, from, to, length).Solid());
}

NamedShape ball(const std::string& name, const gp_Ax2& at, double radius) {
  return made(name, BRepPrimAPI_MakeSphere(at, radius).Solid());
}

TopoDS_Face polygon(const Outline& outline, const std::function<gp_Pnt(double, double)>& place) {
  BRepBuilderAPI_MakePolygon wire;
  for (const auto& [x, y] : outline) wire.Add(place(x, y));
  wire.Close();
  return BRepBuilderAPI_MakeFace(wire.Wire());
}

/// Outline in x and y.
NamedShape extruded(const std::string& name, const Outline& outline, double height) {
  const TopoDS_Face face = polygon(outline, [](double x, double y) { return gp_Pnt(x, y, 0); });
  return made(name, BRepPrimAPI_MakePrism(face, gp_Vec(0, 0, height)).Shape());
}

/// Outline in radius and height.
NamedShape revolved(const std::string& name, const Outline& outline, double seam,
                    double angle = 2 * pi) {
  const TopoDS_Face face = polygon(outline, [&](double r, double z) {
    return gp_Pnt(r * std::cos(seam), r * std::sin(seam), z);
  });
  return made(name, angle < 2 * pi ? BRepPrimAPI_MakeRevol(face, gp::OZ(), angle).Shape()
                                   : BRepPrimAPI_MakeRevol(face, gp::OZ()).Shape());
}

TopoDS_Edge spline(const std::vector<gp_Pnt>& points) {
  const Handle(TColgp_HArray1OfPnt) array =
      new TColgp_HArray1OfPnt(1, static_cast<int>(points.size()));
  for (int i = 0; i < array->Length(); ++i) array->SetValue(i + 1, points[i]);
  GeomAPI_Interpolate curve(array, false, 1e-9);
  curve.Perform();
  return BRepBuilderAPI_MakeEdge(curve.Curve());
}

/// Upright holes or pins of one radius, numbered by their places, made from the number `first` on.
std::vector<NamedShape> upright_rods(const std::string& name, const Outline& places, double from,
                                     double to, double radius, double seam, int first = 0) {
  std::vector<NamedShape> rods;
  const int count = static_cast<int>(places.size());
  for (int i = 0; i < count; ++i) {
    const int n = (i + first) % count;
    rods.push_back(rod(name + std::to_string(n),
                       upright(places[n].first, places[n].second, from, seam), radius, to - from));
  }
  return rods;
}

Outline grid(int columns, int rows, double dx, double dy, double x, double y) {
  Outline places;
  for (int i = 0; i < columns; ++i)
    for (int j = 0; j < rows; ++j)
      places.emplace_back(x + dx * (i - 0.5 * (columns - 1)), y + dy * (j - 0.5 * (rows - 1)));
  return places;
}

Outline circle(int count, double radius, double start) {
  Outline places;
  for (int i = 0; i < count; ++i)
    places.emplace_back(radius * std::cos(start + 2 * pi * i / count),
                        radius * std::sin(start + 2 * pi * i / count));
  return places;
}

NamedShape block(const Sizes& s) {
  return box("block", gp_Pnt(0, 0, 0), gp_Pnt(s("length"), s("width"), s("height")));
}

NamedShape drilled(const Sizes& s, int columns, int rows) {
  return cut(block(s), upright_rods("hole",
                                    grid(columns, rows, s("pitch_x"), s("pitch_y"),
                                         0.5 * s("length") + s("x"), 0.5 * s("width") + s("y")),
                                    -1, s("height") + 1, s("radius"), s("seam"),
                                    static_cast<int>(s("first"))));
}

NamedShape sieve(const Sizes& s) {
  gp_Trsf turn;
  turn.SetRotation(gp::OZ(), s("turned"));
  Outline places = grid(7, 7, s("pitch"), s("pitch"), 0, 0);
  for (auto& [x, y] : places) {
    const gp_Pnt place = gp_Pnt(x, y, 0).Transformed(turn);
    x = place.X() + 0.5 * s("length");
    y = place.Y() + 0.5 * s("width");
  }
  return cut(block(s), upright_rods("hole", places, -1, s("height") + 1, s("radius"), 0, 0));
}

NamedShape studded(const Sizes& s) {
  return fuse(block(s), upright_rods("stud",
                                     grid(3, 2, s("pitch_x"), s("pitch_y"), 0.5 * s("length"),
                                          0.5 * s("width")),
                                     0.5 * s("height"), s("height") + s("stud"), s("radius"),
                                     s("seam"), static_cast<int>(s("first"))));
}

NamedShape flange(const Sizes& s, int holes) {
  std::vector<NamedShape> tools =
      upright_rods("hole", circle(holes, s("circle"), s("clocking")), -1, s("height") + 1,
                   s("hole"), s("seam"), static_cast<int>(s("first")));
  tools.push_back(rod("bore", upright(s("shift"), 0, -1, s("seam")), s("bore"), s("height") + 2));
  return cut(rod("disc", upright(0, 0, 0, s("seam")), s("outer"), s("height")), tools);
}

NamedShape bracket(const Sizes& s) {
  const double t = s("thickness"), leg = s("leg"), height = s("height");
  const NamedShape body =
      extruded("angle", {{0, 0}, {leg, 0}, {leg, t}, {t, t}, {t, height}, {0, height}}, s("width"));
  // Off the middle: the mirror image is another part.
  const double low = 0.5 * s("width") + s("aside");
  return cut(body, {rod("low", axes(gp_Pnt(s("low"), -1, low), gp::DY()), s("radius"), t + 2),
                    rod("high", axes(gp_Pnt(-1, s("high"), 0.5 * s("width")), gp::DX()),
                        s("radius"), t + 2)});
}

NamedShape shaft(const Sizes& s) {
  const double a = s("a"), b = a + s("b"), c = b + s("c");
  return revolved("shaft",
                  {{0, 0},
                   {s("r1") - 1, 0},
                   {s("r1"), 1},
                   {s("r1"), a},
                   {s("r2"), a},
                   {s("r2"), b},
                   {s("r3"), b},
                   {s("r3"), c},
                   {0, c}},
                  s("seam"));
}

NamedShape keyed_shaft(const Sizes& s) {
  const double half = 0.5 * s("key");
  return cut(shaft(s), {box("key", gp_Pnt(0.7 * s("r3"), -half, s("a") + s("b") + s("at")),
                            gp_Pnt(30, half, s("a") + s("b") + s("at") + s("key_length")))});
}

/// The key's slot opens the bore, which its seam cuts in two.
NamedShape keyed_hub(const Sizes& s) {
  const double half = 0.5 * s("key");
  return cut(rod("hub", upright(0, 0, 0), s("outer"), s("height")),
             {rod("bore", upright(0, 0, -1, s("seam")), s("bore"), s("height") + 2),
              box("slot", gp_Pnt(-half, 0, -1), gp_Pnt(half, s("depth"), s("height") + 1))});
}

/// A slot opens both cylinders, which their seams cut in two.
NamedShape split_ring(const Sizes& s) {
  const double half = 0.5 * s("slot");
  return cut(rod("ring", upright(0, 0, 0, s("seam")), s("outer"), s("height")),
             {rod("bore", upright(0, 0, -1, s("seam")), s("bore"), s("height") + 2),
              box("slot", gp_Pnt(-s("outer") - 1, -half, -1), gp_Pnt(0, half, s("height") + 1)),
              rod("pin", axes(gp_Pnt(0, 0, 0.5 * s("height")), gp::DY()), s("pin"), 50)});
}

NamedShape pierced_shaft(const Sizes& s) {
  return cut(rod("shaft", upright(0, 0, 0, s("seam")), s("radius"), s("length")),
             {rod("hole", axes(gp_Pnt(-40, 0, s("at")), gp::DX()), s("hole"), 80)});
}

NamedShape tee(const Sizes& s, int branches) {
  const auto branch = [&](const std::string& name, int i, double radius, double start) {
    const double at = (i - 0.5 * (branches - 1)) * s("apart");
    return rod(name + std::to_string(i),
               axes(gp_Pnt(at + start * std::sin(s("tilt")), 0, start * std::cos(s("tilt"))),
                    gp_Dir(std::sin(s("tilt")), 0, std::cos(s("tilt"))), s("seam")),
               radius, s("reach") - start);
  };
  const double length = s("length");
  const gp_Ax2 along = axes(gp_Pnt(-0.5 * length, 0, 0), gp::DX());
  std::vector<NamedShape> outer, inner;
  for (int i = 0; i < branches; ++i) {
    outer.push_back(branch("branch", i, s("branch"), 0));
    inner.push_back(branch("branch bore", i, s("branch") - s("wall"), 0));
  }
  inner.push_back(rod("bore", along, s("radius") - s("wall"), length));
  return cut(fuse(rod("pipe", along, s("radius"), length), outer), inner);
}

NamedShape elbow(const Sizes& s) {
  const auto bent = [&](const std::string& name, double radius) {
    const TopoDS_Edge ring = BRepBuilderAPI_MakeEdge(
        gp_Circ(axes(gp_Pnt(s("bend"), 0, 0), gp_Dir(0, -1, 0), s("seam")), radius));
    const TopoDS_Face face = BRepBuilderAPI_MakeFace(BRepBuilderAPI_MakeWire(ring).Wire());
    return made(name, BRepPrimAPI_MakeRevol(face, gp::OZ(), s("angle")).Shape());
  };
  return cut(bent("outside", s("radius")), {bent("inside", s("radius") - s("wall"))});
}

NamedShape swept(const Sizes& s) {
  const TopoDS_Edge spine = spline({gp_Pnt(0, 0, 0), gp_Pnt(0.1 * s("bow"), 0, 0.3 * s("length")),
                                    gp_Pnt(0.7 * s("bow"), 0.2 * s("bow"), 0.7 * s("length")),
                                    gp_Pnt(s("bow"), 0.5 * s("bow"), s("length"))});
  const TopoDS_Face face = polygon({{-0.5 * s("width"), -0.5 * s("depth")},
                                    {0.5 * s("width"), -0.5 * s("depth")},
                                    {0.5 * s("width"), 0.5 * s("depth")},
                                    {-0.5 * s("width"), 0.5 * s("depth")}},
                                   [](double x, double y) { return gp_Pnt(x, y, 0); });
  return made("bar", BRepOffsetAPI_MakePipe(BRepBuilderAPI_MakeWire(spine), face).Shape());
}

NamedShape blade(const Sizes& s) {
  BRepOffsetAPI_ThruSections loft(true, false, 1e-6);
  for (int section = 0; section < 3; ++section) {
    const double t = 0.5 * section, angle = s("twist") * t;
    const double chord = s("chord") * (1 - (1 - s("taper")) * t);
    const auto at = [&](double x, double side) {
      const double y =
          chord * (side * s("thick") * std::sqrt(x) * (1 - x) * 2 + s("camber") * 4 * x * (1 - x));
      const double from = chord * (x - 0.4);
      return gp_Pnt(std::cos(angle) * from - std::sin(angle) * y,
                    std::sin(angle) * from + std::cos(angle) * y, s("span") * t);
    };
    std::vector<gp_Pnt> upper, lower;
    for (const double x : {0.0, 0.03, 0.12, 0.3, 0.55, 0.8, 1.0}) {
      upper.push_back(at(x, 1));
      lower.insert(lower.begin(), at(x, -1));
    }
    loft.AddWire(BRepBuilderAPI_MakeWire(spline(upper), spline(lower)));
  }
  loft.Build();
  return made("blade", loft.Shape());
}

// From a wide inlet to a square outlet beside it.
NamedShape duct(const Sizes& s) {
  BRepOffsetAPI_ThruSections loft(true, false, 1e-6);
  for (const double t : {0.0, 0.3, 0.7, 1.0}) {
    const double share = t * t * (3 - 2 * t), y = share * s("offset"), z = t * s("length");
    const double width = 0.5 * ((1 - share) * s("width") + share * s("outlet")),
                 height = 0.5 * ((1 - share) * s("height") + share * s("outlet"));
    loft.AddWire(BRepBuilderAPI_MakePolygon(
                     gp_Pnt(-width, y - height, z), gp_Pnt(width, y - height, z),
                     gp_Pnt(width, y + height, z), gp_Pnt(-width, y + height, z), true)
                     .Wire());
  }
  loft.Build();
  return made("duct", loft.Shape());
}

NamedShape gear(const Sizes& s, int teeth) {
  Outline outline;
  for (int i = 0; i < teeth; ++i)
    for (const auto& [share, radius] :
         Outline{{-0.35, s("root")}, {-0.15, s("tip")}, {0.15, s("tip")}, {0.35, s("root")}})
      outline.emplace_back(radius * std::cos(2 * pi * (i + share) / teeth),
                           radius * std::sin(2 * pi * (i + share) / teeth));
  return cut(extruded("teeth", outline, s("height")),
             {rod("bore", upright(0, 0, -1, s("seam")), s("bore"), s("height") + 2)});
}

NamedShape comb(const Sizes& s) {
  Outline outline{{0, 0}, {8 * s("pitch"), 0}};
  for (int i = 7; i >= 0; --i)
    for (const auto& [x, y] : Outline{{i + 0.75, s("back")},
                                      {i + 0.75, s("back") + s("tooth")},
                                      {i + 0.25, s("back") + s("tooth")},
                                      {i + 0.25, s("back")}})
      outline.emplace_back(x * s("pitch"), y);
  return extruded("comb", outline, s("height"));
}

NamedShape bolt(const Sizes& s) {
  const NamedShape head = extruded("head", circle(6, s("head"), 0), s("height"));
  return fuse(head,
              {rod("shank", upright(0, 0, 0.5 * s("height"), s("seam")), s("shank"), s("length"))});
}

NamedShape cup(const Sizes& s) {
  const double r = s("radius"), h = s("height"), t = s("wall");
  return revolved("cup", {{0, 0}, {r, 0}, {r, h}, {r - t, h}, {r - t, t}, {0, t}}, s("seam"));
}

NamedShape case_of(const Sizes& s) {
  const double t = s("wall");
  return cut(block(s), {box("room", gp_Pnt(t, t, t),
                            gp_Pnt(s("length") - t, s("width") - t, s("height") + 1))});
}

NamedShape two_blocks(const Sizes& s) {
  const double a = s("a"), b = a + s("b");
  return glued({box("left", gp_Pnt(0, 0, 0), gp_Pnt(a, s("width"), s("height"))),
                box("right", gp_Pnt(a, 0, 0), gp_Pnt(b, s("width"), s("height")))});
}

NamedShape pins_in_plate(const Sizes& s) {
  const Outline places =
      grid(2, 2, s("pitch_x"), s("pitch_y"), 0.5 * s("length"), 0.5 * s("width"));
  std::vector<NamedShape> solids{
      cut(block(s), upright_rods("hole", places, -1, s("height") + 1, s("radius"), 0))};
  for (const NamedShape& pin :
       upright_rods("pin", places, -2, s("height") + s("stud"), s("radius") - s("gap"), s("seam"),
                    static_cast<int>(s("first"))))
    solids.push_back(pin);
  return together(solids);
}

// A circuit board with chips. Below one are pins through the board, on it is a sink of heat; these
// go with it. Of touching faces those of the solid named first have its name.
NamedShape board(const Sizes& s) {
  const double h = s("height"), x = s("x"), y = s("y");
  const std::vector<NamedShape> pins = upright_rods("pin", grid(4, 4, 4, 4, x, y), 0, h,
                                                    s("radius"), 0, static_cast<int>(s("first")));
  const auto chip = [&](const std::string& name, double from_x, double from_y, double length,
                        double width, double to) {
    return box(name, gp_Pnt(from_x, from_y, h), gp_Pnt(from_x + length, from_y + width, to));
  };
  std::vector<NamedShape> solids = pins;
  solids.push_back(chip("hot", x - 9, y - 9, 18, 18, h + 2.5));
  solids.push_back(chip("first", 65, 12, 12, 10, h + 2));
  solids.push_back(chip("second", 15, 55, 10, 14, h + 1.5));
  solids.push_back(chip("third", 70, 55, 16, 14, h + 1.8));
  const double on = h + 2.5;
  solids.push_back(fuse(box("sink", gp_Pnt(x - 15, y - 15, on), gp_Pnt(x + 15, y + 15, on + 3)),
                        upright_rods("stud", grid(5, 5, 5, 5, x, y), on + 2, on + 15, 1.8, 0)));
  solids.push_back(cut(block(s), pins));
  return glued(solids);
}

NamedShape row_of_rods(const Sizes& s) {
  std::vector<NamedShape> rods;
  for (int i = 0; i < 5; ++i) {
    const int n = (i + static_cast<int>(s("first"))) % 5;
    rods.push_back(rod("rod" + std::to_string(n), upright(n * s("pitch"), 0, 0, s("seam")),
                       s("radius"), s("length")));
  }
  return together(rods);
}

// Rollers between the rings of a bearing; they turn about its axis, the rings stay.
NamedShape bearing(const Sizes& s) {
  const gp_Ax2 at = upright(0, 0, 0, 0);
  const double pitch = s("pitch"), radius = s("radius"), length = s("length");
  const auto ring = [&](const std::string& name, double inner, double outer) {
    return cut(rod(name, at, outer, length), {rod(name + "_hole", at, inner, length)});
  };
  std::vector<NamedShape> parts{ring("inner", pitch / 2, pitch - radius - 1),
                                ring("outer", pitch + radius + 1, 1.5 * pitch)};
  for (int i = 0; i < 9; ++i) {
    const int n = (i + static_cast<int>(s("first"))) % 9;
    const double angle = s("angle") + 2 * std::numbers::pi * n / 9;
    parts.push_back(rod("roller" + std::to_string(n),
                        upright(pitch * std::cos(angle), pitch * std::sin(angle), 0, angle), radius,
                        length));
  }
  return together(parts);
}

NamedShape ball_in_box(const Sizes& s) {
  const gp_Ax2 at = upright(s("x"), s("y"), s("z"), s("seam"));
  return cut(block(s), {ball("ball", at, s("radius"))});
}

// Small bodies in the middle of far fields.
NamedShape middle_block(const Sizes& s) {
  const gp_Pnt corner(0.5 * s("length"), 0.5 * s("width"), 0.5 * s("height"));
  return box("body", gp_Pnt(-corner.X(), -corner.Y(), -corner.Z()), corner);
}

NamedShape block_in_ball(const Sizes& s) {
  return cut(ball("far", upright(0, 0, 0, 0), s("far")), {middle_block(s)});
}

NamedShape rod_in_ball(const Sizes& s) {
  return cut(ball("far", upright(0, 0, 0, 0), s("far")),
             {rod("body", upright(0, 0, -0.5 * s("length"), 0), s("radius"), s("length"))});
}

NamedShape block_in_rod(const Sizes& s) {
  return cut(rod("far", upright(0, 0, -s("far"), 0), s("far"), 2 * s("far")), {middle_block(s)});
}

NamedShape dumbbell(const Sizes& s) {
  const double half = 0.5 * s("length");
  const gp_Ax2 along = axes(gp_Pnt(-half, 0, 0), gp::DX(), s("seam"));
  return fuse(rod("bar", along, s("bar"), s("length")),
              {ball("left", axes(gp_Pnt(-half, 0, 0), gp::DX(), s("seam")), s("radius")),
               ball("right", axes(gp_Pnt(half, 0, 0), gp::DX(), s("seam")), s("radius"))});
}

NamedShape capsule(const Sizes& s) {
  const double r = s("radius"), h = s("height"), c = std::cos(s("seam")), d = std::sin(s("seam"));
  const auto at = [&](double x, double z) { return gp_Pnt(x * c, x * d, z); };
  const double m = r * std::sqrt(0.5);
  BRepBuilderAPI_MakeWire outline(
      BRepBuilderAPI_MakeEdge(at(0, 0), at(r, 0)).Edge(),
      BRepBuilderAPI_MakeEdge(at(r, 0), at(r, h)).Edge(),
      BRepBuilderAPI_MakeEdge(GC_MakeArcOfCircle(at(r, h), at(m, h + m), at(0, h + r)).Value())
          .Edge(),
      BRepBuilderAPI_MakeEdge(at(0, h + r), at(0, 0)).Edge());
  return made(
      "capsule",
      BRepPrimAPI_MakeRevol(BRepBuilderAPI_MakeFace(outline.Wire()).Face(), gp::OZ()).Shape());
}

NamedShape link(const Sizes& s) {
  const double half = 0.5 * s("length"), h = s("height");
  const NamedShape bar =
      box("bar", gp_Pnt(-half, -0.5 * s("bar"), 0.2 * h), gp_Pnt(half, 0.5 * s("bar"), 0.8 * h));
  const auto eye = [&](const std::string& name, double x, double radius, double from, double to) {
    return rod(name, upright(x, 0, from, s("seam")), radius, to - from);
  };
  return cut(fuse(bar, {eye("big", -half, s("big"), 0, h), eye("small", half, s("small"), 0, h)}),
             {eye("big bore", -half, s("big") - s("wall"), -1, h + 1),
              eye("small bore", half, s("small") - s("wall"), -1, h + 1)});
}

NamedShape nozzle(const Sizes& s) {
  return cut(cone("outside", upright(0, 0, 0, s("seam")), s("wide"), s("narrow"), s("length")),
             {cone("inside", upright(0, 0, 0, s("seam")), s("wide") - s("wall"),
                   s("narrow") - s("wall"), s("length"))});
}

NamedShape pierced_ball(const Sizes& s) {
  return cut(ball("ball", upright(0, 0, 0, s("seam")), s("radius")),
             {rod("hole", axes(gp_Pnt(s("shift"), 0, -40), gp::DZ(), s("seam")), s("hole"), 80)});
}

NamedShape pierced_ring(const Sizes& s) {
  return cut(
      made("ring",
           BRepPrimAPI_MakeTorus(upright(0, 0, 0, s("seam")), s("radius"), s("tube")).Solid()),
      {rod("hole", upright(s("radius"), s("y"), -30), s("hole"), 60)});
}

/// The sheets of a tube and of a slanted one welded on it, nothing shared: each has vertices where
/// the other's seam ends.
NamedShape welded_tubes(const Sizes& s) {
  const gp_Ax2 along(gp_Pnt(0, 0, 0), gp::DX(), gp::DZ());
  const gp_Ax2 slanted = axes(gp_Pnt(s("x"), 0, 0), gp_Dir(s("lean"), 0, 1), s("seam"));
  BRepPrimAPI_MakeCylinder chord(along, s("radius"), s("length"));
  BRepPrimAPI_MakeCylinder brace(slanted, s("brace"), s("reach"));
  return together({cut(made("chord", chord.Face()), {made("brace", brace.Solid())}),
                   cut(made("brace", brace.Face()), {made("chord", chord.Solid())})});
}

/// The air in a pipe round a disc on a shaft: tilted the other way, the shape is the same turned.
NamedShape throttle(const Sizes& s) {
  const gp_Dir across(std::cos(s("tilt")), 0, -std::sin(s("tilt")));
  const gp_Pnt middle = gp_Pnt(0, 0, 0).Translated(gp_Vec(across) * (-s("thickness") / 2));
  const auto wing = [&](const char* name, const gp_Dir& from) {
    return made(name, BRepPrimAPI_MakeCylinder(gp_Ax2(middle, across, from), 0.95 * s("radius"),
                                               s("thickness"), std::numbers::pi)
                          .Solid());
  };
  const gp_Dir down = gp::DY().Crossed(across);
  return cut(
      rod("pipe", axes(gp_Pnt(-s("length") / 2, 0, 0), gp::DX()), s("radius"), s("length")),
      {wing("left", down), wing("right", down.Reversed()),
       rod("shaft", axes(gp_Pnt(0, -2 * s("radius"), 0), gp::DY()), s("shaft"), 4 * s("radius"))});
}

std::vector<KnownPart> make_parts() {
  const Sizes plate{{"length", 120}, {"width", 80}, {"height", 8}, {"radius", 6}, {"pitch_x", 50},
                    {"pitch_y", 36}, {"x", 0},      {"y", 0},      {"seam", 0},   {"first", 0}};
  const auto with = [](Sizes sizes, std::initializer_list<std::pair<std::string, double>> changes) {
    for (const auto& [name, value] : changes) sizes[name] = value;
    return sizes;
  };
  const Sizes disc{{"outer", 30},     {"height", 6}, {"bore", 8}, {"hole", 3}, {"circle", 20},
                   {"clocking", 0.1}, {"shift", 0},  {"seam", 0}, {"first", 0}};
  const Sizes stepped{{"r1", 10}, {"r2", 15}, {"r3", 7},  {"a", 20},
                      {"b", 25},  {"c", 25},  {"seam", 0}};
  const Sizes pipe{{"length", 80}, {"radius", 12}, {"branch", 7}, {"wall", 2},
                   {"reach", 30},  {"tilt", 0},    {"apart", 36}, {"seam", 0}};
  const Sizes brick{{"length", 40}, {"width", 30}, {"height", 20}};
  return {
      {"box", brick, block},
      {"cube", with(brick, {{"length", 20}, {"width", 20}}), block},
      {"drilled",
       {{"length", 120},
        {"width", 80},
        {"height", 8},
        {"radius", 6},
        {"x", 50},
        {"y", 48},
        {"seam", 0}},
       [](const Sizes& s) {
         return cut(block(s), {rod("hole", upright(s("x"), s("y"), -1, s("seam")), s("radius"),
                                   s("height") + 2)});
       }},
      {"plate2", plate, [](const Sizes& s) { return drilled(s, 2, 1); }},
      {"hole_row", with(plate, {{"pitch_x", 20}, {"radius", 5}, {"x", -10}}),
       [](const Sizes& s) { return drilled(s, 4, 1); }},
      {"plate4", with(plate, {{"length", 80}, {"pitch_x", 36}}),
       [](const Sizes& s) { return drilled(s, 2, 2); }},
      {"plate12", with(plate, {{"pitch_x", 28}, {"pitch_y", 24}}),
       [](const Sizes& s) { return drilled(s, 4, 3); }},
      {"plate27", with(plate, {{"length", 140}, {"radius", 3.2}, {"pitch_x", 12}, {"pitch_y", 16}}),
       [](const Sizes& s) { return drilled(s, 9, 3); }},
      {"sieve",
       {{"length", 100},
        {"width", 100},
        {"height", 5},
        {"radius", 3},
        {"pitch", 10},
        {"turned", 0}},
       sieve},
      {"studs",
       {{"length", 90},
        {"width", 60},
        {"height", 8},
        {"radius", 5},
        {"pitch_x", 28},
        {"pitch_y", 30},
        {"stud", 12},
        {"seam", 0},
        {"first", 0}},
       studded},
      {"flange3", disc, [](const Sizes& s) { return flange(s, 3); }},
      {"flange6", disc, [](const Sizes& s) { return flange(s, 6); }},
      {"flange9", disc, [](const Sizes& s) { return flange(s, 9); }},
      {"upright_fillets",
       {{"length", 40}, {"width", 30}, {"height", 20}, {"fillet", 4}},
       [](const Sizes& s) { return filleted(block(s), s("fillet"), is_upright); }},
      {"all_fillets",
       {{"length", 40}, {"width", 30}, {"height", 20}, {"fillet", 4}},
       [](const Sizes& s) { return filleted(block(s), s("fillet"), is_any); }},
      {"chamfers",
       {{"length", 40}, {"width", 30}, {"height", 20}, {"chamfer", 3}},
       [](const Sizes& s) { return chamfered(block(s), s("chamfer"), is_any); }},
      {"bracket",
       {{"thickness", 6},
        {"leg", 50},
        {"height", 40},
        {"width", 30},
        {"low", 32},
        {"high", 26},
        {"radius", 5},
        {"aside", 4}},
       bracket},
      {"cylinder",
       {{"radius", 15}, {"length", 40}, {"seam", 0}},
       [](const Sizes& s) {
         return rod("rod", upright(0, 0, 0, s("seam")), s("radius"), s("length"));
       },
       true},
      {"cone",
       {{"radius", 15}, {"length", 30}, {"seam", 0}},
       [](const Sizes& s) {
         return cone("cone", upright(0, 0, 0, s("seam")), s("radius"), 0, s("length"));
       },
       true},
      {"frustum",
       {{"wide", 20}, {"narrow", 8}, {"length", 30}, {"seam", 0}},
       [](const Sizes& s) {
         return cone("cone", upright(0, 0, 0, s("seam")), s("wide"), s("narrow"), s("length"));
       },
       true},
      {"sphere",
       {{"radius", 20}, {"seam", 0}},
       [](const Sizes& s) { return ball("ball", upright(0, 0, 0, s("seam")), s("radius")); },
       true},
      {"torus",
       {{"radius", 30}, {"tube", 10}, {"seam", 0}},
       [](const Sizes& s) {
         return made(
             "ring",
             BRepPrimAPI_MakeTorus(upright(0, 0, 0, s("seam")), s("radius"), s("tube")).Solid());
       },
       true},
      {"capsule", {{"radius", 10}, {"height", 30}, {"seam", 0}}, capsule, true},
      {"shaft", stepped, shaft, true},
      {"keyed_shaft",
       {{"r1", 10},
        {"r2", 15},
        {"r3", 8},
        {"a", 20},
        {"b", 25},
        {"c", 25},
        {"seam", 0.5},
        {"key", 4},
        {"key_length", 12},
        {"at", 5}},
       keyed_shaft},
      {"pierced_shaft",
       {{"radius", 15}, {"length", 40}, {"hole", 4}, {"at", 18}, {"seam", 0.7}},
       pierced_shaft},
      {"tee", pipe, [](const Sizes& s) { return tee(s, 1); }},
      {"two_tees", pipe, [](const Sizes& s) { return tee(s, 2); }},
      {"elbow", {{"bend", 40}, {"radius", 10}, {"wall", 2}, {"angle", 1.4}, {"seam", 0}}, elbow},
      {"swept", {{"length", 60}, {"bow", 20}, {"width", 12}, {"depth", 8}}, swept},
      {"duct",
       {{"width", 60}, {"height", 30}, {"outlet", 36}, {"offset", 25}, {"length", 120}},
       duct},
      {"blade",
       {{"chord", 30},
        {"span", 60},
        {"twist", 0.5},
        {"taper", 0.7},
        {"thick", 0.1},
        {"camber", 0.06}},
       blade},
      {"gear12",
       {{"root", 24}, {"tip", 30}, {"height", 10}, {"bore", 8}, {"seam", 0}},
       [](const Sizes& s) { return gear(s, 12); }},
      {"comb", {{"pitch", 10}, {"back", 12}, {"tooth", 15}, {"height", 6}}, comb},
      {"bolt", {{"head", 12}, {"height", 8}, {"shank", 6}, {"length", 40}, {"seam", 0}}, bolt},
      {"cup", {{"radius", 20}, {"height", 40}, {"wall", 1}, {"seam", 0}}, cup, true},
      {"case", {{"length", 60}, {"width", 40}, {"height", 25}, {"wall", 1.5}}, case_of},
      {"two_blocks", {{"a", 30}, {"b", 20}, {"width", 20}, {"height", 20}}, two_blocks},
      {"board",
       {{"length", 100},
        {"width", 80},
        {"height", 1.6},
        {"radius", 0.9},
        {"x", 44},
        {"y", 39},
        {"first", 0}},
       board},
      {"pins",
       {{"length", 60},
        {"width", 60},
        {"height", 10},
        {"radius", 6},
        {"pitch_x", 30},
        {"pitch_y", 30},
        {"stud", 10},
        {"gap", 0.5},
        {"seam", 0},
        {"first", 0}},
       pins_in_plate},
      {"rods",
       {{"pitch", 16}, {"radius", 6}, {"length", 30}, {"seam", 0}, {"first", 0}},
       row_of_rods},
      {"bearing",
       {{"pitch", 20}, {"radius", 4}, {"length", 12}, {"angle", 0}, {"first", 0}},
       bearing},
      {"keyed_hub",
       {{"outer", 30}, {"bore", 12}, {"key", 6}, {"depth", 16}, {"height", 20}, {"seam", 0}},
       keyed_hub},
      {"split_ring",
       {{"outer", 18}, {"bore", 14}, {"slot", 4}, {"height", 12}, {"pin", 2}, {"seam", 0}},
       split_ring},
      {"ball_in_box",
       {{"length", 30},
        {"width", 30},
        {"height", 30},
        {"radius", 4},
        {"x", 15},
        {"y", 15},
        {"z", 15},
        {"seam", 0}},
       ball_in_box},
      {"block_in_ball", {{"length", 8}, {"width", 3}, {"height", 2}, {"far", 60}}, block_in_ball},
      {"rod_in_ball", {{"length", 4}, {"radius", 2}, {"far", 32}}, rod_in_ball},
      {"block_in_rod", {{"length", 8}, {"width", 3}, {"height", 2}, {"far", 60}}, block_in_rod},
      {"dumbbell", {{"length", 60}, {"bar", 5}, {"radius", 10}, {"seam", 0}}, dumbbell, true},
      {"link",
       {{"length", 80},
        {"height", 12},
        {"bar", 10},
        {"big", 16},
        {"small", 10},
        {"wall", 4},
        {"seam", 0.3}},
       link},
      {"nozzle",
       {{"wide", 20}, {"narrow", 10}, {"length", 50}, {"wall", 2}, {"seam", 0}},
       nozzle,
       true},
      {"pierced_ball",
       {{"radius", 20}, {"hole", 6}, {"shift", 0}, {"seam", 0}},
       pierced_ball,
       true},
      {"pierced_ring",
       {{"radius", 20}, {"tube", 6}, {"hole", 2.5}, {"y", 0.5}, {"seam", 1}},
       pierced_ring},
      {"welded_tubes",
       {{"length", 400},
        {"radius", 30},
        {"brace", 16},
        {"x", 200},
        {"lean", 0.9},
        {"reach", 200},
        {"seam", 0}},
       welded_tubes},
      {"throttle",
       {{"length", 200}, {"radius", 25}, {"thickness", 2.5}, {"shaft", 4}, {"tilt", 0.35}},
       throttle},
      {"mirrored",
       {{"thickness", 6},
        {"leg", 50},
        {"height", 40},
        {"width", 30},
        {"low", 32},
        {"high", 26},
        {"radius", 5},
        {"aside", 4}},
       [](const Sizes& s) {
         const NamedShape part = bracket(s);
         gp_Trsf mirror;
         mirror.SetMirror(gp_Ax2(gp_Pnt(0, 0, 0), gp::DX()));
         return NamedShape{BRepBuilderAPI_Transform(part.shape, mirror, true).Shape(), part.names};
       }},
  };
}

}  // namespace

const KnownPart& known_part(const std::string& name) {
  static const std::vector<KnownPart> parts = make_parts();
  const auto part = std::ranges::find(parts, name, &KnownPart::name);
  if (part == parts.end()) throw std::logic_error("no known part " + name);
  return *part;
}

}  // namespace cadmorph::testing
