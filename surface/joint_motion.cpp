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

// In turn, between sheets that meet at a small angle: at 17 degrees so many come to kStill.
constexpr int kMostProjections = 300;
// Of the diagonal: a hundred times the rounding of a projection, and what exchanged B-Reps keep.
constexpr double kStill = 1e-12, kMeet = 1e-7;
// Of the shortest mesh edge: warps whose places are nearer to the faces count alike. At twice this,
// parts that stand on each other no longer move alike with their contacts imprinted or not.
constexpr double kNear = 1e-2;
constexpr double kParted = 1e-2;  // of the shortest mesh edge: less hardly changes an element

// The point near `guess` where the variants of all entities of a crossing meet. Projects on one
// after the other (von Neumann 1950), which converges by the squared cosine of the angle between
// them.
std::optional<Vector3d> meet(const ModelPair& pair, const CurveMaps& curve_maps,
                             const Joints::Crossing& crossing, const Vector3d& guess) {
  const double diagonal = pair.variant.diagonal();
  std::vector<FaceFoot> feet;
  for (const FaceId face : crossing.faces)
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
    for (const EdgeId edge : crossing.edges)
      move_to(curve_maps[pair.base.skeleton().curve_of_edge[edge]].nearest(x).point);
    if ((x - before).norm() > kStill * diagonal) continue;
    if (off > kMeet * diagonal) break;
    return x;
  }
  return std::nullopt;
}

// Crossings of the same faces, numbered.
std::map<RowId, int> sets_of_faces(const Joints& joints) {
  std::map<std::vector<FaceId>, int> number;
  std::map<RowId, int> sets;
  for (const Joints::Crossing& crossing : joints.crossings) {
    if (!crossing.edges.empty()) continue;
    std::vector<FaceId> faces = crossing.faces;
    std::ranges::sort(faces);
    const int next = static_cast<int>(number.size());
    sets.emplace(crossing.node, number.emplace(std::move(faces), next).first->second);
  }
  return sets;
}

// Where the warps of the faces put the nodes at which they cross others, by row.
class CrossingWarps {
 public:
  CrossingWarps(const ModelPair& pair, const CurveMaps& curve_maps,
                const IdVector<FaceId, FaceNodes>& faces, const Points& feet)
      : pair_(pair), maps_(curve_maps), faces_(faces), feet_(feet) {}

  using Places = std::map<RowId, std::vector<Vector3d>>;

  // By what the curves and corners say.
  Places by_curves(const Points& placed) const {
    Places places;
    for (const FaceNodes& nodes : faces_) {
      std::vector<char> is_sought(nodes.joints.size(), 1);
      std::fill_n(is_sought.begin(), nodes.placed_joints, 0);
      add(nodes, is_sought, placed, places);
    }
    return places;
  }

  // By the crossings with other faces, too.
  Places by_crossings(const std::map<RowId, int>& sets, const Points& placed) const {
    Places places;
    for (const FaceNodes& nodes : faces_) {
      std::set<int> here;
      for (std::size_t i = nodes.placed_joints; i < nodes.joints.size(); ++i)
        here.insert(sets.at(nodes.joints[i]));
      for (const int set : here) {
        std::vector<char> is_sought(nodes.joints.size(), 0);
        for (std::size_t i = nodes.placed_joints; i < nodes.joints.size(); ++i)
          is_sought[i] = sets.at(nodes.joints[i]) == set;
        add(nodes, is_sought, placed, places);
      }
    }
    return places;
  }

 private:
  // Moves the joints sought by a warp that follows the others.
  void add(const FaceNodes& nodes, const std::vector<char>& is_sought, const Points& placed,
           Places& places) const {
    std::vector<int> sought, known;
    std::vector<RowId> sought_rows, known_rows;
    for (int i = 0; i < static_cast<int>(nodes.joints.size()); ++i) {
      (is_sought[i] ? sought : known).push_back(i);
      (is_sought[i] ? sought_rows : known_rows).push_back(nodes.joints[i]);
    }
    if (sought.empty() || !nodes.domain) return;
    const FaceDomain domain(pair_.base, nodes.face, nodes.samples_per_curve,
                            nodes.joint_uv(known, Eigen::all));
    const FaceMotion motion{maps_, feet_(known_rows, Eigen::all), placed(known_rows, Eigen::all),
                            nodes.border};
    const FaceMapResult mapped = map_face(domain, pair_, motion, nodes.joint_uv(sought, Eigen::all),
                                          feet_(sought_rows, Eigen::all));
    for (std::size_t i = 0; i < sought.size(); ++i)
      places[sought_rows[i]].push_back(
          pair_.variant
              .evaluate(pair_.match.faces[nodes.face], mapped.uv.row(static_cast<Index>(i)))
              .point);
  }

  const ModelPair& pair_;
  const CurveMaps& maps_;
  const IdVector<FaceId, FaceNodes>& faces_;
  const Points& feet_;
};

// The mean of the points where the faces meet near the places that their warps give. A place counts
// more if it lies nearer to all the faces; the less the places agree, the more the predicted one
// counts.
Vector3d blend(const ModelPair& pair, const CurveMaps& curve_maps, const Joints::Crossing& crossing,
               const std::vector<Vector3d>& places, const Vector3d& predicted, double length) {
  std::vector<std::pair<double, Vector3d>> met;  // with weights
  double sum = 0;
  for (const Vector3d& x : places) {
    double off = kNear * length;
    for (const FaceId face : crossing.faces)
      off += project_globally(pair.variant, pair.match.faces[face], x).distance;
    if (const auto there = meet(pair, curve_maps, crossing, x)) {
      met.emplace_back(1 / (off * off), *there);
      sum += met.back().first;
    }
  }
  Vector3d mean = Vector3d::Zero();
  for (const auto& [weight, x] : met) mean += weight / sum * x;
  double spread = met.empty() ? length : 0;
  for (const auto& [weight, x] : met) spread += 2 * weight / sum * (x - mean).norm();
  return predicted + std::max(0.0, 1 - spread / length) * (mean - predicted);
}

}  // namespace

void join_curves(const ModelPair& pair, const Joints& joints, const Association& association,
                 CurveMaps& curve_maps) {
  const auto curve_of = [&](EdgeId edge) { return pair.base.skeleton().curve_of_edge[edge]; };
  std::vector<Vector3d> met(joints.crossings.size());
  parallel_for(std::ssize(met), 16, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) {
      const Joints::Crossing& crossing = joints.crossings[i];
      if (crossing.edges.empty()) continue;
      const RowId n = crossing.node;
      const EdgeId edge = association.edge(n);
      const CurveLocation to = curve_maps[curve_of(edge)]({edge, association.t(n)});
      const Vector3d near = pair.variant.evaluate_edge(to.edge, to.t).point;
      met[i] = meet(pair, curve_maps, crossing, near).value_or(near);
    }
  });
  std::map<RowId, Vector3d> crossings;
  for (std::size_t i = 0; i < met.size(); ++i)
    if (!joints.crossings[i].edges.empty()) crossings.emplace(joints.crossings[i].node, met[i]);

  std::map<CurveId, std::vector<CurveJoint>> through;
  for (const Joints::OnEdge& joint : joints.on_edges) {
    const auto crossing = crossings.find(joint.node);
    const Vector3d to = crossing != crossings.end()
                            ? crossing->second
                            : map_vertex(pair, curve_maps, association.vertex(joint.node));
    through[curve_of(joint.edge)].push_back({{joint.edge, joint.t}, to});
  }
  for (const auto& [curve, of_curve] : through) curve_maps[curve].lead_through(of_curve);
}

Crossings cross_faces(const ModelPair& pair, const CurveMaps& curve_maps, const Joints& joints,
                      const IdVector<FaceId, FaceNodes>& faces, const SurfaceFeet& nodes) {
  const std::map<RowId, int> sets = sets_of_faces(joints);
  if (sets.empty()) return {};
  const CrossingWarps warps(pair, curve_maps, faces, nodes.base);
  Points moved = nodes.variant;
  const auto place = [&](const CrossingWarps::Places& by_warp) {
    parallel_for(std::ssize(joints.crossings), 16, [&](Index begin, Index end) {
      for (Index i = begin; i < end; ++i) {
        const Joints::Crossing& crossing = joints.crossings[i];
        const RowId n = crossing.node;
        if (!crossing.edges.empty()) continue;
        const Vector3d predicted = pair.prediction(Vector3d(nodes.base.row(n)));
        const auto places = by_warp.find(n);
        const Vector3d near = places == by_warp.end()
                                  ? predicted
                                  : blend(pair, curve_maps, crossing, places->second, predicted,
                                          nodes.surface.local_length[n]);
        moved.row(n) = meet(pair, curve_maps, crossing, near).value_or(near);
      }
    });
  };
  place(warps.by_curves(moved));
  // Where several lines of crossings meet, each carries the others along.
  const bool is_one_set =
      std::ranges::all_of(sets, [](const auto& set) { return set.second == 0; });
  if (!is_one_set) place(warps.by_crossings(sets, moved));
  Crossings crossings;
  for (const auto& [row, set] : sets) crossings.emplace(row, moved.row(row));
  return crossings;
}

PartedJoints find_parted_joints(const ModelPair& pair, const CurveMaps& curve_maps,
                                const Joints& joints, const SurfaceMesh& surface,
                                const Points& placed) {
  std::set<RowId> parted;
  PartedJoints result;
  const auto judge = [&](RowId row, double distance) {
    if (distance < kParted * surface.local_length[row]) return;
    parted.insert(row);
    result.distance = std::max(result.distance, distance);
  };
  for (const FaceId f : joints.of_face.ids())
    for (const Joints::OnFace& joint : joints.of_face[f])
      judge(joint.node,
            project_globally(pair.variant, pair.match.faces[f], placed.row(joint.node)).distance);
  for (const Joints::OnEdge& joint : joints.on_edges) {
    const CurveId curve = pair.base.skeleton().curve_of_edge[joint.edge];
    judge(joint.node, curve_maps[curve].nearest(placed.row(joint.node)).distance);
  }
  result.nodes = static_cast<Index>(parted.size());
  return result;
}

}  // namespace cadmorph
