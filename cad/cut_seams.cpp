#include "cad/cut_seams.h"

#include <BRepAdaptor_Surface.hxx>
#include <BRepBuilderAPI_Copy.hxx>
#include <BRepTools.hxx>
#include <BRepTools_ReShape.hxx>
#include <BRep_Builder.hxx>
#include <BRep_Tool.hxx>
#include <Geom2d_Curve.hxx>
#include <Geom_ElementarySurface.hxx>
#include <Geom_SurfaceOfRevolution.hxx>
#include <TopExp.hxx>
#include <TopExp_Explorer.hxx>
#include <TopTools_IndexedDataMapOfShapeListOfShape.hxx>
#include <TopTools_IndexedMapOfShape.hxx>
#include <TopTools_ListOfShape.hxx>
#include <TopoDS.hxx>
#include <TopoDS_Edge.hxx>
#include <TopoDS_Face.hxx>
#include <TopoDS_Iterator.hxx>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <numeric>
#include <utility>
#include <vector>

namespace cadmorph {
namespace {

constexpr double kTurn = 2 * std::numbers::pi;
constexpr double kAtSeam = 1e-6;       // of a turn: an edge this near to it is the seam's
constexpr double kSmallestGap = 1e-4;  // radians

// A face in the frame that its surface is in, the way its surface looks.
TopoDS_Face plain(const TopoDS_Shape& face) {
  return TopoDS::Face(face.Located(TopLoc_Location()).Oriented(TopAbs_FORWARD));
}

Handle(Geom_Surface) surface_of(const TopoDS_Face& face) { return BRep_Tool::Surface(face); }

bool is_of_revolution(const TopoDS_Face& face) {
  const Handle(Geom_Surface) surface = surface_of(face);
  return !surface.IsNull() && surface->IsUPeriodic() &&
         (surface->IsKind(STANDARD_TYPE(Geom_ElementarySurface)) ||
          surface->IsKind(STANDARD_TYPE(Geom_SurfaceOfRevolution)));
}

// Whether the edge runs where the face's angles begin.
bool is_at_seam(const TopoDS_Edge& edge, const TopoDS_Face& face) {
  double first = 0, last = 0;
  const Handle(Geom2d_Curve) curve = BRep_Tool::CurveOnSurface(edge, face, first, last);
  if (curve.IsNull()) return false;
  return std::ranges::all_of(std::array{first, (first + last) / 2, last}, [&](double t) {
    const double turns = curve->Value(t).X() / kTurn;
    return std::abs(turns - std::round(turns)) < kAtSeam;
  });
}

struct Bounds {
  explicit Bounds(const TopoDS_Face& face) {
    BRepTools::UVBounds(face, u_first, u_last, v_first, v_last);
  }
  double u_first = 0, u_last = 0, v_first = 0, v_last = 0;
};

// Whether the surface of one face has the parameters of another's.
bool has_parameters_of(const TopoDS_Face& face, const TopoDS_Face& other, double tolerance) {
  const Handle(Geom_Surface) a = surface_of(face), b = surface_of(other);
  if (a == b) return true;
  const Bounds at(other);
  for (const double u : {at.u_first, (at.u_first + at.u_last) / 2, at.u_last})
    for (const double v : {at.v_first, at.v_last})
      if (a->Value(u, v).Distance(b->Value(u, v)) > tolerance) return false;
  return true;
}

// Faces of one surface that touch at its seam.
std::vector<std::vector<TopoDS_Face>> faces_cut_by_seams(const TopoDS_Shape& shape,
                                                         double tolerance) {
  TopTools_IndexedMapOfShape faces;
  TopExp::MapShapes(shape, TopAbs_FACE, faces);
  TopTools_IndexedDataMapOfShapeListOfShape faces_of;
  TopExp::MapShapesAndAncestors(shape, TopAbs_EDGE, TopAbs_FACE, faces_of);
  std::vector<int> group(static_cast<std::size_t>(faces.Extent()) + 1);
  std::iota(group.begin(), group.end(), 0);
  const auto root = [&](int face) {
    while (group[face] != face) face = group[face];
    return face;
  };
  for (int i = 1; i <= faces_of.Extent(); ++i) {
    const TopTools_ListOfShape& two = faces_of(i);
    if (two.Extent() != 2 || two.First().IsSame(two.Last()) ||
        two.First().Location() != two.Last().Location())
      continue;
    const TopoDS_Face a = plain(two.First()), b = plain(two.Last());
    const TopoDS_Edge edge = TopoDS::Edge(faces_of.FindKey(i).Located(
        two.First().Location().Inverted() * faces_of.FindKey(i).Location()));
    if (is_of_revolution(a) && is_of_revolution(b) && is_at_seam(edge, a) && is_at_seam(edge, b) &&
        has_parameters_of(a, b, tolerance))
      group[root(faces.FindIndex(two.First()))] = root(faces.FindIndex(two.Last()));
  }
  std::map<int, std::vector<TopoDS_Face>> members;
  for (int i = 1; i <= faces.Extent(); ++i) members[root(i)].push_back(plain(faces(i)));
  std::vector<std::vector<TopoDS_Face>> result;
  for (auto& [first, group_faces] : members)
    if (group_faces.size() > 1) result.push_back(std::move(group_faces));
  return result;
}

// The middle of the widest range of angles that none of the faces has, as far as there is one.
struct Gap {
  double width = 0, middle = 0;
};

Gap widest_gap(const std::vector<TopoDS_Face>& faces) {
  std::vector<std::pair<double, double>> ranges;
  for (const TopoDS_Face& face : faces) {
    const Bounds at(face);
    const double turns = kTurn * std::floor(at.u_first / kTurn + kAtSeam);
    ranges.emplace_back(at.u_first - turns, at.u_last - turns);
  }
  std::ranges::sort(ranges);
  Gap widest;
  double end = ranges.front().second;
  const auto look = [&](double begin) {
    if (begin - end > widest.width) widest = {begin - end, (begin + end) / 2};
  };
  for (const auto& [begin, last] : ranges) {
    look(begin);
    end = std::max(end, last);
  }
  look(ranges.front().first + kTurn);
  return widest;
}

// The surface turned about its axis, so that its angles begin where they were `angle`.
Handle(Geom_Surface) turned(const Handle(Geom_Surface) & surface, double angle) {
  const Handle(Geom_Surface) result = Handle(Geom_Surface)::DownCast(surface->Copy());
  if (const auto elementary = Handle(Geom_ElementarySurface)::DownCast(result);
      !elementary.IsNull()) {
    const gp_Ax3& frame = elementary->Position();
    result->Rotate(frame.Axis(), frame.Direct() ? angle : -angle);
  } else {
    result->Rotate(Handle(Geom_SurfaceOfRevolution)::DownCast(result)->Axis(), angle);
  }
  return result;
}

// The face on the turned surface, by the same wires.
TopoDS_Face on_turned(const TopoDS_Face& face, const Handle(Geom_Surface) & surface, double angle) {
  BRep_Builder builder;
  TopoDS_Face result;
  builder.MakeFace(result, surface, BRep_Tool::Tolerance(face));
  const Bounds at(face);
  const double middle = (at.u_first + at.u_last) / 2 - angle;
  const gp_Vec2d shift(-angle - kTurn * std::floor(middle / kTurn), 0);
  for (TopExp_Explorer each(face, TopAbs_EDGE); each.More(); each.Next()) {
    const TopoDS_Edge edge = TopoDS::Edge(each.Current());
    double first = 0, last = 0;
    const Handle(Geom2d_Curve) curve = BRep_Tool::CurveOnSurface(edge, face, first, last);
    if (curve.IsNull()) return {};
    builder.UpdateEdge(edge, Handle(Geom2d_Curve)::DownCast(curve->Translated(shift)), surface,
                       TopLoc_Location(), BRep_Tool::Tolerance(edge));
    builder.Range(edge, surface, TopLoc_Location(), first, last);
  }
  for (TopoDS_Iterator wire(face); wire.More(); wire.Next()) builder.Add(result, wire.Value());
  return result;
}

}  // namespace

TopoDS_Shape with_seams_in_gaps(const TopoDS_Shape& shape, double tolerance) {
  if (faces_cut_by_seams(shape, tolerance).empty()) return shape;
  constexpr bool copies_geometry = false;
  const TopoDS_Shape copy = BRepBuilderAPI_Copy(shape, copies_geometry).Shape();
  const Handle(BRepTools_ReShape) changes = new BRepTools_ReShape;
  for (const std::vector<TopoDS_Face>& faces : faces_cut_by_seams(copy, tolerance)) {
    const Gap gap = widest_gap(faces);
    if (gap.width < kSmallestGap) continue;
    const Handle(Geom_Surface) surface = turned(surface_of(faces.front()), gap.middle);
    std::vector<TopoDS_Face> moved;
    for (const TopoDS_Face& face : faces) moved.push_back(on_turned(face, surface, gap.middle));
    if (std::ranges::any_of(moved, &TopoDS_Face::IsNull)) continue;
    for (std::size_t i = 0; i < faces.size(); ++i) changes->Replace(faces[i], moved[i]);
  }
  return changes->Apply(copy);
}

}  // namespace cadmorph
