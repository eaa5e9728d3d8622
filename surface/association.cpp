#include "surface/association.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <sstream>

#include "cad/face_sampler.h"
#include "cad/projector.h"
#include "core/errors.h"
#include "core/kd_tree.h"
#include "core/parallel.h"
#include "surface/free_patches.h"
#include "surface/mesh_unit.h"
#include "surface/surface_mesh.h"

namespace cadmorph {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr Index kMinSamples = 20'000, kMaxSamples = 1'000'000, kSamplesPerNode = 4;
// A node belongs to a corner or curve when it is nearer than this part of its shortest mesh edge:
// far above the digits that exchange formats cut, far below any mesh size.
constexpr double kOnEntity = 1e-3;
// A node off the CAD goes to the curve between the faces its facets vote for within this distance.
constexpr double kVotedCurve = 0.5;
// Where a face of a touching solid holds the node, only within this multiple of its distance from
// the voted faces: the curve is as near where they meet at 30 degrees or more.
constexpr double kMeetingFaces = 2;
// A point on a face has a sample within this many spacings, uneven parametrisations included.
constexpr double kFar = 4;
constexpr Index kGrain = 512;

struct Candidate {
  int face;
  Vector2d uv;
  double distance;  // to the surface, which may reach beyond the wires
  double gap;       // to the trimmed face
};

struct NodeFeet {
  std::vector<Candidate> faces;  // nearest first
  std::vector<EdgeFoot> edges;   // physical edges, nearest first
};

class Associator {
 public:
  Associator(const CadModel& model, const SurfaceMesh& surface, const AssociationOptions& options)
      : model_(model),
        surface_(surface),
        tolerance_(options.tolerance),
        faces_(sample_faces(
            model, std::clamp(kSamplesPerNode * surface.points.rows(), kMinSamples, kMaxSamples))),
        face_tree_(faces_.points) {
    sample_edges();
  }

  Association run() {
    const Index nodes = surface_.points.rows();
    feet_.resize(static_cast<std::size_t>(nodes));
    parallel_for(nodes, kGrain, [&](Index begin, Index end) {
      for (Index n = begin; n < end; ++n) find_feet(n);
    });
    prepare(nodes);
    parallel_for(nodes, kGrain, [&](Index begin, Index end) {
      for (Index n = begin; n < end; ++n) classify_by_distance(n);
    });
    const auto facets = static_cast<Index>(surface_.facets.size());
    parallel_for(facets, kGrain, [&](Index begin, Index end) {
      for (Index f = begin; f < end; ++f) result_.facet_face[f] = vote(f);
    });
    parallel_for(nodes, kGrain, [&](Index begin, Index end) {
      for (Index n = begin; n < end; ++n) classify_by_vote(n);
    });
    return std::move(result_);
  }

 private:
  void sample_edges() {
    std::vector<Vector3d> points;
    for (int e = 0; e < static_cast<int>(model_.edges().size()); ++e) {
      const CadEdge& edge = model_.edges()[e];
      if (!edge.is_physical()) continue;
      const int n = std::clamp(static_cast<int>(edge.length / faces_.spacing), 8, 20'000);
      for (int i = 0; i <= n; ++i) {
        const double t = edge.first + (edge.last - edge.first) * i / n;
        points.push_back(model_.evaluate_edge(e, t).point);
        edge_seeds_.push_back({e, t});
        if (i > 0)
          edge_spacing_ = std::max(edge_spacing_, (points.back() - points.rbegin()[1]).norm());
      }
    }
    if (points.empty()) return;
    RowMatrix rows(static_cast<Index>(points.size()), 3);
    for (std::size_t i = 0; i < points.size(); ++i) rows.row(static_cast<Index>(i)) = points[i];
    edge_tree_.emplace(rows);
  }

  void prepare(Index nodes) {
    result_.dimension.assign(static_cast<std::size_t>(nodes), CadDimension::None);
    result_.entity.assign(static_cast<std::size_t>(nodes), -1);
    result_.uv.setZero(nodes, 2);
    result_.distance.setZero(nodes);
    result_.is_free.assign(static_cast<std::size_t>(nodes), 0);
    result_.facet_face.assign(surface_.facets.size(), -1);
  }

  Vector3d point(Index n) const { return surface_.points.row(n); }
  double reach(Index n) const { return tolerance_ * surface_.local_length[n]; }

  void find_feet(Index n) {
    const Vector3d x = point(n);
    NodeFeet& feet = feet_[n];
    find_edge_feet(n, x, feet);
    const double nearest = std::sqrt(face_tree_.nearest(x.data(), 1)[0].squared_distance);
    if (nearest > kFar * faces_.spacing + reach(n)) return;
    std::vector<int> seen;
    for (const Neighbour& near :
         face_tree_.within(x.data(), 1.5 * std::max(nearest, faces_.spacing))) {
      const int face = faces_.face[near.index];
      if (std::find(seen.begin(), seen.end(), face) != seen.end()) continue;
      seen.push_back(face);
      const FaceFoot foot = project_on_face(model_, face, x, faces_.uv[near.index]);
      if (foot.distance <= reach(n) + model_.faces()[face].tolerance)
        feet.faces.push_back({face, foot.uv, foot.distance, foot.distance});
    }
    if (feet.faces.empty() && !seen.empty()) retry_globally(n, x, seen.front(), feet);
    std::sort(feet.faces.begin(), feet.faces.end(),
              [](const Candidate& a, const Candidate& b) { return a.distance < b.distance; });
    drop_outside(n, feet);
  }

  // The local iteration may have left the basin; the nearest face deserves a global search.
  void retry_globally(Index n, const Vector3d& x, int face, NodeFeet& feet) {
    const double nearest = std::sqrt(face_tree_.nearest(x.data(), 1)[0].squared_distance);
    if (nearest > faces_.spacing + reach(n)) return;
    const FaceFoot foot = project_globally(model_, face, x);
    if (foot.distance <= reach(n) + model_.faces()[face].tolerance)
      feet.faces.push_back({face, foot.uv, foot.distance, foot.distance});
  }

  void find_edge_feet(Index n, const Vector3d& x, NodeFeet& feet) const {
    if (!edge_tree_) return;
    const double radius =
        edge_spacing_ + std::max(reach(n), kVotedCurve * surface_.local_length[n]);
    std::vector<int> seen;
    for (const Neighbour& near : edge_tree_->within(x.data(), radius)) {
      const auto [edge, t] = edge_seeds_[near.index];
      if (std::find(seen.begin(), seen.end(), edge) != seen.end()) continue;
      seen.push_back(edge);
      feet.edges.push_back(project_on_edge(model_, edge, x, t));
    }
    std::sort(feet.edges.begin(), feet.edges.end(),
              [](const EdgeFoot& a, const EdgeFoot& b) { return a.distance < b.distance; });
  }

  // The nearest near edge of a face; null without one.
  const EdgeFoot* near_wire(Index n, int face, const NodeFeet& feet) const {
    for (const EdgeFoot& foot : feet.edges)
      if (foot.distance <=
          kVotedCurve * surface_.local_length[n] + model_.edges()[foot.edge].tolerance)
        for (const int c : model_.edges()[foot.edge].coedges)
          if (model_.coedges()[c].face == face) return &foot;
    return nullptr;
  }

  // A foot on the carrier surface outside the wires belongs to another face, or to none.
  void drop_outside(Index n, NodeFeet& feet) const {
    for (Candidate& c : feet.faces) {
      if (model_.is_inside(c.face, c.uv)) continue;
      const EdgeFoot* foot = near_wire(n, c.face, feet);
      c.gap = foot ? foot->distance : std::numeric_limits<double>::infinity();
    }
    std::erase_if(feet.faces, [](const Candidate& c) { return std::isinf(c.gap); });
  }

  double on_entity(Index n, double tolerance) const {
    return tolerance + kOnEntity * surface_.local_length[n];
  }

  void assign(Index n, CadDimension dimension, int entity, const Vector2d& uv, double distance) {
    result_.dimension[n] = dimension;
    result_.entity[n] = entity;
    result_.uv.row(n) = uv;
    result_.distance[n] = distance;
  }

  // Nearest physical vertex among the ends of the near edges.
  std::pair<int, double> nearest_corner(Index n) const {
    std::pair<int, double> best{-1, 1e300};
    for (const EdgeFoot& foot : feet_[n].edges)
      for (const int v : {model_.edges()[foot.edge].start, model_.edges()[foot.edge].end}) {
        if (v < 0 || model_.skeleton().corner_of_vertex[v] < 0) continue;
        const double d = (model_.vertices()[v].point - point(n)).norm();
        if (d < best.second) best = {v, d};
      }
    return best;
  }

  void classify_by_distance(Index n) {
    const NodeFeet& feet = feet_[n];
    const auto [corner, distance] = nearest_corner(n);
    if (corner >= 0 && distance <= on_entity(n, model_.vertices()[corner].tolerance)) {
      assign(n, CadDimension::Vertex, corner, Vector2d::Zero(), distance);
      return;
    }
    if (!feet.edges.empty()) {
      const EdgeFoot& foot = feet.edges.front();
      if (foot.distance <= on_entity(n, model_.edges()[foot.edge].tolerance)) {
        assign(n, CadDimension::Edge, foot.edge, {foot.t, 0}, foot.distance);
        return;
      }
    }
    if (!feet.faces.empty()) {
      const Candidate& c = feet.faces.front();
      assign(n, CadDimension::Face, c.face, c.uv, c.distance);
    }
  }

  std::vector<int> faces_of(int edge) const {
    std::vector<int> faces;
    for (const int c : model_.edges()[edge].coedges) faces.push_back(model_.coedges()[c].face);
    return faces;
  }

  // Faces of the near edges that end at a corner near a node.
  std::vector<int> faces_at(Index n, int corner) const {
    std::vector<int> faces;
    for (const EdgeFoot& foot : feet_[n].edges) {
      const CadEdge& e = model_.edges()[foot.edge];
      if (e.start != corner && e.end != corner) continue;
      for (const int face : faces_of(foot.edge)) faces.push_back(face);
    }
    return faces;
  }

  // Faces that a node may belong to, by its feet or by the corner or edge it lies on.
  std::vector<int> possible_faces(Index n) const {
    std::vector<int> faces;
    if (result_.dimension[n] == CadDimension::Edge) faces = faces_of(result_.entity[n]);
    if (result_.dimension[n] == CadDimension::Vertex) faces = faces_at(n, result_.entity[n]);
    for (const Candidate& c : feet_[n].faces) faces.push_back(c.face);
    std::sort(faces.begin(), faces.end());
    faces.erase(std::unique(faces.begin(), faces.end()), faces.end());
    return faces;
  }

  std::vector<int> common_faces(Index f) const {
    std::vector<int> common;
    for (int i = 0; i < surface_.corners[f]; ++i) {
      const auto faces = possible_faces(surface_.facets[f][i]);
      if (i == 0) {
        common = faces;
        continue;
      }
      std::vector<int> both;
      std::set_intersection(common.begin(), common.end(), faces.begin(), faces.end(),
                            std::back_inserter(both));
      common = std::move(both);
    }
    return common;
  }

  // Largest distance of a facet's corners from a trimmed face.
  double corner_gap(Index f, int face) const {
    double gap = 0;
    for (int i = 0; i < surface_.corners[f]; ++i)
      for (const Candidate& c : feet_[surface_.facets[f][i]].faces)
        if (c.face == face) gap = std::max(gap, c.gap);
    return gap;
  }

  // CAD face of a facet: common to its corners; of several, the one that its corners, centroid and
  // normal fit.
  int vote(Index f) const {
    const auto common = common_faces(f);
    if (common.empty()) return -1;
    if (common.size() == 1) return common.front();
    const Vector3d x = centroid(surface_, surface_.points, f);
    const Vector3d area = area_vector(surface_, surface_.points, f);
    const Vector3d normal = area.normalized();
    const double size = std::sqrt(area.norm()) + 1e-300;
    int best = -1;
    double least = 1e300;
    for (const int face : common) {
      const FaceFoot foot = project_on_face(model_, face, x, seed(f, face, x));
      const double tilt = 1 - std::abs(normal.dot(model_.normal(face, foot.uv)));
      const double outside = model_.is_inside(face, foot.uv) ? 0 : 1;
      const double cost = (foot.distance + corner_gap(f, face)) / size + tilt + outside;
      if (cost < least) {
        least = cost;
        best = face;
      }
    }
    return best;
  }

  Vector2d seed(Index f, int face, const Vector3d& x) const {
    for (const int n : surface_.facets[f])
      for (const Candidate& c : feet_[n].faces)
        if (c.face == face && result_.dimension[n] == CadDimension::Face) return c.uv;
    for (const Neighbour& near : face_tree_.within(
             x.data(), 2 * faces_.spacing + surface_.local_length[surface_.facets[f][0]]))
      if (faces_.face[near.index] == face) return faces_.uv[near.index];
    return project_globally(model_, face, x).uv;
  }

  void classify_by_vote(Index n) {
    if (result_.dimension[n] != CadDimension::Face) return;
    std::map<int, int> votes;
    for (int i = surface_.incident_offsets[n]; i < surface_.incident_offsets[n + 1]; ++i)
      ++votes[result_.facet_face[surface_.incident_facets[i]]];
    votes.erase(-1);
    if (votes.empty()) return;
    if (votes.size() > 1 && is_off_any(n, votes) && take_voted_entity(n, votes)) return;
    const auto most =
        std::max_element(votes.begin(), votes.end(),
                         [](const auto& a, const auto& b) { return a.second < b.second; });
    for (const Candidate& c : feet_[n].faces)
      if (c.face == most->first) assign(n, CadDimension::Face, c.face, c.uv, c.distance);
  }

  // Whether the node lies off one of the faces that its facets voted for.
  bool is_off_any(Index n, const std::map<int, int>& votes) const {
    return std::any_of(votes.begin(), votes.end(), [&](const auto& vote) {
      return std::none_of(feet_[n].faces.begin(), feet_[n].faces.end(), [&](const Candidate& c) {
        return c.face == vote.first && c.distance <= on_entity(n, model_.faces()[c.face].tolerance);
      });
    });
  }

  // Whether the voted faces may meet at a corner or edge of `faces`, `distance` from the node. A
  // touching solid's faces pass through nodes of other faces without meeting there.
  bool may_meet(Index n, const std::map<int, int>& votes, const std::vector<int>& faces,
                double distance) const {
    double off = 0;
    bool is_held = false;
    for (const Candidate& c : feet_[n].faces) {
      if (votes.contains(c.face)) off = std::max(off, c.distance);
      is_held |= c.gap <= on_entity(n, model_.faces()[c.face].tolerance) &&
                 std::find(faces.begin(), faces.end(), c.face) == faces.end();
    }
    return !is_held || distance <= kMeetingFaces * off;
  }

  // A node off the CAD between facets of several faces: their common corner or curve.
  bool take_voted_entity(Index n, const std::map<int, int>& votes) {
    const double limit = kVotedCurve * surface_.local_length[n];
    if (votes.size() > 2) {
      const auto [corner, distance] = nearest_corner(n);
      if (corner >= 0 && distance <= limit && may_meet(n, votes, faces_at(n, corner), distance)) {
        assign(n, CadDimension::Vertex, corner, Vector2d::Zero(), distance);
        return true;
      }
    }
    for (const EdgeFoot& foot : feet_[n].edges) {
      if (foot.distance > limit) break;
      const std::vector<int> faces = faces_of(foot.edge);
      const auto shared = std::count_if(votes.begin(), votes.end(), [&](const auto& vote) {
        return std::find(faces.begin(), faces.end(), vote.first) != faces.end();
      });
      if (shared < 2 || !may_meet(n, votes, faces, foot.distance)) continue;
      assign(n, CadDimension::Edge, foot.edge, {foot.t, 0}, foot.distance);
      return true;
    }
    return false;
  }

  const CadModel& model_;
  const SurfaceMesh& surface_;
  double tolerance_;
  FaceSamples faces_;
  KdTree face_tree_;
  std::optional<KdTree> edge_tree_;
  std::vector<std::pair<int, double>> edge_seeds_;
  double edge_spacing_ = 0;
  std::vector<NodeFeet> feet_;
  Association result_;
};

void count(Association& a) {
  Index matched = 0;
  double sum = 0;
  for (std::size_t n = 0; n < a.dimension.size(); ++n) {
    switch (a.dimension[n]) {
      case CadDimension::Vertex:
        ++a.vertex_nodes;
        break;
      case CadDimension::Edge:
        ++a.edge_nodes;
        break;
      case CadDimension::Face:
        ++a.face_nodes;
        break;
      case CadDimension::None:
        a.unmatched_nodes += !a.is_free[n];
        continue;
    }
    ++matched;
    const double d = a.distance[static_cast<Index>(n)];
    sum += d;
    a.max_distance = std::max(a.max_distance, d);
  }
  a.mean_distance = matched > 0 ? sum / static_cast<double>(matched) : 0;
}

}  // namespace

Association associate(const CadModel& base, const Mesh& mesh, const Boundary& boundary,
                      const AssociationOptions& options) {
  const double unit =
      options.mesh_unit_mm > 0 ? options.mesh_unit_mm : detect_mesh_unit(base, mesh, boundary);
  const SurfaceMesh surface = make_surface_mesh(mesh, boundary, unit);
  if (options.progress) options.progress("associating", 0);
  Association result = Associator(base, surface, options).run();
  result.mesh_unit_mm = unit;
  check_unmatched(base, boundary, surface, result);
  count(result);
  if (options.progress) options.progress("associating", 1);
  return result;
}

}  // namespace cadmorph
