#include "surface/joint_motion.h"

#include <algorithm>
#include <map>
#include <optional>
#include <set>
#include <sstream>

#include "cad/projector.h"
#include "core/parallel.h"
#include "surface/curve_maps.h"
#include "surface/face_map.h"

namespace cadmorph {
namespace {

using Eigen::Vector3d;

constexpr int kMostProjections = 300;
constexpr double kStill = 1e-12, kMeet = 1e-7;  // of the diagonal
constexpr double kParted = 1e-2;                // of the shortest mesh edge

// The point near `guess` where the variants of all entities of a crossing meet. Projects on one
// after the other (von Neumann 1950), which converges by the squared cosine of the angle between
// them.
std::optional<Vector3d> meet(const ModelPair& pair, const std::vector<CurveMap>& curve_maps,
                             const Joints::Crossing& crossing, const Vector3d& guess) {
  const double diagonal = pair.variant.diagonal();
  std::vector<FaceFoot> feet;
  for (const int face : crossing.faces)
    feet.push_back(project_globally(pair.variant, pair.match.faces[face], guess));
  Vector3d x = guess;
  for (int i = 0; i < kMostProjections; ++i) {
    const Vector3d before = x;
    double off = 0;
    const auto move_to = [&](const Vector3d& point) {
      off = std::max(off, (point - x).norm());
      x = point;
    };
    for (std::size_t f = 0; f < feet.size(); ++f) {
      feet[f] = project_on_face(pair.variant, pair.match.faces[crossing.faces[f]], x, feet[f].uv);
      move_to(feet[f].point);
    }
    for (const int edge : crossing.edges)
      move_to(curve_maps[pair.base.skeleton().curve_of_edge[edge]].nearest(x).point);
    if ((x - before).norm() > kStill * diagonal) continue;
    if (off > kMeet * diagonal) break;
    return x;
  }
  return std::nullopt;
}

// Where the warp of each face alone puts the nodes at which it crosses others, by row.
std::map<int, std::vector<Vector3d>> crossings_by_warp(const ModelPair& pair,
                                                       const std::vector<CurveMap>& curve_maps,
                                                       const std::vector<FaceNodes>& faces,
                                                       const Points& feet, const Points& placed) {
  std::map<int, std::vector<Vector3d>> places;
  for (const FaceNodes& nodes : faces) {
    const auto firm = nodes.joints.begin() + nodes.placed_joints;
    const std::vector<int> before(nodes.joints.begin(), firm), crossings(firm, nodes.joints.end());
    if (crossings.empty() || !nodes.domain) continue;
    const FaceDomain domain(pair.base, nodes.face, nodes.samples_per_curve,
                            nodes.joint_uv.topRows(nodes.placed_joints));
    const FaceMotion motion{curve_maps, feet(before, Eigen::all), placed(before, Eigen::all)};
    const Parameters uv = nodes.joint_uv.bottomRows(std::ssize(crossings));
    const FaceMapResult mapped = map_face(domain, pair, motion, uv, feet(crossings, Eigen::all));
    for (std::size_t i = 0; i < crossings.size(); ++i)
      places[crossings[i]].push_back(
          pair.variant.evaluate(pair.match.faces[nodes.face], mapped.uv.row(static_cast<Index>(i)))
              .point);
  }
  return places;
}

// The mean of the warps' places where they agree; the predicted one the more, the less they do.
Vector3d blend(const std::vector<Vector3d>& places, const Vector3d& predicted, double length) {
  if (places.size() < 2) return predicted;
  Vector3d mean = Vector3d::Zero();
  double spread = 0;
  for (const Vector3d& x : places) {
    mean += x / static_cast<double>(places.size());
    spread = std::max(spread, (x - places.front()).norm());
  }
  return predicted + std::max(0.0, 1 - spread / length) * (mean - predicted);
}

}  // namespace

void join_curves(const ModelPair& pair, const Joints& joints, const Association& association,
                 std::vector<CurveMap>& curve_maps) {
  const auto curve_of = [&](int edge) { return pair.base.skeleton().curve_of_edge[edge]; };
  std::vector<Vector3d> met(joints.crossings.size());
  parallel_for(std::ssize(met), 16, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) {
      const Joints::Crossing& crossing = joints.crossings[i];
      if (crossing.edges.empty()) continue;
      const int n = crossing.node, edge = association.entity[n];
      const CurveLocation to = curve_maps[curve_of(edge)]({edge, association.uv(n, 0)});
      const Vector3d near = pair.variant.evaluate_edge(to.edge, to.t).point;
      met[i] = meet(pair, curve_maps, crossing, near).value_or(near);
    }
  });
  std::map<int, Vector3d> crossings;  // by row
  for (std::size_t i = 0; i < met.size(); ++i) crossings.emplace(joints.crossings[i].node, met[i]);

  std::map<int, std::vector<CurveJoint>> through;  // by curve
  for (const Joints::OnEdge& joint : joints.on_edges) {
    const auto crossing = crossings.find(joint.node);
    const Vector3d to = crossing != crossings.end()
                            ? crossing->second
                            : map_vertex(pair, curve_maps, association.entity[joint.node]);
    through[curve_of(joint.edge)].push_back({{joint.edge, joint.t}, to});
  }
  for (const auto& [curve, of_curve] : through) curve_maps[curve].lead_through(of_curve);
}

void cross_faces(const ModelPair& pair, const std::vector<CurveMap>& curve_maps,
                 const Joints& joints, const std::vector<FaceNodes>& faces,
                 const SurfaceMesh& surface, const Points& feet, Points& placed) {
  const auto by_warp = crossings_by_warp(pair, curve_maps, faces, feet, placed);
  parallel_for(std::ssize(joints.crossings), 16, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) {
      const Joints::Crossing& crossing = joints.crossings[i];
      const int n = crossing.node;
      if (!crossing.edges.empty()) continue;
      const Vector3d predicted = pair.prediction(Vector3d(feet.row(n)));
      const auto places = by_warp.find(n);
      const Vector3d near = places == by_warp.end()
                                ? predicted
                                : blend(places->second, predicted, surface.local_length[n]);
      placed.row(n) = meet(pair, curve_maps, crossing, near).value_or(near);
    }
  });
}

std::string parted_joints(const ModelPair& pair, const std::vector<CurveMap>& curve_maps,
                          const Joints& joints, const SurfaceMesh& surface, const Points& placed) {
  std::set<int> parted;
  double most = 0;
  const auto judge = [&](int row, double distance) {
    if (distance < kParted * surface.local_length[row]) return;
    parted.insert(row);
    most = std::max(most, distance);
  };
  for (std::size_t f = 0; f < joints.of_face.size(); ++f)
    for (const Joints::OnFace& joint : joints.of_face[f])
      judge(joint.node,
            project_globally(pair.variant, pair.match.faces[f], placed.row(joint.node)).distance);
  for (const Joints::OnEdge& joint : joints.on_edges) {
    const int curve = pair.base.skeleton().curve_of_edge[joint.edge];
    judge(joint.node, curve_maps[curve].nearest(placed.row(joint.node)).distance);
  }
  if (parted.empty()) return "";
  std::ostringstream text;
  text << parted.size()
       << " nodes where parts meet without an edge lie on one of them only, by up to " << most
       << " mm off the other: do the parts still meet in the variant?";
  return text.str();
}

}  // namespace cadmorph
