#include "surface/face_nodes.h"

#include <algorithm>
#include <limits>
#include <map>
#include <optional>
#include <utility>

#include "surface/straight_nodes.h"

namespace cadmorph {
namespace {

// Of a curve, as many as its edges have nodes: enough for a circle, and few enough for a dense
// warp. With 32 for 16 the smallest scaled Jacobians of 14 pairs are the same to 3 %, with 8, or
// 100 or 400 for 200, to the last digits.
constexpr int kMinSamples = 16, kMaxSamples = 200;
// Of the distance of samples: cells less high are thin. Between samples a warp misses some
// thousandths of it. With half or twice of it 14 pairs come out the same.
constexpr double kThin = 0.1;

int samples_per_curve(const CadModel& base, FaceId face,
                      const IdVector<EdgeId, int>& nodes_on_edge) {
  int most = 0;
  for (const auto& wire : base.faces()[face].wires)
    for (const CoedgeId c : wire) most = std::max(most, nodes_on_edge[base.coedges()[c].edge]);
  return std::clamp(most, kMinSamples, kMaxSamples);
}

void collect_joints(const Association& association, const std::vector<Joints::OnFace>& of_face,
                    FaceNodes& nodes) {
  nodes.joint_uv.resize(std::ssize(of_face), 2);
  for (const bool is_crossing : {false, true}) {
    for (const Joints::OnFace& joint : of_face) {
      if ((association.dimension[joint.node] == CadDimension::Face) != is_crossing) continue;
      nodes.joint_uv.row(std::ssize(nodes.joints)) = joint.uv;
      nodes.joints.push_back(joint.node);
    }
    if (!is_crossing) nodes.placed_joints = std::ssize(nodes.joints);
  }
}

// The place of a node on the face's wires; none where it lies on a seam, or not on them.
std::optional<FaceDomain::Sample> on_wires(const CadModel& base, FaceId face,
                                           const Association& association, RowId node) {
  for (const auto& wire : base.faces()[face].wires)
    for (const CoedgeId c : wire) {
      const EdgeId id = base.coedges()[c].edge;
      const CadEdge& edge = base.edges()[id];
      if (edge.is_seam || edge.is_degenerate) continue;
      const bool is_vertex = association.dimension[node] == CadDimension::Vertex;
      const VertexId vertex = association.vertex(node);
      if (is_vertex ? edge.start != vertex && edge.end != vertex : id != association.edge(node))
        continue;
      const double t = !is_vertex             ? association.t(node)
                       : edge.start == vertex ? edge.first
                                              : edge.last;
      return FaceDomain::Sample{c, t, wire_parameters(base, c, t, 0), 0};
    }
  return {};
}

// Mean distances between the domain's samples, by edge.
std::map<EdgeId, double> spacings(const CadModel& base, const FaceDomain& domain) {
  std::map<EdgeId, double> result;
  for (const FaceDomain::Sample& sample : domain.samples())
    if (sample.joint < 0) ++result[base.coedges()[sample.coedge].edge];
  for (auto& [edge, value] : result) value = base.edges()[edge].length / value;
  return result;
}

FaceBorder collect_border(const CadModel& base, const SurfaceMesh& surface,
                          const Association& association, const FaceNodes& nodes) {
  const auto is_within = [&](RowId n) { return association.dimension[n] == CadDimension::Face; };
  std::map<RowId, double> heights;  // of border nodes: the nearest node within the face
  for (const FacetId f : nodes.facets)
    for (const RowId n : surface.facets[f]) {
      if (is_within(n) || association.dimension[n] == CadDimension::None) continue;
      double& height =
          heights.try_emplace(n, std::numeric_limits<double>::infinity()).first->second;
      for (const RowId other : surface.facets[f])
        if (is_within(other))
          height = std::min(height, (surface.points.row(other) - surface.points.row(n)).norm());
    }
  const std::map<EdgeId, double> spacing = spacings(base, *nodes.domain);
  double widest = 0;
  for (const auto& [edge, value] : spacing) widest = std::max(widest, value);
  if (std::ranges::none_of(heights, [&](const auto& of_node) {
        const auto [node, height] = of_node;
        const auto of_edge = spacing.find(association.edge(node));
        return association.dimension[node] == CadDimension::Edge && of_edge != spacing.end() &&
               height < kThin * of_edge->second;
      }))
    return {};
  std::vector<FaceDomain::Sample> samples;
  std::vector<RowId> rows;
  for (const auto& [node, height] : heights)
    if (const auto sample = on_wires(base, nodes.face, association, node)) {
      samples.push_back(*sample);
      rows.push_back(node);
    }
  if (rows.empty()) return {};
  return {base, nodes.face, std::move(samples), surface.points(rows, Eigen::all), widest};
}

std::vector<RowId> nodes_around(const SurfaceMesh& surface, const FaceNodes& nodes) {
  std::vector<RowId> result;
  for (const FacetId f : nodes.facets)
    result.insert(result.end(), surface.facets[f].begin(), surface.facets[f].end());
  std::ranges::sort(result);
  result.erase(std::unique(result.begin(), result.end()), result.end());
  std::erase_if(result, [&](RowId n) { return std::ranges::binary_search(nodes.rows, n); });
  return result;
}

}  // namespace

IdVector<FaceId, FaceNodes> collect_face_nodes(const CadModel& base, const SurfaceMesh& surface,
                                               const Association& association, const Joints& joints,
                                               const Points& feet) {
  IdVector<FaceId, FaceNodes> faces(base.faces().size());
  IdVector<EdgeId, int> nodes_on_edge(base.edges().size(), 0);
  for (const RowId n : association.entity.ids()) {
    if (association.dimension[n] == CadDimension::Face)
      faces[association.face(n)].rows.push_back(n);
    if (association.dimension[n] == CadDimension::Edge) ++nodes_on_edge[association.edge(n)];
  }
  for (const FacetId f : association.facet_face.ids())
    if (association.facet_face[f] >= 0) faces[association.facet_face[f]].facets.push_back(f);
  for (const FaceId f : faces.ids()) {
    FaceNodes& nodes = faces[f];
    nodes.face = f;
    collect_joints(association, joints.of_face[f], nodes);
    nodes.uv = association.uv(nodes.rows, Eigen::all);
    nodes.points = feet(nodes.rows, Eigen::all);
    nodes.around = nodes_around(surface, nodes);
    if (nodes.rows.empty()) continue;
    if (base.faces()[f].type == SurfaceType::Plane)
      for (Index i = 0; i < std::ssize(nodes.rows); ++i)
        if (is_amid_straight(surface, nodes.rows[i])) nodes.straight.push_back(i);
    nodes.samples_per_curve = samples_per_curve(base, f, nodes_on_edge);
    nodes.domain =
        std::make_unique<FaceDomain>(base, f, nodes.samples_per_curve, nodes.joint_uv, nodes.uv);
    nodes.border = collect_border(base, surface, association, nodes);
    nodes.folds = FaceFolds(surface, nodes.facets, nodes.rows, {base, f, nodes.uv, feet});
  }
  return faces;
}

}  // namespace cadmorph
