#include "cad_variants.h"

#include <unistd.h>

#include <BRepAlgoAPI_Cut.hxx>
#include <BRepBndLib.hxx>
#include <BRepBuilderAPI_GTransform.hxx>
#include <BRepBuilderAPI_MakeFace.hxx>
#include <BRepBuilderAPI_MakePolygon.hxx>
#include <BRepBuilderAPI_MakeVertex.hxx>
#include <BRepBuilderAPI_NurbsConvert.hxx>
#include <BRepBuilderAPI_Transform.hxx>
#include <BRepExtrema_DistShapeShape.hxx>
#include <BRepPrimAPI_MakeBox.hxx>
#include <BRepPrimAPI_MakeCone.hxx>
#include <BRepPrimAPI_MakeCylinder.hxx>
#include <BRepPrimAPI_MakeRevol.hxx>
#include <BRepPrimAPI_MakeSphere.hxx>
#include <BRepPrimAPI_MakeTorus.hxx>
#include <BRepTools_Modification.hxx>
#include <BRepTools_Modifier.hxx>
#include <BRepTopAdaptor_FClass2d.hxx>
#include <BRep_Builder.hxx>
#include <BRep_Tool.hxx>
#include <Bnd_Box.hxx>
#include <Geom2d_BSplineCurve.hxx>
#include <Geom2d_Line.hxx>
#include <Geom2d_TrimmedCurve.hxx>
#include <GeomAPI_ProjectPointOnSurf.hxx>
#include <GeomConvert.hxx>
#include <Geom_BSplineCurve.hxx>
#include <Geom_BSplineSurface.hxx>
#include <Geom_Plane.hxx>
#include <Geom_RectangularTrimmedSurface.hxx>
#include <Geom_TrimmedCurve.hxx>
#include <Interface_Static.hxx>
#include <Message.hxx>
#include <Message_Messenger.hxx>
#include <NCollection_DataMap.hxx>
#include <STEPControl_Reader.hxx>
#include <STEPControl_Writer.hxx>
#include <ShapeUpgrade_ShapeDivideClosed.hxx>
#include <TColStd_Array1OfReal.hxx>
#include <TopExp.hxx>
#include <TopExp_Explorer.hxx>
#include <TopTools_DataMapOfShapeShape.hxx>
#include <TopTools_ListOfShape.hxx>
#include <TopTools_MapOfShape.hxx>
#include <TopTools_ShapeMapHasher.hxx>
#include <TopoDS.hxx>
#include <TopoDS_Compound.hxx>
#include <TopoDS_Edge.hxx>
#include <TopoDS_Face.hxx>
#include <TopoDS_Iterator.hxx>
#include <TopoDS_Shell.hxx>
#include <TopoDS_Solid.hxx>
#include <TopoDS_Wire.hxx>
#include <algorithm>
#include <atomic>
#include <cmath>
#include <map>
#include <numbers>
#include <numeric>
#include <random>
#include <set>
#include <stdexcept>

#include "cad/brep_builder.h"
#include "cad/step_reader.h"
#include "mapped_geometry.h"

namespace cadmorph::testing {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using std::numbers::pi;

gp_Pnt to_occt(const Vector3d& x) { return {x.x(), x.y(), x.z()}; }
Vector3d to_eigen(const gp_Pnt& p) { return {p.X(), p.Y(), p.Z()}; }

gp_Pnt image(const PointMap& map, const gp_Pnt& p) { return to_occt(map(to_eigen(p))); }

std::vector<double> new_knots(double first, double last, int spans) {
  std::vector<double> knots;
  for (int i = 1; i < spans; ++i) knots.push_back(first + (last - first) * i / spans);
  return knots;
}

/// Moves poles and vertices, keeps pcurves.
class MovePoles : public MappedGeometry {
 public:
  MovePoles(PointMap map, int spans) : MappedGeometry(std::move(map)), spans_(spans) {}

  Standard_Boolean NewSurface(const TopoDS_Face& face, Handle(Geom_Surface) & surface,
                              TopLoc_Location& location, Standard_Real& tolerance,
                              Standard_Boolean& reverses_wires,
                              Standard_Boolean& reverses_face) override {
    auto copy = BRep_Tool::Surface(face);
    if (const auto trimmed = Handle(Geom_RectangularTrimmedSurface)::DownCast(copy))
      copy = trimmed->BasisSurface();
    const auto spline = Handle(Geom_BSplineSurface)::DownCast(copy->Copy());
    if (spline.IsNull()) throw std::logic_error("with_moved_poles needs a NURBS shape");
    refine(spline);
    for (int i = 1; i <= spline->NbUPoles(); ++i)
      for (int j = 1; j <= spline->NbVPoles(); ++j)
        spline->SetPole(i, j, image(map_, spline->Pole(i, j)));
    surface = spline;
    location.Identity();
    tolerance = BRep_Tool::Tolerance(face);
    reverses_wires = reverses_face = false;
    return true;
  }

  Standard_Boolean NewCurve(const TopoDS_Edge& edge, Handle(Geom_Curve) & curve,
                            TopLoc_Location& location, Standard_Real& tolerance) override {
    double first, last;
    Handle(Geom_Curve) old = BRep_Tool::Curve(edge, first, last);
    location.Identity();
    tolerance = BRep_Tool::Tolerance(edge);
    curve = nullptr;
    if (old.IsNull()) return true;
    if (const auto trimmed = Handle(Geom_TrimmedCurve)::DownCast(old)) old = trimmed->BasisCurve();
    const auto spline = Handle(Geom_BSplineCurve)::DownCast(old->Copy());
    if (spline.IsNull()) throw std::logic_error("with_moved_poles needs NURBS edges");
    if (spans_ > 0) {
      spline->IncreaseDegree(std::max(3, spline->Degree()));
      for (const double t : new_knots(spline->FirstParameter(), spline->LastParameter(), spans_))
        spline->InsertKnot(t, 1, 1e-9, false);
    }
    for (int i = 1; i <= spline->NbPoles(); ++i) spline->SetPole(i, image(map_, spline->Pole(i)));
    curve = spline;
    return true;
  }

  Standard_Boolean NewCurve2d(const TopoDS_Edge& edge, const TopoDS_Face& face, const TopoDS_Edge&,
                              const TopoDS_Face&, Handle(Geom2d_Curve) & curve,
                              Standard_Real& tolerance) override {
    double first, last;
    tolerance = BRep_Tool::Tolerance(edge);
    curve = BRep_Tool::CurveOnSurface(edge, face, first, last);
    if (curve.IsNull()) return false;
    curve = new Geom2d_TrimmedCurve(curve, first, last);
    return true;
  }

 private:
  void refine(const Handle(Geom_BSplineSurface) & s) const {
    if (spans_ == 0) return;
    s->IncreaseDegree(std::max(3, s->UDegree()), std::max(3, s->VDegree()));
    double u1, u2, v1, v2;
    s->Bounds(u1, u2, v1, v2);
    for (const double u : new_knots(u1, u2, spans_)) s->InsertUKnot(u, 1, 1e-9, false);
    for (const double v : new_knots(v1, v2, spans_)) s->InsertVKnot(v, 1, 1e-9, false);
  }

  int spans_;
};

/// Builds a shape anew from its faces, edges and vertices.
class Rebuilder {
 public:
  Rebuilder(const TopoDS_Shape& shape, const ShuffleOptions& options)
      : shape_(shape), options_(options), random_(options.seed) {}

  Shuffled run() {
    std::vector<TopoDS_Shape> bodies;
    for (TopExp_Explorer it(shape_, TopAbs_SOLID); it.More(); it.Next())
      bodies.push_back(rebuild_solid(it.Current()));
    for (TopExp_Explorer it(shape_, TopAbs_FACE, TopAbs_SOLID); it.More(); it.Next())
      bodies.push_back(rebuild_face(TopoDS::Face(it.Current())));  // a sheet
    if (bodies.empty()) throw std::logic_error("shuffle needs faces");
    mix(bodies);
    TopoDS_Shape result = bodies.front();
    if (bodies.size() > 1) {
      TopoDS_Compound compound;
      builder_.MakeCompound(compound);
      for (const auto& body : bodies) builder_.Add(compound, body);
      result = compound;
    }
    TopTools_IndexedMapOfShape before, after;
    TopExp::MapShapes(shape_, TopAbs_FACE, before);
    TopExp::MapShapes(result, TopAbs_FACE, after);
    Shuffled shuffled{result, {}};
    for (int f = 1; f <= before.Extent(); ++f)
      shuffled.faces.emplace_back(after.FindIndex(faces_.Find(before(f))) - 1);
    return shuffled;
  }

 private:
  template <class T>
  void mix(std::vector<T>& items) {
    if (options_.is_order_shuffled) std::shuffle(items.begin(), items.end(), random_);
  }

  bool draw(bool is_wanted) {
    return std::bernoulli_distribution(options_.probability)(random_) && is_wanted;
  }

  TopoDS_Shape rebuild_solid(const TopoDS_Shape& solid) {
    TopoDS_Solid copy;
    builder_.MakeSolid(copy);
    for (TopoDS_Iterator it(solid.Oriented(TopAbs_FORWARD)); it.More(); it.Next()) {
      TopoDS_Shell shell;
      builder_.MakeShell(shell);
      std::vector<TopoDS_Shape> faces;
      for (TopoDS_Iterator f(it.Value().Oriented(TopAbs_FORWARD)); f.More(); f.Next())
        faces.push_back(rebuild_face(TopoDS::Face(f.Value())));
      mix(faces);
      for (const auto& face : faces) builder_.Add(shell, face);
      shell.Closed(true);
      builder_.Add(copy, shell.Oriented(it.Value().Orientation()));
    }
    return copy.Oriented(solid.Orientation());
  }

  TopoDS_Shape rebuild_face(const TopoDS_Face& oriented) {
    const TopoDS_Face old = TopoDS::Face(oriented.Oriented(TopAbs_FORWARD));
    if (!faces_.IsBound(old)) {
      Handle(Geom_Surface) surface =
          Handle(Geom_Surface)::DownCast(BRep_Tool::Surface(old)->Copy());
      const auto plane = Handle(Geom_Plane)::DownCast(surface);
      const bool is_flipped =
          draw(plane.IsNull() ? options_.has_reversed_surfaces : options_.has_reversed_planes);
      mirror_ = gp_Trsf2d();
      if (is_flipped && plane.IsNull()) {
        mirror_.SetMirror(
            gp_Ax2d(gp_Pnt2d(0.5 * surface->UReversedParameter(0), 0), gp_Dir2d(0, 1)));
        surface = surface->UReversed();
      } else if (is_flipped) {
        gp_Ax3 frame = plane->Position();
        frame.ZReverse();
        frame.YReverse();  // stays right-handed
        surface = new Geom_Plane(frame);
      }
      TopoDS_Face face;
      builder_.MakeFace(face, surface, BRep_Tool::Tolerance(old));
      std::vector<TopoDS_Shape> wires;
      for (TopoDS_Iterator it(old); it.More(); it.Next())
        wires.push_back(rebuild_wire(TopoDS::Wire(it.Value()), old, face));
      mix(wires);
      for (const auto& wire : wires) builder_.Add(face, is_flipped ? wire.Reversed() : wire);
      is_flipped_[face.TShape().get()] = is_flipped;
      faces_.Bind(old, face);
    }
    TopoDS_Shape face = faces_.Find(old).Oriented(oriented.Orientation());
    if (is_flipped_[face.TShape().get()]) face.Reverse();
    return face;
  }

  TopoDS_Shape rebuild_wire(const TopoDS_Wire& oriented, const TopoDS_Face& old,
                            const TopoDS_Face& face) {
    std::vector<TopoDS_Shape> uses;
    for (TopoDS_Iterator it(oriented.Oriented(TopAbs_FORWARD)); it.More(); it.Next()) {
      const TopoDS_Edge use = TopoDS::Edge(it.Value());
      if (BRep_Tool::IsClosed(use, old)) is_seam_.Add(use);
      auto parts = rebuild_edge(use);
      for (const TopoDS_Edge& edge : parts) add_pcurves(use, edge, old, face);
      if (use.Orientation() == TopAbs_REVERSED) std::reverse(parts.begin(), parts.end());
      for (const TopoDS_Edge& edge : parts) {
        const bool runs_back = is_reversed_[edge.TShape().get()];
        uses.push_back(
            edge.Oriented(runs_back ? TopAbs::Reverse(use.Orientation()) : use.Orientation()));
      }
    }
    if (options_.is_order_shuffled && !uses.empty())
      std::rotate(uses.begin(), uses.begin() + static_cast<int>(random_() % uses.size()),
                  uses.end());
    TopoDS_Wire wire;
    builder_.MakeWire(wire);
    for (const auto& use : uses) builder_.Add(wire, use);
    wire.Closed(oriented.Closed());
    return wire.Oriented(oriented.Orientation());
  }

  /// The new edge in place of an old one, or its two parts in the old one's direction.
  std::vector<TopoDS_Edge> rebuild_edge(const TopoDS_Edge& use) {
    const TopoDS_Edge old = TopoDS::Edge(use.Oriented(TopAbs_FORWARD));
    // Edges of a prism share what they consist of with those at its other end.
    if (!edges_.IsBound(old)) edges_.Bind(old, {});
    auto& parts = edges_.ChangeFind(old);
    if (!parts.empty()) return parts;
    double first, last;
    const Handle(Geom_Curve) curve = BRep_Tool::Curve(old, first, last);
    TopoDS_Vertex start, end;
    TopExp::Vertices(old, start, end);
    BRep_Tool::Range(old, first, last);
    const bool is_seam = is_seam_.Contains(old);
    if (!curve.IsNull() && draw(is_seam ? options_.has_split_seams : options_.has_split_edges)) {
      const double middle = 0.4 * first + 0.6 * last;
      TopoDS_Vertex cut;
      builder_.MakeVertex(cut, curve->Value(middle), BRep_Tool::Tolerance(old));
      parts = {new_edge(old, curve, first, middle, start, cut),
               new_edge(old, curve, middle, last, cut, end)};
    } else {
      parts = {new_edge(old, curve, first, last, start, end)};
    }
    return parts;
  }

  TopoDS_Edge new_edge(const TopoDS_Edge& old, const Handle(Geom_Curve) & curve, double first,
                       double last, const TopoDS_Vertex& start, const TopoDS_Vertex& end) {
    const bool is_degenerate = BRep_Tool::Degenerated(old);
    const bool runs_back = !is_degenerate && draw(options_.has_reversed_edges);
    TopoDS_Edge edge;
    if (curve.IsNull()) {
      builder_.MakeEdge(edge);
      builder_.UpdateEdge(edge, Handle(Geom_Curve)(), BRep_Tool::Tolerance(old));
    } else {
      builder_.MakeEdge(edge,
                        runs_back ? curve->Reversed() : Handle(Geom_Curve)::DownCast(curve->Copy()),
                        BRep_Tool::Tolerance(old));
    }
    builder_.Add(edge, start.Oriented(runs_back ? TopAbs_REVERSED : TopAbs_FORWARD));
    builder_.Add(edge, end.Oriented(runs_back ? TopAbs_FORWARD : TopAbs_REVERSED));
    if (runs_back)
      builder_.Range(edge, curve->ReversedParameter(last), curve->ReversedParameter(first));
    else
      builder_.Range(edge, first, last);
    builder_.Degenerated(edge, is_degenerate);
    builder_.SameParameter(edge, BRep_Tool::SameParameter(old));
    builder_.SameRange(edge, BRep_Tool::SameRange(old));
    is_reversed_[edge.TShape().get()] = runs_back;
    range_[edge.TShape().get()] = {first, last};
    return edge;
  }

  /// The pcurve of an old edge's use; its range is then [first, last].
  Handle(Geom2d_Curve) pcurve(const TopoDS_Shape& use, const TopoDS_Face& old, bool runs_back,
                              double& first, double& last) {
    double edge_first, edge_last, curve_first, curve_last;
    BRep_Tool::Range(TopoDS::Edge(use), edge_first, edge_last);
    const auto curve = BRep_Tool::CurveOnSurface(TopoDS::Edge(use), old, curve_first, curve_last);
    if (curve.IsNull()) return curve;
    const double stretch = (curve_last - curve_first) / (edge_last - edge_first);
    first = curve_first + (first - edge_first) * stretch;
    last = curve_first + (last - edge_first) * stretch;
    const auto placed = Handle(Geom2d_Curve)::DownCast(curve->Transformed(mirror_));
    if (!runs_back) return placed;
    const double from = placed->ReversedParameter(last);
    last = placed->ReversedParameter(first);
    first = from;
    return placed->Reversed();
  }

  /// The same curve with its parameters shifted, so that it agrees with the 3D curve's.
  static Handle(Geom2d_Curve) shifted(const Handle(Geom2d_Curve) & curve, double by) {
    if (const auto trimmed = Handle(Geom2d_TrimmedCurve)::DownCast(curve))
      return shifted(trimmed->BasisCurve(), by);
    if (const auto line = Handle(Geom2d_Line)::DownCast(curve))
      return new Geom2d_Line(line->Value(-by), line->Direction());
    const auto spline = Handle(Geom2d_BSplineCurve)::DownCast(curve);
    if (spline.IsNull()) throw std::logic_error("can't shift a pcurve of this type");
    TColStd_Array1OfReal knots(1, spline->NbKnots());
    for (int i = 1; i <= spline->NbKnots(); ++i) knots(i) = spline->Knot(i) + by;
    spline->SetKnots(knots);
    return Handle(Geom2d_Curve)(spline);
  }

  void add_pcurves(const TopoDS_Edge& use, const TopoDS_Edge& edge, const TopoDS_Face& old,
                   const TopoDS_Face& face) {
    if (!Handle(Geom_Plane)::DownCast(BRep_Tool::Surface(old)).IsNull()) return;
    const TopoDS_Shape forward = use.Oriented(TopAbs_FORWARD);
    const TopoDS_Shape backward = use.Oriented(TopAbs_REVERSED);
    const bool runs_back = is_reversed_[edge.TShape().get()];
    const double tolerance = BRep_Tool::Tolerance(use);
    auto [first, last] = range_[edge.TShape().get()];
    auto [first_back, last_back] = range_[edge.TShape().get()];
    auto one = pcurve(forward, old, runs_back, first, last);
    if (one.IsNull()) return;
    double edge_first, edge_last;
    BRep_Tool::Range(edge, edge_first, edge_last);
    const auto fit = [&](Handle(Geom2d_Curve) & curve, double from) {
      if (runs_back && std::abs(edge_first - from) > 1e-12)
        curve = shifted(curve, edge_first - from);
    };
    fit(one, first);
    if (BRep_Tool::IsClosed(TopoDS::Edge(forward), old)) {
      // The mirrored face has its wires turned round: what was used forward is used backward.
      auto two = pcurve(backward, old, runs_back, first_back, last_back);
      fit(two, first_back);
      const bool is_mirrored = mirror_.Form() != gp_Identity;
      if (runs_back != is_mirrored) std::swap(one, two);
      builder_.UpdateEdge(edge, one, two, face, tolerance);
    } else {
      builder_.UpdateEdge(edge, one, face, tolerance);
    }
  }

  const TopoDS_Shape& shape_;
  ShuffleOptions options_;
  std::mt19937 random_;
  BRep_Builder builder_;
  TopTools_DataMapOfShapeShape faces_;
  // Of an old edge.
  NCollection_DataMap<TopoDS_Shape, std::vector<TopoDS_Edge>, TopTools_ShapeMapHasher> edges_;
  std::map<const void*, std::pair<double, double>> range_;  // of a new edge on the old curve
  std::map<const void*, bool> is_flipped_, is_reversed_;
  TopTools_MapOfShape is_seam_;  // of old edges
  gp_Trsf2d mirror_;  // from parameters of the old surface to those of the current new one
};

}  // namespace

std::filesystem::path model_file(const std::string& name) {
  return std::filesystem::path(CADMORPH_SOURCE_DIR) / "models" / name;
}

TopoDS_Shape read_shape(const std::filesystem::path& path) {
  STEPControl_Reader reader;
  Interface_Static::SetCVal("xstep.cascade.unit", "MM");
  if (reader.ReadFile(path.c_str()) != IFSelect_RetDone)
    throw std::runtime_error("can't read " + path.string());
  reader.TransferRoots();
  return reader.OneShape();
}

CadModel to_model(const TopoDS_Shape& shape) { return build_model(shape, {"memory", "MM", {}}); }

CadModel through_step(const TopoDS_Shape& shape) {
  const TemporaryFile file(".step");
  write_step(file.path(), shape);
  return read_step(file.path());
}

void write_step(const std::filesystem::path& path, const TopoDS_Shape& shape) {
  Message::DefaultMessenger()->ChangePrinters().Clear();
  STEPControl_Writer writer;
  Interface_Static::SetCVal("write.step.unit", "MM");
  if (writer.Transfer(shape, STEPControl_AsIs) != IFSelect_RetDone ||
      writer.Write(path.c_str()) != IFSelect_RetDone)
    throw std::runtime_error("can't write " + path.string());
}

TemporaryFile::TemporaryFile(const std::string& suffix) {
  static std::atomic<int> count = 0;
  path_ = std::filesystem::temp_directory_path() /
          ("cadmorph_test_" + std::to_string(getpid()) + "_" + std::to_string(count++) + suffix);
}

TemporaryFile::~TemporaryFile() {
  std::error_code ignored;
  std::filesystem::remove_all(path_, ignored);
}

gp_Trsf similarity(double angle, double scale, const gp_Vec& translation) {
  gp_Trsf turn, stretch, shift;
  turn.SetRotation(gp_Ax1(gp_Pnt(0, 0, 0), gp_Dir(1, 2, 3)), angle);
  stretch.SetScale(gp_Pnt(0, 0, 0), scale);
  shift.SetTranslation(translation);
  return shift * stretch * turn;
}

gp_GTrsf general_affine() {
  return gp_GTrsf(gp_Mat(1.3, 0.2, -0.1, 0.05, 0.9, 0.15, 0.1, -0.12, 1.15), gp_XYZ(7, -3, 5));
}

Vector3d apply(const gp_Trsf& map, const Vector3d& x) {
  return to_eigen(to_occt(x).Transformed(map));
}

Vector3d apply(const gp_GTrsf& map, const Vector3d& x) {
  gp_XYZ y(x.x(), x.y(), x.z());
  map.Transforms(y);
  return {y.X(), y.Y(), y.Z()};
}

TopoDS_Shape transformed(const TopoDS_Shape& shape, const gp_Trsf& map) {
  return BRepBuilderAPI_Transform(shape, map, true).Shape();
}

TopoDS_Shape transformed(const TopoDS_Shape& shape, const gp_GTrsf& map) {
  return BRepBuilderAPI_GTransform(shape, map, true).Shape();
}

TopoDS_Shape to_nurbs(const TopoDS_Shape& shape) {
  return BRepBuilderAPI_NurbsConvert(shape, true).Shape();
}

TopoDS_Shape with_cut_faces(const TopoDS_Shape& shape) {
  ShapeUpgrade_ShapeDivideClosed cutter(shape);
  cutter.Perform();
  return cutter.Result();
}

TopoDS_Shape with_moved_poles(const TopoDS_Shape& nurbs, const PointMap& map, int spans) {
  const Handle(BRepTools_Modification) change = new MovePoles(map, spans);
  BRepTools_Modifier modifier(nurbs, change);
  return modifier.ModifiedShape(nurbs);
}

PointMap twist_and_taper(double height, double angle) {
  return [height, angle](const Vector3d& x) -> Vector3d {
    const double t = x.z() / height, a = angle * t, scale = 1 + 0.25 * t * (1.5 - t);
    return {scale * (std::cos(a) * x.x() - std::sin(a) * x.y()) + 0.1 * height * t * t,
            scale * (std::sin(a) * x.x() + std::cos(a) * x.y()), 1.2 * x.z()};
  };
}

Shuffled shuffle(const TopoDS_Shape& shape, const ShuffleOptions& options) {
  return Rebuilder(shape, options).run();
}

TopoDS_Shape with_turned_seams(const std::string& name, double angle) {
  const gp_Ax2 axes(gp_Pnt(0, 0, 0), gp_Dir(0, 0, 1), gp_Dir(std::cos(angle), std::sin(angle), 0));
  if (name == "cylinder") return BRepPrimAPI_MakeCylinder(axes, 15, 40).Solid();
  if (name == "cone") return BRepPrimAPI_MakeCone(axes, 15, 0, 30).Solid();
  if (name == "cone_frustum") return BRepPrimAPI_MakeCone(axes, 20, 8, 30).Solid();
  if (name == "sphere") return BRepPrimAPI_MakeSphere(axes, 20).Solid();
  if (name == "torus") return BRepPrimAPI_MakeTorus(axes, 30, 10).Solid();
  if (name != "stepped_shaft") throw std::logic_error("no such turned part: " + name);
  BRepBuilderAPI_MakePolygon outline;
  for (const auto& [r, z] : std::vector<std::pair<double, double>>{
           {0, 0}, {9, 0}, {10, 1}, {10, 20}, {15, 20}, {15, 45}, {7, 45}, {7, 70}, {0, 70}})
    outline.Add(gp_Pnt(r * std::cos(angle), r * std::sin(angle), z));
  outline.Close();
  return BRepPrimAPI_MakeRevol(BRepBuilderAPI_MakeFace(outline.Wire()),
                               gp_Ax1(gp_Pnt(0, 0, 0), gp_Dir(0, 0, 1)))
      .Shape();
}

TopoDS_Shape drilled_plate(double length, double width, double height, double radius,
                           const std::vector<Vector2d>& centres) {
  TopTools_ListOfShape plates, drills;
  plates.Append(BRepPrimAPI_MakeBox(length, width, height).Solid());
  for (const Vector2d& c : centres)
    drills.Append(BRepPrimAPI_MakeCylinder(gp_Ax2(gp_Pnt(c.x(), c.y(), -1), gp_Dir(0, 0, 1)),
                                           radius, height + 2)
                      .Solid());
  BRepAlgoAPI_Cut cut;
  cut.SetArguments(plates);
  cut.SetTools(drills);
  cut.Build();
  return cut.Shape();
}

struct FaceOracle::Impl {
  std::vector<TopoDS_Face> faces;
  std::vector<Handle(Geom_Surface)> surfaces;
  std::vector<std::unique_ptr<GeomAPI_ProjectPointOnSurf>> projectors;
  std::vector<std::unique_ptr<BRepTopAdaptor_FClass2d>> classifiers;
  std::vector<Bnd_Box> boxes;
};

FaceOracle::FaceOracle(const TopoDS_Shape& shape) : impl_(std::make_unique<Impl>()) {
  TopTools_IndexedMapOfShape faces;
  TopExp::MapShapes(shape, TopAbs_FACE, faces);
  for (int f = 1; f <= faces.Extent(); ++f) {
    impl_->faces.push_back(TopoDS::Face(faces(f)));
    const auto surface = BRep_Tool::Surface(impl_->faces.back());
    impl_->surfaces.push_back(surface);
    double u1, u2, v1, v2;
    surface->Bounds(u1, u2, v1, v2);
    impl_->projectors.push_back(std::make_unique<GeomAPI_ProjectPointOnSurf>());
    impl_->projectors.back()->Init(surface, u1, u2, v1, v2);
    impl_->classifiers.push_back(
        std::make_unique<BRepTopAdaptor_FClass2d>(impl_->faces.back(), 1e-9));
    impl_->boxes.emplace_back();
    BRepBndLib::Add(impl_->faces.back(), impl_->boxes.back());
  }
}

FaceOracle::~FaceOracle() = default;

int FaceOracle::face_count() const { return static_cast<int>(impl_->faces.size()); }

Vector2d FaceOracle::parameters(int face, const Vector3d& x) const {
  auto& projector = *impl_->projectors[face];
  projector.Perform(to_occt(x));
  Vector2d uv = Vector2d::Constant(std::nan(""));
  if (projector.NbPoints() > 0) projector.LowerDistanceParameters(uv.x(), uv.y());
  return uv;
}

Vector3d FaceOracle::point(int face, const Vector2d& uv) const {
  return to_eigen(impl_->surfaces[face]->Value(uv.x(), uv.y()));
}

int FaceOracle::side(int face, const Vector2d& uv) const {
  switch (impl_->classifiers[face]->Perform(gp_Pnt2d(uv.x(), uv.y()))) {
    case TopAbs_IN:
      return 1;
    case TopAbs_ON:
      return 0;
    default:
      return -1;
  }
}

double FaceOracle::distance(int face, const Vector3d& x) const {
  const Vector2d uv = parameters(face, x);
  if (uv.allFinite() && side(face, uv) >= 0) return (point(face, uv) - x).norm();
  const BRepExtrema_DistShapeShape distance(BRepBuilderAPI_MakeVertex(to_occt(x)).Vertex(),
                                            impl_->faces[face]);
  return distance.IsDone() ? distance.Value() : 1e300;
}

double FaceOracle::distance_to_box(int face, const Vector3d& x) const {
  Vector3d lower, upper;
  impl_->boxes[face].Get(lower[0], lower[1], lower[2], upper[0], upper[1], upper[2]);
  return (x - x.cwiseMax(lower).cwiseMin(upper)).norm();
}

bool FaceOracle::is_near(int face, const Vector3d& x, double limit) const {
  return distance_to_box(face, x) <= limit && distance(face, x) <= limit;
}

std::pair<int, double> FaceOracle::nearest(const Vector3d& x) const {
  std::vector<std::pair<double, int>> order;
  for (int f = 0; f < face_count(); ++f) order.emplace_back(distance_to_box(f, x), f);
  std::sort(order.begin(), order.end());
  std::pair<int, double> best{-1, 1e300};
  for (const auto& [least, f] : order) {
    if (least >= best.second) break;
    if (const double d = distance(f, x); d < best.second) best = {f, d};
  }
  return best;
}

}  // namespace cadmorph::testing
