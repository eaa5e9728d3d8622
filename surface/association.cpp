#include "surface/association.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "core/errors.h"
#include "core/parallel.h"
#include "surface/free_patches.h"
#include "surface/mesh_unit.h"
#include "surface/node_feet.h"
#include "surface/straight_nodes.h"
#include "surface/surface_mesh.h"

namespace cadmorph {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

// A node off its faces goes to their curve only within this multiple of its distance from them: the
// curve is as near where they meet at 30 degrees or more. Farther off it lies beside the curve,
// where faces meet smoothly or a touching solid's pass by, and the mesh does not follow the curve.
constexpr double kMeetingFaces = 2;
// Of the gaps between a node off the CAD and its faces: what the digits of a mesh or the chords of
// the triangles that it was snapped to make of one. With half or twice of it 14 pairs come out the
// same, and the tests of associations and strays pass.
constexpr double kAsNear = 2;
// Decides between faces that fit equally, far below what a worse fit costs. With 0, blocks that
// touch take each other's nodes.
constexpr double kOtherSide = 1e-2;
constexpr Index kGrain = 512;  // nodes, some microseconds each
// Strays are off by up to a mesh edge, as the mean of those at the node: what a mesher leaves where
// it did not snap. Their facets look the CAD's way by this cosine, on the mean, which those of an
// inlet across a narrow duct don't. More of them, or most of a face or an edge, tell of another
// part. The tests of strays pass with half and twice of the last two.
constexpr double kStray = 1, kAlike = 0.5, kMostStrays = 0.05, kMostOfEntity = 0.5;

// Nodes of facet edges that no other facet has, ascending.
std::vector<RowId> rim_nodes(const SurfaceMesh& surface) {
  std::vector<std::pair<RowId, RowId>> edges;
  for (const FacetId f : surface.facets.ids())
    for (int i = 0; i < surface.corners[f]; ++i)
      edges.push_back(
          std::minmax({surface.facets[f][i], surface.facets[f][(i + 1) % surface.corners[f]]}));
  std::ranges::sort(edges);
  std::vector<RowId> nodes;
  for (std::size_t i = 0; i < edges.size(); ++i) {
    const bool is_shared =
        (i > 0 && edges[i - 1] == edges[i]) || (i + 1 < edges.size() && edges[i + 1] == edges[i]);
    if (!is_shared) nodes.insert(nodes.end(), {edges[i].first, edges[i].second});
  }
  std::ranges::sort(nodes);
  nodes.erase(std::unique(nodes.begin(), nodes.end()), nodes.end());
  return nodes;
}

class Associator {
 public:
  // `body`: the body of the mesh that each facet bounds.
  Associator(const CadModel& model, const SurfaceMesh& surface, IdVector<FacetId, int> body,
             const AssociationOptions& options)
      : model_(model),
        surface_(surface),
        body_(std::move(body)),
        finder_(model, surface, options.tolerance) {}

  void run() {
    const Index nodes = surface_.points.rows();
    feet_.resize(static_cast<std::size_t>(nodes));
    parallel_for(nodes, kGrain, [&](Index begin, Index end) {
      for (RowId n(begin); n < end; ++n) feet_[n] = finder_.find(n);
    });
    classify();
  }

  /// Nodes on no entity that lie by the CAD, amid others that are on one, are put on one, too,
  /// unless `is_expected`. `outer` marks the facets of the outside.
  void take_strays(const IdVector<FacetId, char>& outer, const IdVector<RowId, char>& is_expected) {
    const std::vector<RowId> strays = find_strays(outer, is_expected);
    if (strays.empty()) return;
    std::map<RowId, NodeFeet> before;
    for (const RowId n : strays) before.emplace(n, std::exchange(feet_[n], wide_feet(n)));
    classify();
    if (are_most_of_an_entity(strays)) {
      for (auto& [n, feet] : before) feet_[n] = std::move(feet);
      return classify();
    }
    for (const RowId n : strays) {
      if (result_.dimension[n] == CadDimension::None) continue;
      ++result_.stray_nodes;
      RowId& farthest = result_.farthest_stray;
      if (farthest < 0 || result_.distance[n] > result_.distance[farthest]) farthest = n;
    }
  }

  const Association& found() const { return result_; }
  Association take() { return std::move(result_); }

 private:
  using Votes = std::map<FaceId, int>;

  void classify() {
    const Index nodes = surface_.points.rows();
    prepare(nodes);
    parallel_for(nodes, kGrain, [&](Index begin, Index end) {
      for (RowId n(begin); n < end; ++n) classify_by_distance(n);
    });
    find_senses();
    const auto facets = static_cast<Index>(surface_.facets.size());
    parallel_for(facets, kGrain, [&](Index begin, Index end) {
      for (FacetId f(begin); f < end; ++f) result_.facet_face[f] = vote(f);
    });
    parallel_for(nodes, kGrain, [&](Index begin, Index end) {
      for (RowId n(begin); n < end; ++n) classify_by_vote(n);
    });
    find_straight_nodes(model_, surface_, is_off_voted_, result_);
  }

  bool is_unmatched(RowId n) const {
    return result_.dimension[n] == CadDimension::None && !result_.is_amid[n];
  }

  NodeFeet wide_feet(RowId n) const {
    double sum = 0;
    int count = 0;
    for (const FacetId f : surface_.facets_at(n)) {
      const int corners = surface_.corners[f];
      const std::vector<RowId>& facet = surface_.facets[f];
      const auto at = std::find(facet.begin(), facet.begin() + corners, n) - facet.begin();
      if (at == corners) continue;
      for (const RowId other : {facet[(at + 1) % corners], facet[(at + corners - 1) % corners]})
        sum += (point(other) - point(n)).norm();
      count += 2;
    }
    return finder_.find(n, kStray * (count > 0 ? sum / count : surface_.own_length[n]));
  }

  // Calls visit(facet) for each facet of the outside at a node.
  template <class Visit>
  void for_each_outer(RowId n, const IdVector<FacetId, char>& outer, Visit&& visit) const {
    for (const FacetId f : surface_.facets_at(n))
      if (outer[f]) visit(f);
  }

  // Whether unmatched nodes that hang together are all by the CAD, amid others that are on it:
  // unlike those of a far field or a symmetry plane, which go somewhere.
  bool are_by_cad(const std::vector<RowId>& nodes, const IdVector<FacetId, char>& outer) const {
    double area = 0, facing = 0;
    bool is_amid_others = false;
    for (const RowId n : nodes) {
      const NodeFeet feet = wide_feet(n);
      if (feet.faces.empty()) return false;
      const Vector3d normal = model_.normal(feet.faces[0].face, feet.faces[0].uv);
      for_each_outer(n, outer, [&](FacetId f) {
        const Vector3d own = area_vector(surface_, surface_.points, f);
        area += own.norm();
        facing += std::abs(own.dot(normal));
        is_amid_others |= !std::ranges::all_of(surface_.facets[f],
                                               [&](RowId other) { return is_unmatched(other); });
      });
    }
    return is_amid_others && facing >= kAlike * area;
  }

  std::vector<RowId> find_strays(const IdVector<FacetId, char>& outer,
                                 const IdVector<RowId, char>& is_expected) const {
    IdVector<RowId, char> is_seen(result_.dimension.size(), 0);
    std::vector<RowId> strays;
    int outside = 0;
    for (const RowId seed : is_seen.ids()) {
      bool is_outside = false;
      for_each_outer(seed, outer, [&](FacetId) { is_outside = true; });
      outside += is_outside;
      if (!is_outside || !is_unmatched(seed) || is_seen[seed]) continue;
      const auto nodes = unmatched_around(surface_, result_, outer, seed, is_seen);
      if (std::ranges::none_of(nodes, [&](RowId n) { return is_expected[n] != 0; }) &&
          are_by_cad(nodes, outer))
        strays.insert(strays.end(), nodes.begin(), nodes.end());
    }
    if (double(strays.size()) > kMostStrays * outside) strays.clear();
    return strays;
  }

  // Of a face's nodes, or of those on the rim of a sheet by an edge.
  bool are_most_of_an_entity(const std::vector<RowId>& strays) const {
    IdVector<FaceId, Index> on_face(model_.faces().size(), 0), strays_on_face = on_face;
    IdVector<EdgeId, Index> on_edge(model_.edges().size(), 0), strays_on_edge = on_edge;
    for (const RowId n : result_.dimension.ids()) {
      if (result_.dimension[n] == CadDimension::Face) ++on_face[result_.face(n)];
      if (result_.dimension[n] == CadDimension::Edge) ++on_edge[result_.edge(n)];
    }
    const std::vector<RowId> rim = rim_nodes(surface_);
    for (const RowId n : strays) {
      if (result_.dimension[n] == CadDimension::Face) ++strays_on_face[result_.face(n)];
      if (!feet_[n].edges.empty() && std::ranges::binary_search(rim, n))
        ++strays_on_edge[feet_[n].edges.front().edge];
    }
    for (const FaceId f : on_face.ids())
      if (double(strays_on_face[f]) > kMostOfEntity * double(on_face[f])) return true;
    for (const EdgeId e : on_edge.ids())
      if (strays_on_edge[e] > on_edge[e]) return true;
    return false;
  }

  void prepare(Index nodes) {
    result_ = {};
    senses_.clear();
    result_.dimension.assign(static_cast<std::size_t>(nodes), CadDimension::None);
    result_.entity.assign(static_cast<std::size_t>(nodes), -1);
    result_.uv.setZero(nodes, 2);
    result_.distance.setZero(nodes);
    result_.is_free.assign(static_cast<std::size_t>(nodes), 0);
    result_.is_amid.assign(static_cast<std::size_t>(nodes), 0);
    is_off_voted_.assign(static_cast<std::size_t>(nodes), 0);
    result_.facet_face.assign(surface_.facets.size(), {});
  }

  Vector3d point(RowId n) const { return surface_.points.row(n); }

  double on_entity(RowId n, double tolerance) const {
    return tolerance + kOnEntity * surface_.local_length[n];
  }

  void assign(RowId n, CadDimension dimension, int entity, const Vector2d& uv, double distance) {
    result_.dimension[n] = dimension;
    result_.entity[n] = entity;
    result_.uv.row(n) = uv;
    result_.distance[n] = distance;
  }

  // Nearest physical vertex among the ends of the near edges.
  std::pair<VertexId, double> nearest_corner(RowId n) const {
    std::pair<VertexId, double> best{{}, 1e300};
    for (const EdgeFoot& foot : feet_[n].edges)
      for (const VertexId v : {model_.edges()[foot.edge].start, model_.edges()[foot.edge].end}) {
        if (v < 0 || model_.skeleton().corner_of_vertex[v] < 0) continue;
        const double d = (model_.vertices()[v].point - point(n)).norm();
        if (d < best.second) best = {v, d};
      }
    return best;
  }

  void classify_by_distance(RowId n) {
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
      const FaceCandidate& c = feet.faces.front();
      assign(n, CadDimension::Face, c.face, c.uv, c.distance);
    }
  }

  std::vector<FaceId> faces_of(EdgeId edge) const {
    std::vector<FaceId> faces;
    for (const CoedgeId c : model_.edges()[edge].coedges) faces.push_back(model_.coedges()[c].face);
    return faces;
  }

  // Faces of the near edges that end at a corner near a node.
  std::vector<FaceId> faces_at(RowId n, VertexId corner) const {
    std::vector<FaceId> faces;
    for (const EdgeFoot& foot : feet_[n].edges) {
      const CadEdge& e = model_.edges()[foot.edge];
      if (e.start != corner && e.end != corner) continue;
      for (const FaceId face : faces_of(foot.edge)) faces.push_back(face);
    }
    return faces;
  }

  // Of the corner or edge that a node lies on.
  std::vector<FaceId> bounded_faces(RowId n) const {
    if (result_.dimension[n] == CadDimension::Edge) return faces_of(result_.edge(n));
    if (result_.dimension[n] == CadDimension::Vertex) return faces_at(n, result_.vertex(n));
    return {};
  }

  // Faces that a node may belong to, by its feet or by the corner or edge it lies on.
  std::vector<FaceId> possible_faces(RowId n) const {
    std::vector<FaceId> faces = bounded_faces(n);
    for (const FaceCandidate& c : feet_[n].faces) faces.push_back(c.face);
    std::sort(faces.begin(), faces.end());
    faces.erase(std::unique(faces.begin(), faces.end()), faces.end());
    return faces;
  }

  std::vector<FaceId> common_faces(FacetId f) const {
    std::vector<FaceId> common;
    for (int i = 0; i < surface_.corners[f]; ++i) {
      const auto faces = possible_faces(surface_.facets[f][i]);
      if (i == 0) {
        common = faces;
        continue;
      }
      std::vector<FaceId> both;
      std::set_intersection(common.begin(), common.end(), faces.begin(), faces.end(),
                            std::back_inserter(both));
      common = std::move(both);
    }
    return common;
  }

  // Largest distance of a facet's corners from a trimmed face. They tell more than its centroid: a
  // chord across a thin wall's inside comes near the other side, or beyond it.
  double corner_gap(FacetId f, FaceId face) const {
    double gap = 0;
    for (int i = 0; i < surface_.corners[f]; ++i)
      for (const FaceCandidate& c : feet_[surface_.facets[f][i]].faces)
        if (c.face == face) gap = std::max(gap, c.gap);
    return gap;
  }

  // Cosine between a facet's normal and the outward one of a solid's face; 0 for other faces.
  double facing(const Vector3d& normal, FaceId face, const Vector2d& uv) const {
    return model_.faces()[face].solid < 0 ? 0 : normal.dot(model_.normal(face, uv));
  }

  // Whether a node lies on the nearest of its faces alone, or no other is near.
  bool is_on_one(RowId n) const {
    const auto& faces = feet_[n].faces;
    return faces.size() == 1 ||
           (faces[0].distance <= on_entity(n, model_.faces()[faces[0].face].tolerance) &&
            faces[1].distance > on_entity(n, model_.faces()[faces[1].face].tolerance));
  }

  // Whether each body's facets look out of the solids, +1, or into them, as those of a fluid do.
  void find_senses() {
    std::vector<double> sums;
    for (const FacetId f : body_.ids()) {
      sums.resize(std::max(sums.size(), static_cast<std::size_t>(body_[f]) + 1), 0.0);
      const RowId n = surface_.facets[f][0];
      const NodeFeet& feet = feet_[n];
      if (result_.dimension[n] != CadDimension::Face || !is_on_one(n)) continue;
      const FaceCandidate& c = feet.faces.front();
      const Vector3d area = area_vector(surface_, surface_.points, f);
      sums[body_[f]] += facing(area, c.face, c.uv);
    }
    for (const double sum : sums) senses_.push_back(sum > 0 ? 1.0 : sum < 0 ? -1.0 : 0.0);
  }

  // CAD face of a facet: common to its corners; of several, the one that its corners, centroid and
  // normal fit; of coincident faces the one of a solid on the facet's own side, not that of one
  // that touches it, nor a sketch's.
  FaceId vote(FacetId f) const {
    const auto common = common_faces(f);
    if (common.empty()) return {};
    if (common.size() == 1) return common.front();
    const Vector3d x = centroid(surface_, surface_.points, f);
    const Vector3d area = area_vector(surface_, surface_.points, f);
    const Vector3d normal = area.normalized();
    const double size = std::sqrt(area.norm()) + 1e-300;
    FaceId best;
    double least = 1e300;
    for (const FaceId face : common) {
      const FaceFoot foot = project_on_face(model_, face, x, seed(f, face, x));
      const double tilt = 1 - std::abs(normal.dot(model_.normal(face, foot.uv)));
      const double outside = model_.is_inside(face, foot.uv) ? 0 : 1;
      const double sense = senses_[body_[f]];
      const bool is_other_side = sense != 0 && sense * facing(normal, face, foot.uv) < 0.5;
      const double gap = std::max(foot.distance, corner_gap(f, face));
      const double cost = gap / size + tilt + outside + (is_other_side ? kOtherSide : 0);
      if (cost < least) {
        least = cost;
        best = face;
      }
    }
    return best;
  }

  Vector2d seed(FacetId f, FaceId face, const Vector3d& x) const {
    for (const RowId n : surface_.facets[f])
      for (const FaceCandidate& c : feet_[n].faces)
        if (c.face == face && result_.dimension[n] == CadDimension::Face) return c.uv;
    return finder_.seed(face, x, surface_.local_length[surface_.facets[f][0]]);
  }

  void classify_by_vote(RowId n) {
    Votes votes;
    for (const FacetId f : surface_.facets_at(n)) ++votes[result_.facet_face[f]];
    votes.erase(FaceId());
    if (votes.empty() || result_.dimension[n] == CadDimension::None) return;
    if (result_.dimension[n] == CadDimension::Vertex) take_voted_corner(n, votes);
    if (result_.dimension[n] == CadDimension::Edge || is_of_sketch(n, votes))
      take_voted_edge(n, votes);
    if (result_.dimension[n] != CadDimension::Face && !is_of_sketch(n, votes)) return;
    is_off_voted_[n] = votes.size() > 1 && is_off_any(n, votes);
    if (is_off_voted_[n] && take_voted_entity(n, votes)) return;
    take_voted_face(n, votes);
  }

  // The face with the most votes of those that the node lies on, or as good as: facets that cut an
  // edge off vote for either side of it.
  void take_voted_face(RowId n, const Votes& votes) {
    const auto& faces = feet_[n].faces;
    if (faces.empty()) return;
    const double least = std::ranges::min_element(faces, {}, &FaceCandidate::gap)->gap;
    const FaceCandidate* best = nullptr;
    int most = 0;
    for (const FaceCandidate& c : faces) {
      const double reach = on_entity(n, model_.faces()[c.face].tolerance);
      if (c.gap > std::max(reach, kAsNear * least)) continue;
      const auto vote = votes.find(c.face);
      const int count = vote != votes.end() ? vote->second : 0;
      if (best && (count < most || (count == most && best->face < c.face))) continue;
      best = &c;
      most = count;
    }
    assign(n, CadDimension::Face, best->face, best->uv, best->gap);
  }

  static int count_voted(const std::vector<FaceId>& faces, const Votes& votes) {
    return static_cast<int>(std::count_if(votes.begin(), votes.end(), [&](const auto& vote) {
      return std::find(faces.begin(), faces.end(), vote.first) != faces.end();
    }));
  }

  // Of the coincident corners of touching solids, the one between the voted faces.
  void take_voted_corner(RowId n, const Votes& votes) {
    int most = count_voted(faces_at(n, result_.vertex(n)), votes);
    for (const EdgeFoot& foot : feet_[n].edges)
      for (const VertexId v : {model_.edges()[foot.edge].start, model_.edges()[foot.edge].end}) {
        if (v < 0 || model_.skeleton().corner_of_vertex[v] < 0) continue;
        const double distance = (model_.vertices()[v].point - point(n)).norm();
        if (distance > on_entity(n, model_.vertices()[v].tolerance)) continue;
        const int voted = count_voted(faces_at(n, v), votes);
        if (voted <= most) continue;
        most = voted;
        assign(n, CadDimension::Vertex, v, Vector2d::Zero(), distance);
      }
  }

  // Whether a node is on a corner or an edge between faces of no solid, and no facet lies on them.
  bool is_of_sketch(RowId n, const Votes& votes) const {
    const std::vector<FaceId> faces = bounded_faces(n);
    return !faces.empty() && count_voted(faces, votes) == 0 &&
           std::ranges::none_of(faces,
                                [&](FaceId face) { return model_.faces()[face].solid >= 0; });
  }

  // The same for edges.
  void take_voted_edge(RowId n, const Votes& votes) {
    int most = count_voted(bounded_faces(n), votes);
    for (const EdgeFoot& foot : feet_[n].edges) {
      if (foot.distance > on_entity(n, model_.edges()[foot.edge].tolerance)) continue;
      const int voted = count_voted(faces_of(foot.edge), votes);
      if (voted <= most) continue;
      most = voted;
      assign(n, CadDimension::Edge, foot.edge, {foot.t, 0}, foot.distance);
    }
  }

  // Whether the node lies off one of the faces that its facets voted for.
  bool is_off_any(RowId n, const Votes& votes) const {
    return std::any_of(votes.begin(), votes.end(), [&](const auto& vote) {
      return std::none_of(feet_[n].faces.begin(), feet_[n].faces.end(),
                          [&](const FaceCandidate& c) {
                            return c.face == vote.first &&
                                   c.distance <= on_entity(n, model_.faces()[c.face].tolerance);
                          });
    });
  }

  // Whether a node may belong where the voted faces meet, `distance` from it.
  bool may_meet(RowId n, const Votes& votes, double distance) const {
    double off = 0;
    for (const FaceCandidate& c : feet_[n].faces)
      if (votes.contains(c.face)) off = std::max(off, c.distance);
    return distance <= kMeetingFaces * off;
  }

  // A node off the CAD between facets of several faces: their common corner or curve.
  bool take_voted_entity(RowId n, const Votes& votes) {
    const double limit = finder_.edge_reach(n);
    if (votes.size() > 2) {
      const auto [corner, distance] = nearest_corner(n);
      if (corner >= 0 && distance <= limit && may_meet(n, votes, distance)) {
        assign(n, CadDimension::Vertex, corner, Vector2d::Zero(), distance);
        return true;
      }
    }
    for (const EdgeFoot& foot : feet_[n].edges) {
      if (foot.distance > limit) break;
      if (count_voted(faces_of(foot.edge), votes) < 2 || !may_meet(n, votes, foot.distance))
        continue;
      assign(n, CadDimension::Edge, foot.edge, {foot.t, 0}, foot.distance);
      return true;
    }
    return false;
  }

  const CadModel& model_;
  const SurfaceMesh& surface_;
  IdVector<FacetId, int> body_;
  std::vector<double> senses_;
  IdVector<RowId, char> is_off_voted_;  // off one of the faces that the node's facets voted for
  FootFinder finder_;
  IdVector<RowId, NodeFeet> feet_;
  Association result_;
};

void count(Association& a) {
  Index matched = 0;
  double sum = 0;
  for (const RowId n : a.dimension.ids()) {
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
        (a.is_amid[n] ? a.amid_nodes : a.unmatched_nodes) += !a.is_free[n];
        continue;
    }
    ++matched;
    const double d = a.distance[n];
    sum += d;
    a.max_distance = std::max(a.max_distance, d);
  }
  a.mean_distance = matched > 0 ? sum / static_cast<double>(matched) : 0;
}

// Bodies, numbered from 0: the regions of the mesh.
IdVector<FacetId, int> bodies_of(const Mesh& mesh, const Boundary& boundary) {
  std::map<int, int> number;
  IdVector<FacetId, int> bodies;
  for (const Index cell : boundary.cell)
    bodies.push_back(
        number.emplace(mesh.region(cell), static_cast<int>(number.size())).first->second);
  return bodies;
}

}  // namespace

Association associate(const CadModel& base, const Mesh& mesh, const Boundary& boundary,
                      const AssociationOptions& options) {
  const double unit =
      options.mesh_unit_mm > 0 ? options.mesh_unit_mm : detect_mesh_unit(base, mesh, boundary);
  const SurfaceMesh surface = make_surface_mesh(mesh, boundary, unit);
  if (options.progress) options.progress("associating", 0);
  Associator associator(base, surface, bodies_of(mesh, boundary), options);
  associator.run();
  if (options.takes_strays) {
    IdVector<FacetId, char> outer;
    IdVector<RowId, char> is_expected;
    const IdVector<FacetId, char> is_crack = find_cracks(surface, boundary, associator.found());
    for (const FacetId f : is_crack.ids())
      outer.push_back(boundary.neighbour[f] < 0 && !is_crack[f]);
    for (const Index node : boundary.nodes)
      is_expected.push_back(std::ranges::binary_search(options.expected_off, node));
    associator.take_strays(outer, is_expected);
  }
  Association result = associator.take();
  result.mesh_unit_mm = unit;
  check_unmatched(base, mesh, boundary, surface, options, result);
  count(result);
  if (options.progress) options.progress("associating", 1);
  return result;
}

std::vector<RowId> Association::prescribed_rows() const {
  std::vector<RowId> rows;
  for (const RowId row : is_free.ids())
    if (!is_free[row]) rows.push_back(row);
  return rows;
}

}  // namespace cadmorph
