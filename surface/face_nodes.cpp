#include "surface/face_nodes.h"

#include <algorithm>

namespace cadmorph {
namespace {

constexpr int kMinSamples = 16, kMaxSamples = 200;

int samples_per_curve(const CadModel& base, int face, const std::vector<int>& nodes_on_edge) {
  int most = 0;
  for (const auto& wire : base.faces()[face].wires)
    for (const int c : wire) most = std::max(most, nodes_on_edge[base.coedges()[c].edge]);
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

}  // namespace

std::vector<FaceNodes> collect_face_nodes(const CadModel& base, const Association& association,
                                          const Joints& joints, const Points& feet) {
  std::vector<FaceNodes> faces(base.faces().size());
  std::vector<int> nodes_on_edge(base.edges().size(), 0);
  for (int n = 0; n < static_cast<int>(association.entity.size()); ++n) {
    if (association.dimension[n] == CadDimension::Face)
      faces[association.entity[n]].rows.push_back(n);
    if (association.dimension[n] == CadDimension::Edge) ++nodes_on_edge[association.entity[n]];
  }
  for (int f = 0; f < static_cast<int>(association.facet_face.size()); ++f)
    if (association.facet_face[f] >= 0) faces[association.facet_face[f]].facets.push_back(f);
  for (int f = 0; f < static_cast<int>(faces.size()); ++f) {
    FaceNodes& nodes = faces[f];
    nodes.face = f;
    collect_joints(association, joints.of_face[f], nodes);
    nodes.uv = association.uv(nodes.rows, Eigen::all);
    nodes.points = feet(nodes.rows, Eigen::all);
    if (nodes.rows.empty()) continue;
    nodes.samples_per_curve = samples_per_curve(base, f, nodes_on_edge);
    nodes.domain = std::make_unique<FaceDomain>(base, f, nodes.samples_per_curve, nodes.joint_uv);
  }
  return faces;
}

}  // namespace cadmorph
