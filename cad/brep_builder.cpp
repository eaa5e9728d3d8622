#include "cad/brep_builder.h"

#include <BRepLib.hxx>
#include <BRep_Tool.hxx>
#include <GeomAdaptor_Curve.hxx>
#include <GeomAdaptor_Surface.hxx>
#include <TopExp.hxx>
#include <TopExp_Explorer.hxx>
#include <TopTools_IndexedMapOfShape.hxx>
#include <TopoDS.hxx>
#include <TopoDS_Edge.hxx>
#include <TopoDS_Face.hxx>
#include <TopoDS_Iterator.hxx>
#include <TopoDS_Shape.hxx>
#include <TopoDS_Vertex.hxx>
#include <TopoDS_Wire.hxx>
#include <algorithm>
#include <cmath>

#include "cad/brep_impl.h"
#include "cad/pcurve_repair.h"
#include "core/errors.h"

namespace cadmorph {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

// Chords that an edge is measured by: a circle comes out 0.04 % short.
constexpr int kEdgeSamples = 64;

SurfaceType surface_type(GeomAbs_SurfaceType type) {
  switch (type) {
    case GeomAbs_Plane:
      return SurfaceType::Plane;
    case GeomAbs_Cylinder:
      return SurfaceType::Cylinder;
    case GeomAbs_Cone:
      return SurfaceType::Cone;
    case GeomAbs_Sphere:
      return SurfaceType::Sphere;
    case GeomAbs_Torus:
      return SurfaceType::Torus;
    case GeomAbs_BezierSurface:
    case GeomAbs_BSplineSurface:
      return SurfaceType::BSpline;
    default:
      return SurfaceType::Other;
  }
}

class ModelBuilder {
 public:
  ModelBuilder(const TopoDS_Shape& shape, const ShapeSource& source, CadModel::Impl& model)
      : shape_(shape), source_(source), model_(model) {}

  void build() {
    BRepLib::BuildCurves3d(shape_);
    map_shapes();
    for (int i = 1; i <= vertices_.Extent(); ++i) add_vertex(TopoDS::Vertex(vertices_(i)));
    for (int i = 1; i <= edges_.Extent(); ++i) add_edge(TopoDS::Edge(edges_(i)));
    for (int i = 1; i <= faces_.Extent(); ++i) add_face(TopoDS::Face(faces_(i)));
    mark_solids();
    for (const FaceId f : model_.faces.ids()) finish_face(f);
  }

 private:
  void map_shapes() {
    faces_ = usable_faces(shape_);
    if (faces_.IsEmpty())
      throw CadError(source_.file_name +
                     ": holds no face. Export the solid or its surfaces, not "
                     "curves or a drawing.");
    for (int i = 1; i <= faces_.Extent(); ++i) {
      TopExp::MapShapes(faces_(i), TopAbs_EDGE, edges_);
      TopExp::MapShapes(faces_(i), TopAbs_VERTEX, vertices_);
    }
  }

  void add_vertex(const TopoDS_Vertex& vertex) {
    model_.vertices.push_back({to_eigen(BRep_Tool::Pnt(vertex)), BRep_Tool::Tolerance(vertex)});
    model_.extend_bounds(model_.vertices.back().point);
  }

  void add_edge(const TopoDS_Edge& edge) {
    const TopoDS_Edge forward = TopoDS::Edge(edge.Oriented(TopAbs_FORWARD));
    CadEdge e{};
    BRep_Tool::Range(forward, e.first, e.last);
    TopoDS_Vertex start, end;
    TopExp::Vertices(forward, start, end);
    if (!start.IsNull()) e.start = VertexId(vertices_.FindIndex(start) - 1);
    if (!end.IsNull()) e.end = VertexId(vertices_.FindIndex(end) - 1);
    e.tolerance = BRep_Tool::Tolerance(forward);
    double first, last;
    const Handle(Geom_Curve) curve = BRep_Tool::Curve(forward, first, last);
    e.is_degenerate = BRep_Tool::Degenerated(forward) || curve.IsNull();
    model_.curves.push_back(e.is_degenerate ? Handle(Geom_Curve)() : curve);
    if (!e.is_degenerate) {
      e.first = first;
      e.last = last;
      const GeomAdaptor_Curve shape(curve);
      e.is_free_form = shape.GetType() > GeomAbs_Parabola;
      e.is_rational =
          (shape.GetType() == GeomAbs_BSplineCurve || shape.GetType() == GeomAbs_BezierCurve) &&
          shape.IsRational();
      e.length = length(curve, first, last);
    }
    model_.edges.push_back(e);
  }

  double length(const Handle(Geom_Curve) & curve, double first, double last) {
    double sum = 0;
    Vector3d previous = to_eigen(curve->Value(first));
    for (int i = 1; i <= kEdgeSamples; ++i) {
      const Vector3d p = to_eigen(curve->Value(first + (last - first) * i / kEdgeSamples));
      sum += (p - previous).norm();
      model_.extend_bounds(p);
      previous = p;
    }
    return sum;
  }

  void add_face(const TopoDS_Face& oriented) {
    const FaceId id(model_.faces.size());
    const TopoDS_Face face = TopoDS::Face(oriented.Oriented(TopAbs_FORWARD));
    CadFace f{};
    f.is_reversed = oriented.Orientation() == TopAbs_REVERSED;
    f.tolerance = BRep_Tool::Tolerance(face);
    f.solid = f.other_solid = -1;
    if (source_.face_name) f.name = source_.face_name(oriented);
    const Handle(Geom_Surface) surface = BRep_Tool::Surface(face);
    f.type = surface_type(GeomAdaptor_Surface(surface).GetType());
    model_.surfaces.push_back(surface);
    model_.natural_period.emplace_back(surface->IsUPeriodic() ? surface->UPeriod() : 0,
                                       surface->IsVPeriodic() ? surface->VPeriod() : 0);
    model_.loops.emplace_back();
    model_.faces.push_back(f);
    std::vector<std::vector<EdgeUse>> wires;
    for (TopoDS_Iterator it(face); it.More(); it.Next())
      if (it.Value().ShapeType() == TopAbs_WIRE) wires.push_back(edge_uses(face, it.Value()));
    repair_pcurves(model_, id, wires);
    for (const auto& wire : wires) add_wire(id, wire);
    model_.loops[id].close();
  }

  std::vector<EdgeUse> edge_uses(const TopoDS_Face& face, const TopoDS_Shape& wire) {
    std::vector<EdgeUse> uses;
    for (TopExp_Explorer it(wire, TopAbs_EDGE); it.More(); it.Next()) {
      const TopoDS_Edge edge = TopoDS::Edge(it.Current());
      const EdgeId e(edges_.FindIndex(edge) - 1);
      double first, last;
      const Handle(Geom2d_Curve) curve = BRep_Tool::CurveOnSurface(edge, face, first, last);
      if (curve.IsNull()) continue;
      CadEdge& record = model_.edges[e];
      if (record.is_degenerate) {
        record.first = first;
        record.last = last;
      } else if (BRep_Tool::IsClosed(edge, face)) {
        record.is_seam = true;
      }
      uses.push_back({e,
                      {curve, first, last, record.first, record.last},
                      edge.Orientation() == TopAbs_REVERSED,
                      edge.Orientation() == TopAbs_INTERNAL});
    }
    return uses;
  }

  void add_wire(FaceId id, const std::vector<EdgeUse>& uses) {
    std::vector<CoedgeId> coedges;
    for (const EdgeUse& use : uses) {
      const CoedgeId c(model_.coedges.size());
      model_.coedges.push_back({use.edge, id, use.is_reversed != model_.faces[id].is_reversed});
      model_.pcurves.push_back(use.pcurve);
      model_.edges[use.edge].coedges.push_back(c);
      coedges.push_back(c);
      if (use.is_slit) continue;
      const CadEdge& edge = model_.edges[use.edge];
      model_.loops[id].add(use.pcurve, use.is_reversed, edge.start, edge.end);
    }
    if (!coedges.empty()) model_.faces[id].wires.push_back(std::move(coedges));
  }

  void mark_solids() {
    for (TopExp_Explorer solid(shape_, TopAbs_SOLID); solid.More(); solid.Next()) {
      for (TopExp_Explorer face(solid.Current(), TopAbs_FACE); face.More(); face.Next()) {
        const FaceId f(faces_.FindIndex(face.Current()) - 1);
        if (f < 0) continue;
        CadFace& record = model_.faces[f];
        (record.solid < 0 ? record.solid : record.other_solid) = model_.solids;
      }
      ++model_.solids;
    }
  }

  void finish_face(FaceId id) {
    set_domain(id);
    set_periods(id);
    const CadFace& f = model_.faces[id];
    constexpr int n = 8;
    for (int i = 0; i <= n; ++i)
      for (int j = 0; j <= n; ++j) {
        const Vector2d uv = f.lower + Vector2d(i, j).cwiseProduct(f.upper - f.lower) / n;
        if (model_.loops[id].empty() || model_.loops[id].contains(uv))
          model_.extend_bounds(to_eigen(model_.surfaces[id]->Value(uv.x(), uv.y())));
      }
  }

  // The wires give tight bounds; a face without them has the surface's own.
  void set_domain(FaceId id) {
    CadFace& f = model_.faces[id];
    const TrimLoops& loops = model_.loops[id];
    if (loops.empty()) {
      model_.surfaces[id]->Bounds(f.lower[0], f.upper[0], f.lower[1], f.upper[1]);
    } else {
      f.lower = loops.lower();
      f.upper = loops.upper();
    }
  }

  // A face closes on itself where a seam's two pcurves stand a period apart.
  void set_periods(FaceId id) {
    CadFace& f = model_.faces[id];
    for (const auto& wire : f.wires)
      for (std::size_t i = 0; i < wire.size(); ++i)
        for (std::size_t j = i + 1; j < wire.size(); ++j) {
          const EdgeId edge = model_.coedges[wire[i]].edge;
          if (edge != model_.coedges[wire[j]].edge || !model_.edges[edge].is_seam) continue;
          const double t = 0.5 * (model_.edges[edge].first + model_.edges[edge].last);
          const Vector2d gap = (model_.pcurves[wire[i]](t) - model_.pcurves[wire[j]](t)).cwiseAbs();
          const Vector2d size = f.upper - f.lower;
          const int axis = gap.x() * size.y() > gap.y() * size.x() ? 0 : 1;
          f.period[axis] = gap[axis];
        }
    if (model_.loops[id].empty())
      for (int a = 0; a < 2; ++a) f.period[a] = model_.natural_period[id][a];
  }

  const TopoDS_Shape& shape_;
  const ShapeSource& source_;
  CadModel::Impl& model_;
  TopTools_IndexedMapOfShape faces_, edges_, vertices_;
};

}  // namespace

TopTools_IndexedMapOfShape usable_faces(const TopoDS_Shape& shape) {
  TopTools_IndexedMapOfShape all, usable;
  TopExp::MapShapes(shape, TopAbs_FACE, all);
  for (int i = 1; i <= all.Extent(); ++i)
    if (!BRep_Tool::Surface(TopoDS::Face(all(i))).IsNull()) usable.Add(all(i));
  return usable;
}

CadModel build_model(const TopoDS_Shape& shape, const ShapeSource& source) {
  auto impl = std::make_shared<CadModel::Impl>();
  impl->file_name = source.file_name;
  impl->file_unit = source.file_unit;
  impl->shape = shape;
  impl->merged_faces = source.merged_faces;
  ModelBuilder(shape, source, *impl).build();
  return CadModel(std::move(impl));
}

}  // namespace cadmorph
