#include <BRepAdaptor_Surface.hxx>
#include <BRepBuilderAPI_Transform.hxx>
#include <BRepTools_History.hxx>
#include <BRep_Builder.hxx>
#include <BRep_Tool.hxx>
#include <Geom2d_Curve.hxx>
#include <NCollection_DataMap.hxx>
#include <ShapeUpgrade_UnifySameDomain.hxx>
#include <TopExp.hxx>
#include <TopLoc_Location.hxx>
#include <TopTools_IndexedDataMapOfShapeListOfShape.hxx>
#include <TopTools_ListOfShape.hxx>
#include <TopTools_MapOfShape.hxx>
#include <TopTools_ShapeMapHasher.hxx>
#include <TopoDS.hxx>
#include <TopoDS_Compound.hxx>
#include <TopoDS_Edge.hxx>
#include <TopoDS_Face.hxx>
#include <TopoDS_Iterator.hxx>
#include <cmath>
#include <functional>
#include <vector>

#include "cad/analytic_patches.h"
#include "cad/brep_builder.h"
#include "cad/brep_impl.h"
#include "cad/cut_seams.h"
#include "cad/face_pieces.h"
#include "core/formats/child_process.h"

namespace cadmorph {
namespace {

// Surfaces within these of each other are one: far above the rounding of a file, far below a step.
constexpr double kSameDistance = 1e-7;  // diagonals
constexpr double kSameAngle = 1e-6;
constexpr double kSameArea = 1e-4;  // of the area: what a sound merge keeps, as OCCT integrates it

// Of half the period: an edge this near to it lies where a surface's parameters begin. A hundred
// times what files keep, far below the distance of an edge that the designer drew.
constexpr double kAtSeam = 1e-5;

bool is_of_revolution(const BRepAdaptor_Surface& surface) {
  switch (surface.GetType()) {
    case GeomAbs_Cylinder:
    case GeomAbs_Cone:
    case GeomAbs_Sphere:
    case GeomAbs_Torus:
    case GeomAbs_SurfaceOfRevolution:
      return true;
    default:
      return false;
  }
}

// Whether the edge runs where one of the face's periodic parameters begins, or opposite.
bool is_at_seam(const TopoDS_Edge& edge, const TopoDS_Face& face, double tolerance) {
  if (is_at_end_of_patch(edge, face, tolerance)) return true;
  constexpr bool is_restricted = false;
  const BRepAdaptor_Surface surface(face, is_restricted);
  double first = 0, last = 0;
  const Handle(Geom2d_Curve) curve = BRep_Tool::CurveOnSurface(edge, face, first, last);
  if (!is_of_revolution(surface) || curve.IsNull()) return false;
  const double periods[] = {surface.IsUPeriodic() ? surface.UPeriod() : 0,
                            surface.IsVPeriodic() ? surface.VPeriod() : 0};
  for (const int direction : {0, 1}) {
    if (periods[direction] == 0) continue;
    const auto is_on = [&](double t) {
      const double halves = curve->Value(t).Coord(direction + 1) / (periods[direction] / 2);
      return std::abs(halves - std::round(halves)) < kAtSeam;
    };
    if (is_on(first) && is_on((first + last) / 2) && is_on(last)) return true;
  }
  return false;
}

// Edges that faces are not to be merged across, by their places in the shape, and whether others
// are left.
struct KeptEdges {
  std::vector<int> edges;
  bool has_seams = false;
};

KeptEdges all_but_seams(const TopoDS_Shape& shape, double tolerance) {
  TopTools_IndexedMapOfShape edges;
  TopExp::MapShapes(shape, TopAbs_EDGE, edges);
  TopTools_IndexedDataMapOfShapeListOfShape faces_of;
  TopExp::MapShapesAndAncestors(shape, TopAbs_EDGE, TopAbs_FACE, faces_of);
  KeptEdges kept;
  for (int i = 1; i <= edges.Extent(); ++i) {
    const TopoDS_Edge& edge = TopoDS::Edge(edges(i));
    const TopTools_ListOfShape& faces = faces_of.FindFromKey(edge);
    const bool is_seam = faces.Extent() == 2 && !faces.First().IsSame(faces.Last()) &&
                         is_at_seam(edge, TopoDS::Face(faces.First()), tolerance) &&
                         is_at_seam(edge, TopoDS::Face(faces.Last()), tolerance);
    if (is_seam)
      kept.has_seams = true;
    else
      kept.edges.push_back(i);
  }
  return kept;
}

bool has_location(const TopoDS_Shape& shape) {
  if (!shape.Location().IsIdentity()) return true;
  for (TopoDS_Iterator part(shape); part.More(); part.Next())
    if (has_location(part.Value())) return true;
  return false;
}

// The shape with its geometry where it is placed: OCCT merges no faces of a placed part. Faces and
// edges keep their order.
TopoDS_Shape without_locations(const TopoDS_Shape& shape) {
  constexpr bool with_location = false, with_orientation = false;
  const TopoDS_Shape plain = shape.Located(TopLoc_Location());
  TopoDS_Shape result = plain;
  if (plain.ShapeType() == TopAbs_COMPOUND && has_location(plain)) {
    TopoDS_Compound parts;
    BRep_Builder builder;
    builder.MakeCompound(parts);
    for (TopoDS_Iterator part(plain, with_orientation, with_location); part.More(); part.Next())
      builder.Add(parts, without_locations(part.Value()));
    result = parts.Oriented(plain.Orientation());
  }
  if (shape.Location().IsIdentity()) return result;
  constexpr bool copies_geometry = true;
  return BRepBuilderAPI_Transform(result, shape.Location().Transformation(), copies_geometry)
      .Shape();
}

// Names of the faces of a merged shape: that of the only face it came from; else none.
class MergedNames {
 public:
  // `shape`: the model's, its faces in the same order.
  MergedNames(const CadModel::Impl& model, const TopoDS_Shape& shape,
              const Handle(BRepTools_History) & history) {
    const TopTools_IndexedMapOfShape faces = usable_faces(shape);
    for (int i = 1; i <= faces.Extent(); ++i) {
      const std::string& name = model.faces[FaceId(i - 1)].name;
      const TopTools_ListOfShape& images = history->Modified(faces(i));
      if (images.IsEmpty()) add(faces(i), name);
      for (const TopoDS_Shape& image : images) add(image, name);
    }
  }

  std::string operator()(const TopoDS_Face& face) const {
    const std::string* name = names_.Seek(face);
    return name ? *name : std::string();
  }

 private:
  void add(const TopoDS_Shape& face, const std::string& name) {
    if (!names_.Bind(face, name)) names_.ChangeFind(face).clear();
  }

  NCollection_DataMap<TopoDS_Shape, std::string, TopTools_ShapeMapHasher> names_;
};

// OCCT 7.6 walks round some faces without end. Whether it comes to one shows in a copy of the
// process, which has 5 s of processor time and one more for each 100 faces: plates with a thousand
// holes take less than a second. kClockSeconds are far more, for copies on a busy machine.
bool comes_to_an_end(int faces, const std::function<void()>& merge) {
  constexpr int kSeconds = 5, kFacesASecond = 100, kClockSeconds = 300;
  const ChildProcess child(std::uint64_t(kSeconds + faces / kFacesASecond),
                           [&](const Socket& socket) {
                             merge();
                             socket.send("", 1);
                           });
  // A copy that says nothing waits for a lock that another thread held: no fault of the faces.
  if (!child.has_started() || !child.socket().waits(kClockSeconds)) return true;
  char done = 0;
  return child.socket().receive(&done, 1);
}

}  // namespace

std::optional<CadModel> CadModel::with_merged_faces(FaceMerge merge) const {
  try {
    const double tolerance = kSameDistance * diagonal();
    KeptEdges kept;
    if (merge == FaceMerge::AcrossSeams) {
      kept = all_but_seams(impl_->shape, tolerance);
      if (!kept.has_seams) return std::nullopt;
    }
    const TopoDS_Shape shape = with_seams_in_gaps(
        with_shared_analytic_surfaces(without_locations(impl_->shape), tolerance), tolerance);
    TopTools_IndexedMapOfShape edges;
    TopExp::MapShapes(shape, TopAbs_EDGE, edges);
    TopTools_MapOfShape kept_edges;
    for (const int edge : kept.edges) kept_edges.Add(edges(edge));
    constexpr bool edges_too = false, faces_too = true, concatenates = false;
    const Handle(BRepTools_History) history = new BRepTools_History;
    const TopoDS_Shape whole = with_whole_surfaces(
        shape, tolerance, [&](const TopoDS_Shape& edge) { return kept_edges.Contains(edge); },
        [&](const TopoDS_Shape& face, const TopoDS_Shape& all) {
          history->AddModified(face, all);
        });
    ShapeUpgrade_UnifySameDomain merger(whole, edges_too, faces_too, concatenates);
    merger.SetLinearTolerance(tolerance);
    merger.SetAngularTolerance(kSameAngle);
    merger.KeepShapes(kept_edges);
    if (!comes_to_an_end(int(faces().size()), [&] { merger.Build(); })) return std::nullopt;
    merger.Build();
    const TopoDS_Shape merged = merger.Shape();
    if (merged.IsNull()) return std::nullopt;
    const int gone = static_cast<int>(faces().size()) - usable_faces(merged).Extent();
    if (gone <= 0) return std::nullopt;
    const double before = area(shape);
    if (!(std::abs(area(merged) - before) < kSameArea * before)) return std::nullopt;
    history->Merge(merger.History());
    return build_model(merged,
                       {file_name(), file_unit(), MergedNames(*impl_, shape, history), gone});
  } catch (const Standard_Failure&) {
    return std::nullopt;  // OCCT fails on pieces of a torus, for one
  }
}

std::optional<CadModel> CadModel::with_analytic_faces(const std::vector<FaceId>& wanted) const {
  if (edges_as_points() > 0) return std::nullopt;  // a model built anew knows nothing of them
  try {
    const TopoDS_Shape plain = without_locations(impl_->shape);
    const TopTools_IndexedMapOfShape usable = usable_faces(plain);
    TopTools_IndexedMapOfShape all;
    TopExp::MapShapes(plain, TopAbs_FACE, all);
    std::vector<bool> is_wanted(static_cast<std::size_t>(all.Extent()));
    for (const FaceId face : wanted)
      is_wanted[all.FindIndex(usable(static_cast<int>(face) + 1)) - 1] = true;
    const TopoDS_Shape shape = with_analytic_surfaces(plain, is_wanted, kSameDistance * diagonal());
    if (shape.IsSame(plain)) return std::nullopt;
    int next = 0;
    const auto name = [&](const TopoDS_Face&) { return faces()[FaceId(next++)].name; };
    CadModel result = build_model(shape, {file_name(), file_unit(), name, merged_face_count()});
    const bool has_all = result.faces().size() == faces().size() &&
                         result.edges().size() == edges().size() &&
                         result.vertices().size() == vertices().size() &&
                         result.coedges().size() == coedges().size();
    if (has_all) return result;
  } catch (const Standard_Failure&) {
    // The patches stay as the file has them.
  }
  return std::nullopt;
}

}  // namespace cadmorph
