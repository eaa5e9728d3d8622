#include "surface/joints.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <map>
#include <optional>
#include <set>

#include "cad/projector.h"
#include "core/rbf/point_order.h"
#include "surface/node_feet.h"

namespace cadmorph {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

// Of a face: as many as a dense system takes beside the samples of the wires. The tests of joints
// pass with half of it, and with half and twice of what is below.
constexpr std::size_t kMostJoints = 500;
// Nearer to a wire or a corner, in units of the shortest mesh edge, a node lies on it: far above
// what associates it (kOnEntity), far below the distance of the next node.
constexpr double kClear = 0.05;
constexpr double kAcross = 0.17;  // sine of 10 degrees: entities that cross, not touch

// Points along the edges of a face.
class Outline {
 public:
  Outline(const CadModel& model, FaceId face) : model_(model) {
    std::set<EdgeId> edges;
    for (const auto& wire : model.faces()[face].wires)
      for (const CoedgeId c : wire) edges.insert(model.coedges()[c].edge);
    for (const EdgeId edge : edges) {
      const CadEdge& e = model.edges()[edge];
      if (!e.is_physical()) continue;
      for (int i = 0; i <= kSpans; ++i) {
        const double t = e.first + (e.last - e.first) * i / kSpans;
        seeds_.push_back({edge, t, model.evaluate_edge(edge, t).point});
      }
    }
  }

  // An edge within reach.
  std::optional<EdgeFoot> near(const Vector3d& x, double reach) const {
    for (const Seed& seed : seeds_) {
      if ((seed.point - x).norm() > reach + model_.edges()[seed.edge].length / kSpans) continue;
      const EdgeFoot foot = project_on_edge(model_, seed.edge, x, seed.t);
      if (foot.distance < reach) return foot;
    }
    return std::nullopt;
  }

 private:
  struct Seed {
    EdgeId edge;
    double t;
    Vector3d point;
  };
  static constexpr int kSpans =
      16;  // of an edge: Newton's method starts 11 degrees of a circle off
  const CadModel& model_;
  std::vector<Seed> seeds_;
};

class JointFinder {
 public:
  JointFinder(const CadModel& base, const SurfaceMesh& surface, const Association& association)
      : base_(base), surface_(surface), association_(association) {
    joints_.of_face.resize(base.faces().size());
    faces_at_.resize(base.vertices().size());
    for (const FaceId f : base.faces().ids())
      for (const auto& wire : base.faces()[f].wires)
        for (const CoedgeId c : wire) {
          const CadEdge& e = base.edges()[base.coedges()[c].edge];
          for (const VertexId v : {e.start, e.end})
            if (v >= 0) faces_at_[v].push_back(f);
        }
  }

  Joints run() {
    for (const RowId n : association_.entity.ids())
      if (association_.dimension[n] != CadDimension::None) look_at(n);
    collect_nodes();
    for (auto& of_face : joints_.of_face) thin_out(of_face);
    return std::move(joints_);
  }

 private:
  CadDimension dimension(RowId n) const { return association_.dimension[n]; }
  VertexId vertex(RowId n) const { return association_.vertex(n); }
  EdgeId edge(RowId n) const { return association_.edge(n); }
  FaceId face(RowId n) const { return association_.face(n); }

  void look_at(RowId n) {
    const bool is_vertex = dimension(n) == CadDimension::Vertex;
    std::map<EdgeId, double> edges;  // with a parameter
    if (dimension(n) != CadDimension::Face) edges = foreign_edges(n);
    Joints::Crossing crossing{n, {}, {}};
    bool crosses = false;
    for (const FaceId face : foreign_faces(n)) {
      if (const auto wire = wire_near(face, n)) {
        if (dimension(n) != CadDimension::Face && !is_on_curve_of(n, wire->edge))
          edges.emplace(wire->edge, wire->t);
        continue;
      }
      const std::optional<Vector2d> uv = within(face, n);
      if (!uv) continue;
      const double sine = is_vertex ? 0 : sine_to_face(n, face, *uv);
      const bool coincides = dimension(n) == CadDimension::Face && sine <= kAcross;
      if (coincides) continue;
      crosses |= sine > kAcross;
      joints_.of_face[face].push_back({n, *uv});
      crossing.faces.push_back(face);
    }
    for (const auto& [edge, seed] : edges) {
      const std::optional<double> t = along(edge, n, seed);
      if (!t || (!is_vertex && sine_to_edge(n, edge, *t) < kAcross)) continue;
      crosses |= !is_vertex;
      joints_.on_edges.push_back({n, edge, *t});
      crossing.edges.push_back(edge);
    }
    if (crosses) add(std::move(crossing));
  }

  // The node's own entity is one of those that cross.
  void add(Joints::Crossing crossing) {
    const RowId n = crossing.node;
    if (dimension(n) == CadDimension::Face) {
      crossing.faces.push_back(face(n));
      joints_.of_face[face(n)].push_back({n, association_.uv.row(n)});
    } else {
      crossing.edges.push_back(edge(n));
      joints_.on_edges.push_back({n, edge(n), association_.t(n)});
    }
    joints_.crossings.push_back(std::move(crossing));
  }

  std::vector<FaceId> own_faces(RowId n) const {
    if (dimension(n) == CadDimension::Face) return {face(n)};
    if (dimension(n) == CadDimension::Vertex) return faces_at_[vertex(n)];
    std::vector<FaceId> faces;
    for (const CoedgeId c : base_.edges()[edge(n)].coedges)
      faces.push_back(base_.coedges()[c].face);
    return faces;
  }

  // Of the facets around a node, ascending; not those that its own entity is or bounds.
  std::vector<FaceId> foreign_faces(RowId n) const {
    std::vector<FaceId> faces;
    for (const FacetId f : surface_.facets_at(n)) {
      const FaceId face = association_.facet_face[f];
      const bool is_own = dimension(n) == CadDimension::Face && face == this->face(n);
      if (face >= 0 && !is_own) faces.push_back(face);
    }
    if (faces.empty()) return faces;
    for (const FaceId own : own_faces(n)) std::erase(faces, own);
    std::ranges::sort(faces);
    faces.erase(std::unique(faces.begin(), faces.end()), faces.end());
    return faces;
  }

  // Of the nodes beside a node, with a parameter; not its own curve's.
  std::map<EdgeId, double> foreign_edges(RowId n) const {
    std::map<EdgeId, double> edges;
    for (const FacetId f : surface_.facets_at(n))
      for (const RowId other : surface_.facets[f])
        if (dimension(other) == CadDimension::Edge && !is_on_curve_of(n, edge(other)))
          edges.emplace(edge(other), association_.t(other));
    return edges;
  }

  bool is_on_curve_of(RowId n, EdgeId edge) const {
    const CadSkeleton& skeleton = base_.skeleton();
    const CurveId curve = skeleton.curve_of_edge[edge];
    if (dimension(n) == CadDimension::Edge) return skeleton.curve_of_edge[this->edge(n)] == curve;
    return std::ranges::any_of(skeleton.curves[curve].links, [&](const CurveLink& link) {
      const CadEdge& e = base_.edges()[link.edge];
      return e.start == vertex(n) || e.end == vertex(n);
    });
  }

  double on_entity(RowId n, double tolerance) const {
    return tolerance + kOnEntity * surface_.local_length[n];
  }

  std::optional<EdgeFoot> wire_near(FaceId face, RowId n) {
    const Outline& outline = outlines_.try_emplace(face, base_, face).first->second;
    return outline.near(surface_.points.row(n), kClear * surface_.local_length[n]);
  }

  // Parameters of a node that lies on a face.
  std::optional<Vector2d> within(FaceId face, RowId n) const {
    const FaceFoot foot = project_on_face(base_, face, surface_.points.row(n), seed(face, n));
    if (foot.distance > on_entity(n, base_.faces()[face].tolerance) ||
        !base_.is_inside(face, foot.uv))
      return std::nullopt;
    return foot.uv;
  }

  // Parameters of a node of the face beside this one; else those that a search finds.
  Vector2d seed(FaceId face, RowId n) const {
    for (const FacetId f : surface_.facets_at(n))
      for (const RowId other : surface_.facets[f])
        if (dimension(other) == CadDimension::Face && this->face(other) == face)
          return association_.uv.row(other);
    return project_globally(base_, face, surface_.points.row(n)).uv;
  }

  // Parameter of a node that lies on an edge, clear of the corners where it ends.
  std::optional<double> along(EdgeId edge, RowId n, double seed) const {
    const Vector3d x = surface_.points.row(n);
    const CadEdge& e = base_.edges()[edge];
    const EdgeFoot foot = project_on_edge(base_, edge, x, seed);
    if (foot.distance > on_entity(n, e.tolerance)) return std::nullopt;
    for (const VertexId v : {e.start, e.end})
      if (v >= 0 && base_.skeleton().corner_of_vertex[v] >= 0 &&
          (base_.vertices()[v].point - x).norm() < kClear * surface_.local_length[n])
        return std::nullopt;
    return foot.t;
  }

  Vector3d tangent(EdgeId edge, double t) const {
    return base_.evaluate_edge(edge, t).dt.normalized();
  }

  // Of the angle at which a node's own edge or face meets another one.
  double sine_to_face(RowId n, FaceId face, const Vector2d& uv) const {
    const Vector3d normal = base_.normal(face, uv);
    if (dimension(n) == CadDimension::Edge)
      return std::abs(normal.dot(tangent(this->edge(n), association_.t(n))));
    return normal.cross(base_.normal(this->face(n), association_.uv.row(n))).norm();
  }

  double sine_to_edge(RowId n, EdgeId edge, double t) const {
    return tangent(edge, t).cross(tangent(this->edge(n), association_.t(n))).norm();
  }

  void collect_nodes() {
    std::vector<RowId>& nodes = joints_.nodes;
    for (const auto& of_face : joints_.of_face)
      for (const Joints::OnFace& joint : of_face) nodes.push_back(joint.node);
    for (const Joints::OnEdge& joint : joints_.on_edges) nodes.push_back(joint.node);
    std::ranges::sort(nodes);
    nodes.erase(std::ranges::unique(nodes).begin(), nodes.end());
  }

  void thin_out(std::vector<Joints::OnFace>& joints) const {
    if (joints.size() <= kMostJoints) return;
    Points at(std::ssize(joints), 3);
    for (Index i = 0; i < at.rows(); ++i)
      at.row(i) = surface_.points.row(joints[static_cast<std::size_t>(i)].node);
    const auto order = farthest_point_order(at).rows;
    std::vector<Joints::OnFace> spread;
    for (std::size_t i = 0; i < kMostJoints; ++i) spread.push_back(joints[order[i]]);
    joints = std::move(spread);
  }

  const CadModel& base_;
  const SurfaceMesh& surface_;
  const Association& association_;
  IdVector<VertexId, std::vector<FaceId>> faces_at_;
  std::map<FaceId, Outline> outlines_;  // of faces, once needed
  Joints joints_;
};

}  // namespace

Joints find_joints(const CadModel& base, const SurfaceMesh& surface,
                   const Association& association) {
  return JointFinder(base, surface, association).run();
}

}  // namespace cadmorph
