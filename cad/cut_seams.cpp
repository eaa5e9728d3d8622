#include "cad/cut_seams.h"

#include <BRepBuilderAPI_Copy.hxx>
#include <BRepBuilderAPI_MakeFace.hxx>
#include <BRepTools.hxx>
#include <BRepTools_ReShape.hxx>
#include <BRep_Builder.hxx>
#include <BRep_Tool.hxx>
#include <Geom2d_Curve.hxx>
#include <Geom_ElementarySurface.hxx>
#include <Geom_SphericalSurface.hxx>
#include <Geom_SurfaceOfRevolution.hxx>
#include <Geom_ToroidalSurface.hxx>
#include <Precision.hxx>
#include <ShapeAnalysis_Surface.hxx>
#include <TopExp.hxx>
#include <TopExp_Explorer.hxx>
#include <TopTools_IndexedMapOfShape.hxx>
#include <TopTools_MapOfShape.hxx>
#include <TopoDS.hxx>
#include <TopoDS_Edge.hxx>
#include <TopoDS_Face.hxx>
#include <TopoDS_Iterator.hxx>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <utility>
#include <vector>

#include "cad/face_pieces.h"

namespace cadmorph {
namespace {

constexpr double kTurn = 2 * std::numbers::pi;
constexpr double kSmallestGap =
    1e-4;  // radians: no slot, and more than pieces that touch are apart

Handle(Geom_Surface) surface_of(const TopoDS_Face& face) { return BRep_Tool::Surface(face); }

bool is_of_revolution(const TopoDS_Face& face) {
  const Handle(Geom_Surface) surface = surface_of(face);
  return !surface.IsNull() && surface->IsUPeriodic() &&
         (surface->IsKind(STANDARD_TYPE(Geom_ElementarySurface)) ||
          surface->IsKind(STANDARD_TYPE(Geom_SurfaceOfRevolution)));
}

struct Bounds {
  explicit Bounds(const TopoDS_Face& face) {
    BRepTools::UVBounds(face, u_first, u_last, v_first, v_last);
  }
  double u_first = 0, u_last = 0, v_first = 0, v_last = 0;
};

// What to add to the parameters of a face to have those of another's surface, where both are one
// surface whose parameters run the same way.
std::optional<gp_Vec2d> shift_between(const TopoDS_Face& from, const TopoDS_Face& to,
                                      double tolerance) {
  const Handle(Geom_Surface) source = surface_of(from), target = surface_of(to);
  if (source == target) return gp_Vec2d(0, 0);
  if (source->DynamicType() != target->DynamicType()) return std::nullopt;
  const Bounds at(from);
  ShapeAnalysis_Surface finder(target);
  std::optional<gp_Vec2d> shift;
  for (const double u : {at.u_first, (2 * at.u_first + at.u_last) / 3, at.u_last})
    for (const double v : {(2 * at.v_first + at.v_last) / 3, at.v_last}) {  // not at a pole first
      const gp_Pnt point = source->Value(u, v);
      if (!shift) {
        const gp_Pnt2d found = finder.ValueOfUV(point, tolerance);
        shift = gp_Vec2d(found.X() - u, found.Y() - v);
      }
      if (target->Value(u + shift->X(), v + shift->Y()).Distance(point) > tolerance)
        return std::nullopt;
    }
  return shift;
}

bool is_closed_all_round(const Handle(Geom_Surface) & surface) {
  return surface->IsKind(STANDARD_TYPE(Geom_SphericalSurface)) ||
         surface->IsKind(STANDARD_TYPE(Geom_ToroidalSurface));
}

// A face, and what to add to its parameters to have those of the first one's surface.
struct Piece {
  TopoDS_Face face;
  gp_Vec2d shift;
};

// Faces of one surface that touch.
std::vector<std::vector<Piece>> pieces_of_surfaces(const TopoDS_Shape& shape, double tolerance) {
  TopTools_IndexedMapOfShape faces;
  TopExp::MapShapes(shape, TopAbs_FACE, faces);
  const auto is_one = [&](int one, int other) {
    const TopoDS_Face a = in_own_frame(faces(one)), b = in_own_frame(faces(other));
    return is_of_revolution(a) && is_of_revolution(b) && shift_between(b, a, tolerance);
  };
  std::vector<std::vector<Piece>> result;
  for (const std::vector<int>& group : touching_faces(shape, is_one)) {
    std::vector<Piece> pieces{{in_own_frame(faces(group.front())), gp_Vec2d(0, 0)}};
    for (std::size_t i = 1; i < group.size(); ++i) {
      const TopoDS_Face face = in_own_frame(faces(group[i]));
      if (const auto shift = shift_between(face, pieces.front().face, tolerance))
        pieces.push_back({face, *shift});
    }
    if (pieces.size() > 1) result.push_back(std::move(pieces));
  }
  return result;
}

// The middle of the widest range of angles that none of the faces has, as far as there is one.
struct Gap {
  double width = 0, middle = 0;
};

Gap widest_gap(const std::vector<Piece>& pieces) {
  std::vector<std::pair<double, double>> ranges;
  for (const Piece& piece : pieces) {
    const Bounds at(piece.face);
    const double first = at.u_first + piece.shift.X();
    const double begin = first - kTurn * std::floor(first / kTurn);
    ranges.emplace_back(begin, begin + at.u_last - at.u_first);
  }
  std::ranges::sort(ranges);
  Gap widest;
  double end = std::ranges::max(ranges, {}, &std::pair<double, double>::second).second - kTurn;
  for (const auto& [begin, last] : ranges) {
    if (begin - end > widest.width) widest = {begin - end, (begin + end) / 2};
    end = std::max(end, last);
  }
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

// Edges that the face has on both sides: those of a torus, which is closed the other way, too.
TopTools_MapOfShape seams_within(const TopoDS_Face& face) {
  TopTools_MapOfShape seen, result;
  for (TopExp_Explorer each(face, TopAbs_EDGE); each.More(); each.Next())
    if (!seen.Add(each.Current())) result.Add(each.Current());
  return result;
}

// The face on the turned surface, by the same wires.
TopoDS_Face on_turned(const Piece& piece, const Handle(Geom_Surface) & surface, double angle) {
  const TopoDS_Face& face = piece.face;
  BRep_Builder builder;
  TopoDS_Face result;
  builder.MakeFace(result, surface, BRep_Tool::Tolerance(face));
  const Bounds at(face);
  const double turn = piece.shift.X() - angle;
  const double middle = (at.u_first + at.u_last) / 2 + turn;
  const gp_Vec2d shift(turn - kTurn * std::floor(middle / kTurn), piece.shift.Y());
  double first = 0, last = 0;
  const auto moved = [&](const TopoDS_Shape& edge) -> Handle(Geom2d_Curve) {
    const Handle(Geom2d_Curve) curve =
        BRep_Tool::CurveOnSurface(TopoDS::Edge(edge), face, first, last);
    if (curve.IsNull()) return {};
    return Handle(Geom2d_Curve)::DownCast(curve->Translated(shift));
  };
  const TopLoc_Location none;
  const TopTools_MapOfShape own_seams = seams_within(face);
  for (TopExp_Explorer each(face, TopAbs_EDGE); each.More(); each.Next()) {
    const TopoDS_Edge edge = TopoDS::Edge(each.Current());
    const Handle(Geom2d_Curve) curve = moved(edge);
    if (curve.IsNull()) return {};
    const double tolerance = BRep_Tool::Tolerance(edge);
    if (own_seams.Contains(edge))
      builder.UpdateEdge(edge, moved(edge.Oriented(TopAbs_FORWARD)),
                         moved(edge.Oriented(TopAbs_REVERSED)), surface, none, tolerance);
    else
      builder.UpdateEdge(edge, curve, surface, none, tolerance);
    builder.Range(edge, surface, none, first, last);
  }
  for (TopoDS_Iterator wire(face); wire.More(); wire.Next()) builder.Add(result, wire.Value());
  return result;
}

}  // namespace

TopoDS_Shape with_seams_in_gaps(const TopoDS_Shape& shape, double tolerance) {
  constexpr bool copies_geometry = false;
  const TopoDS_Shape copy = BRepBuilderAPI_Copy(shape, copies_geometry).Shape();
  const Handle(BRepTools_ReShape) changes = new BRepTools_ReShape;
  bool has_any = false;
  for (const std::vector<Piece>& pieces : pieces_of_surfaces(copy, tolerance)) {
    const Gap gap = widest_gap(pieces);
    if (gap.width < kSmallestGap) continue;
    const Handle(Geom_Surface) surface = turned(surface_of(pieces.front().face), gap.middle);
    std::vector<TopoDS_Face> moved;
    for (const Piece& piece : pieces) moved.push_back(on_turned(piece, surface, gap.middle));
    if (std::ranges::any_of(moved, &TopoDS_Face::IsNull)) continue;
    for (std::size_t i = 0; i < pieces.size(); ++i) changes->Replace(pieces[i].face, moved[i]);
    has_any = true;
  }
  return has_any ? changes->Apply(copy) : shape;
}

TopoDS_Shape with_whole_surfaces(
    const TopoDS_Shape& shape, double tolerance,
    const std::function<bool(const TopoDS_Shape& edge)>& is_kept,
    const std::function<void(const TopoDS_Shape& face, const TopoDS_Shape& whole)>& tell) {
  const Handle(BRepTools_ReShape) changes = new BRepTools_ReShape;
  bool has_any = false;
  for (const std::vector<Piece>& pieces : pieces_of_surfaces(shape, tolerance)) {
    const Handle(Geom_Surface) surface = surface_of(pieces.front().face);
    if (!is_closed_all_round(surface)) continue;
    TopTools_MapOfShape open;  // edges that only one side was met of
    bool keeps_any = false;
    for (const Piece& piece : pieces)
      for (TopExp_Explorer each(piece.face, TopAbs_EDGE); each.More(); each.Next()) {
        const TopoDS_Edge& edge = TopoDS::Edge(each.Current());
        if (BRep_Tool::Degenerated(edge)) continue;
        keeps_any |= is_kept(edge);
        if (!open.Add(edge)) open.Remove(edge);
      }
    if (keeps_any || !open.IsEmpty()) continue;
    const TopoDS_Face whole = BRepBuilderAPI_MakeFace(surface, Precision::Confusion()).Face();
    for (const Piece& piece : pieces) {
      if (piece.face.IsSame(pieces.front().face))
        changes->Replace(piece.face, whole);
      else
        changes->Remove(piece.face);
      tell(piece.face, whole);
    }
    has_any = true;
  }
  return has_any ? changes->Apply(shape) : shape;
}

}  // namespace cadmorph
