#include "surface/joint_motion.h"

#include <algorithm>
#include <optional>
#include <set>
#include <sstream>

#include "cad/projector.h"
#include "core/parallel.h"
#include "surface/curve_maps.h"

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

// Along its own curve, or as predicted.
Vector3d guess(const ModelPair& pair, const Association& association, const Points& feet,
               const std::vector<CurveMap>& curve_maps, int row) {
  if (association.dimension[row] != CadDimension::Edge)
    return pair.prediction(Vector3d(feet.row(row)));
  const int edge = association.entity[row];
  const CurveMap& map = curve_maps[pair.base.skeleton().curve_of_edge[edge]];
  const CurveLocation to = map({edge, association.uv(row, 0)});
  return pair.variant.evaluate_edge(to.edge, to.t).point;
}

}  // namespace

Crossings join_curves(const ModelPair& pair, const Joints& joints, const Association& association,
                      const Points& feet, std::vector<CurveMap>& curve_maps) {
  std::vector<Vector3d> moved(joints.crossings.size());
  parallel_for(std::ssize(moved), 16, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) {
      const Joints::Crossing& crossing = joints.crossings[i];
      const Vector3d near = guess(pair, association, feet, curve_maps, crossing.node);
      moved[i] = meet(pair, curve_maps, crossing, near).value_or(near);
    }
  });
  Crossings crossings;
  for (std::size_t i = 0; i < moved.size(); ++i)
    crossings.emplace(joints.crossings[i].node, moved[i]);

  std::map<int, std::vector<CurveJoint>> through;  // a curve
  for (const Joints::OnEdge& joint : joints.on_edges) {
    const auto crossing = crossings.find(joint.node);
    const Vector3d to = crossing != crossings.end()
                            ? crossing->second
                            : map_vertex(pair, curve_maps, association.entity[joint.node]);
    through[pair.base.skeleton().curve_of_edge[joint.edge]].push_back({{joint.edge, joint.t}, to});
  }
  for (const auto& [curve, of_curve] : through) curve_maps[curve].lead_through(of_curve);
  return crossings;
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
