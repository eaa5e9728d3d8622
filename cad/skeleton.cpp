#include "cad/skeleton.h"

#include <algorithm>
#include <cmath>
#include <functional>

#include "core/kd_tree.h"

namespace cadmorph {
namespace {

// A joint that turns by more is a corner of the design, not a cut by the exporter. With 10 or 40
// degrees 30 pairs come out the same, and the tests of seams and maps pass.
constexpr double kSmoothCosine = 0.94;  // 20 degrees

struct EdgeEnd {
  EdgeId edge;
  bool is_start;
};

IdVector<VertexId, std::vector<EdgeEnd>> edge_ends(const CadModel& model) {
  IdVector<VertexId, std::vector<EdgeEnd>> ends(model.vertices().size());
  for (const EdgeId e : model.edges().ids()) {
    const CadEdge& edge = model.edges()[e];
    if (!edge.is_physical()) continue;
    if (edge.start >= 0) ends[edge.start].push_back({e, true});
    if (edge.end >= 0) ends[edge.end].push_back({e, false});
  }
  return ends;
}

// Vertices where a seam ends: there exporters cut a curve for no reason of the design. So they do
// where the seam is that of another sheet, which may have vertices of its own in the same places.
IdVector<VertexId, char> seam_vertices(const CadModel& model) {
  const auto& vertices = model.vertices();
  IdVector<VertexId, char> is_seam_end(vertices.size(), 0);
  std::vector<VertexId> ends;
  for (const CadEdge& edge : model.edges())
    if (edge.is_seam)
      for (const VertexId v : {edge.start, edge.end})
        if (v >= 0) ends.push_back(v);
  if (ends.empty()) return is_seam_end;
  Points places(std::ssize(ends), 3);
  for (std::size_t i = 0; i < ends.size(); ++i)
    places.row(static_cast<Index>(i)) = vertices[ends[i]].point;
  const KdTree tree(places);
  for (const VertexId v : vertices.ids()) {
    const Neighbour near = tree.nearest(vertices[v].point.data(), 1).front();
    const double reach =
        vertices[v].tolerance + vertices[ends[static_cast<std::size_t>(near.index)]].tolerance;
    is_seam_end[v] = near.squared_distance <= reach * reach;
  }
  return is_seam_end;
}

std::vector<FaceId> adjacent_faces(const CadModel& model, EdgeId edge) {
  std::vector<FaceId> faces;
  for (const CoedgeId c : model.edges()[edge].coedges) faces.push_back(model.coedges()[c].face);
  std::sort(faces.begin(), faces.end());
  return faces;
}

// Unit tangent at an end, pointing into the edge.
Eigen::Vector3d inward_tangent(const CadModel& model, const EdgeEnd& end) {
  const CadEdge& edge = model.edges()[end.edge];
  const Eigen::Vector3d d = model.evaluate_edge(end.edge, end.is_start ? edge.first : edge.last).dt;
  return (end.is_start ? 1.0 : -1.0) * d.normalized();
}

// Where two surfaces meet: these say where the curve runs, its ends lie where a kernel began to
// trace it. Between plane faces it was drawn, joints and all.
bool is_traced(const CadModel& model, EdgeId edge) {
  const std::vector<FaceId> faces = adjacent_faces(model, edge);
  const CadEdge& curve = model.edges()[edge];
  return curve.is_free_form && !curve.is_rational && faces.size() > 1 &&
         std::ranges::any_of(
             faces, [&](FaceId face) { return model.faces()[face].type != SurfaceType::Plane; });
}

// Minus the cosine of the angle by which a joint turns; more where it is a corner, and less where
// it is none, whatever the angle.
double sharpness(const CadModel& model, const std::vector<EdgeEnd>& ends, bool may_join) {
  constexpr double kCorner = 2, kNone = -2;
  if (ends.empty()) return kNone;
  if (ends.size() != 2) return kCorner;
  may_join |= is_traced(model, ends[0].edge) && is_traced(model, ends[1].edge);
  if (!may_join && ends[0].edge != ends[1].edge) return kCorner;
  if (adjacent_faces(model, ends[0].edge) != adjacent_faces(model, ends[1].edge)) return kCorner;
  return inward_tangent(model, ends[0]).dot(inward_tangent(model, ends[1]));
}

class Chainer {
 public:
  Chainer(const CadModel& model, JoinEdges join, std::optional<std::size_t> corners)
      : model_(model), join_(join), wanted_corners_(corners), ends_(edge_ends(model)) {}

  CadSkeleton build() {
    mark_corners();
    skeleton_.curve_of_edge.assign(model_.edges().size(), {});
    for (const EdgeId e : model_.edges().ids())
      if (model_.edges()[e].is_physical() && skeleton_.curve_of_edge[e] < 0) chain(e);
    return std::move(skeleton_);
  }

 private:
  void mark_corners() {
    const IdVector<VertexId, char> is_seam_end = seam_vertices(model_);
    IdVector<VertexId, double> sharp;
    for (const VertexId v : model_.vertices().ids())
      sharp.push_back(
          sharpness(model_, ends_[v], join_ == JoinEdges::WhereSmooth || is_seam_end[v]));
    const double least = least_corner(sharp);
    skeleton_.corner_of_vertex.assign(model_.vertices().size(), {});
    for (const VertexId v : model_.vertices().ids())
      if (sharp[v] > least) {
        skeleton_.corner_of_vertex[v] = CornerId(skeleton_.corners.size());
        skeleton_.corners.push_back(v);
      }
  }

  // Joints that are sharper are corners.
  double least_corner(const IdVector<VertexId, double>& sharp) const {
    if (!wanted_corners_) return -kSmoothCosine;
    constexpr double kStraight = -1, kBack = 1;  // the angle decides within these
    std::vector<double> turns(sharp.begin(), sharp.end());
    std::ranges::sort(turns, std::greater());
    const double next = *wanted_corners_ < turns.size() ? turns[*wanted_corners_] : kStraight;
    return std::clamp(next, kStraight, kBack);
  }

  VertexId end_vertex(const CurveLink& link) const {
    const CadEdge& edge = model_.edges()[link.edge];
    return link.is_reversed ? edge.start : edge.end;
  }

  bool is_corner_vertex(VertexId v) const { return v < 0 || skeleton_.corner_of_vertex[v] >= 0; }

  // The link that goes on at the end of `link`; its edge is -1 at a corner.
  CurveLink next(const CurveLink& link) const {
    const VertexId v = end_vertex(link);
    if (is_corner_vertex(v)) return {EdgeId(), false};
    const auto& ends = ends_[v];
    const bool came_by_first = ends[0].edge == link.edge && ends[0].is_start == link.is_reversed;
    const EdgeEnd& go = came_by_first ? ends[1] : ends[0];
    return {go.edge, !go.is_start};
  }

  void chain(EdgeId seed) {
    CurveLink first{seed, false};
    for (CurveLink back = next({seed, true}); back.edge >= 0 && back.edge != seed;
         back = next(back))
      first = {back.edge, !back.is_reversed};
    CadCurve curve{};
    for (CurveLink link = first;;) {
      curve.links.push_back(link);
      curve.length += model_.edges()[link.edge].length;
      skeleton_.curve_of_edge[link.edge] = CurveId(skeleton_.curves.size());
      link = next(link);
      if (link.edge < 0 || link.edge == first.edge) break;
    }
    curve.start = corner(end_vertex({first.edge, !first.is_reversed}));
    curve.end = corner(end_vertex(curve.links.back()));
    curve.faces = adjacent_faces(model_, first.edge);
    skeleton_.curves.push_back(std::move(curve));
  }

  CornerId corner(VertexId vertex) const {
    return vertex < 0 ? CornerId() : skeleton_.corner_of_vertex[vertex];
  }

  const CadModel& model_;
  JoinEdges join_;
  std::optional<std::size_t> wanted_corners_;
  IdVector<VertexId, std::vector<EdgeEnd>> ends_;
  CadSkeleton skeleton_;
};

}  // namespace

CadSkeleton build_skeleton(const CadModel& model, JoinEdges join,
                           std::optional<std::size_t> corners) {
  return Chainer(model, join, corners).build();
}

}  // namespace cadmorph
