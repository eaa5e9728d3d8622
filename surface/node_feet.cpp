#include "surface/node_feet.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace cadmorph {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

// Samples of the CAD that the search for feet starts from: four a node are half a mesh edge apart,
// so that Newton's method starts near the foot. Coarse meshes get more, for the CAD's own shape;
// memory bounds them (44 MB).
constexpr Index kMinSamples = 20'000, kMaxSamples = 1'000'000, kSamplesPerNode = 4;

// A step in the parameters that leads this many times as far as the points lie apart, by the
// derivatives at one of them, leads to another part of a face or edge that returns to where it was.
// Half a circle is 1.6 times as long as its chord.
constexpr double kReturns = 2;
// A foot this near, of the model's diagonal, needs no other part to compare with: above the
// rounding of a projection (1e-14).
constexpr double kExact = 1e-12;
// Part of another foot's distance that a foot's must be less than to count as nearer: equal ones
// differ by rounding.
constexpr double kNearer = 1 - 1e-6;

/// The feet found on a face or edge, one on each part of it that passes the node.
template <class Key, class Foot, class Tangents>
struct FeetOn {
  Key id;
  std::vector<std::pair<Foot, Tangents>> parts;

  bool is_exact(double tolerance) const {
    return std::ranges::any_of(parts, [&](const auto& p) { return p.first.distance <= tolerance; });
  }
  // The first found of those that are equally near.
  const Foot& nearest() const {
    const Foot* best = &parts.front().first;
    for (const auto& [foot, at] : parts)
      if (foot.distance < kNearer * best->distance) best = &foot;
    return *best;
  }
};

struct FaceSheets : FeetOn<FaceId, FaceFoot, SurfacePoint> {
  void add(const CadModel& model, const FaceFoot& foot) {
    parts.emplace_back(foot, model.evaluate(id, foot.uv));
  }
  bool has(const CadFace& face, const Vector2d& uv, const Vector3d& point) const {
    return std::ranges::any_of(parts, [&](const auto& part) {
      const auto& [foot, at] = part;
      Vector2d step = uv - foot.uv;
      for (int a = 0; a < 2; ++a)
        if (face.period[a] > 0) step[a] = std::remainder(step[a], face.period[a]);
      const Vector3d predicted = step[0] * at.du + step[1] * at.dv;
      return predicted.norm() <= kReturns * (point - at.point).norm();
    });
  }
};

struct EdgeStrands : FeetOn<EdgeId, EdgeFoot, CurvePoint> {
  void add(const CadModel& model, const EdgeFoot& foot) {
    parts.emplace_back(foot, model.evaluate_edge(id, foot.t));
  }
  bool has(double t, const Vector3d& point) const {
    return std::ranges::any_of(parts, [&](const auto& part) {
      const auto& [foot, at] = part;
      return std::abs(t - foot.t) * at.dt.norm() <= kReturns * (point - at.point).norm();
    });
  }
};

// The feet on face or edge `id`, empty when it is new.
template <class Feet>
Feet& entry_of(std::vector<Feet>& found, decltype(Feet::id) id) {
  const auto known = std::ranges::find(found, id, &Feet::id);
  if (known != found.end()) return *known;
  Feet& feet = found.emplace_back();
  feet.id = id;
  return feet;
}

Index sample_count(const SurfaceMesh& surface) {
  return std::clamp(kSamplesPerNode * surface.points.rows(), kMinSamples, kMaxSamples);
}

}  // namespace

FootFinder::FootFinder(const CadModel& model, const SurfaceMesh& surface, double tolerance)
    : model_(model),
      surface_(surface),
      tolerance_(tolerance),
      faces_(sample_faces(model, sample_count(surface))) {
  spread_faces();
  sample_edges();
}

void FootFinder::spread_faces() {
  std::vector<double> spacing;
  for (const FaceId face : faces_.face) spacing.push_back(faces_.face_spacing[face]);
  near_faces_ = SpacedSamples(faces_.points, spacing);
}

void FootFinder::sample_edges() {
  std::vector<Vector3d> points;
  std::vector<double> spacing;
  for (const EdgeId e : model_.edges().ids()) {
    const CadEdge& edge = model_.edges()[e];
    if (!edge.is_physical()) continue;
    const int n = std::clamp(static_cast<int>(edge.length / faces_.spacing), 8, 20'000);
    double widest = std::numeric_limits<double>::min();
    for (int i = 0; i <= n; ++i) {
      const double t = edge.first + (edge.last - edge.first) * i / n;
      points.push_back(model_.evaluate_edge(e, t).point);
      edge_seeds_.push_back({e, t});
      if (i > 0) widest = std::max(widest, (points.back() - points.rbegin()[1]).norm());
    }
    spacing.insert(spacing.end(), static_cast<std::size_t>(n) + 1, widest);
  }
  edge_points_.resize(static_cast<Index>(points.size()), 3);
  for (std::size_t i = 0; i < points.size(); ++i)
    edge_points_.row(static_cast<Index>(i)) = points[i];
  near_edges_ = SpacedSamples(edge_points_, spacing);
}

NodeFeet FootFinder::find(RowId n, double reach) const {
  const Vector3d x = surface_.points.row(n);
  NodeFeet feet;
  find_edge_feet(x, edge_reach(n, reach), feet);
  std::vector<FaceSheets> found;
  const std::vector<Neighbour> samples = near_faces_.near(x, reach);
  for (const Neighbour& near : samples) {
    const FaceId face = faces_.face[near.index];
    FaceSheets& sheets = entry_of(found, face);
    const Vector3d sample = faces_.points.row(near.index);
    if (sheets.is_exact(kExact * model_.diagonal()) ||
        sheets.has(model_.faces()[face], faces_.uv[near.index], sample))
      continue;
    sheets.add(model_, project_on_face(model_, face, x, faces_.uv[near.index]));
  }
  for (const FaceSheets& sheets : found) {
    const FaceFoot& foot = sheets.nearest();
    if (foot.distance <= reach + model_.faces()[sheets.id].tolerance)
      feet.faces.push_back({sheets.id, foot.uv, foot.distance, foot.distance});
  }
  if (feet.faces.empty() && !found.empty() &&
      std::sqrt(samples.front().squared_distance) <= faces_.face_spacing[found[0].id] + reach) {
    // The local iteration may have left the basin; the nearest face deserves a global search.
    const FaceId face = found[0].id;
    const FaceFoot foot = project_globally(model_, face, x);
    if (foot.distance <= reach + model_.faces()[face].tolerance)
      feet.faces.push_back({face, foot.uv, foot.distance, foot.distance});
  }
  std::sort(feet.faces.begin(), feet.faces.end(),
            [](const FaceCandidate& a, const FaceCandidate& b) { return a.distance < b.distance; });
  drop_outside(edge_reach(n, reach), feet);
  return feet;
}

void FootFinder::find_edge_feet(const Vector3d& x, double reach, NodeFeet& feet) const {
  std::vector<EdgeStrands> found;
  for (const Neighbour& near :
       near_edges_.within(x, [&](double spacing) { return spacing + reach; })) {
    const auto [edge, t] = edge_seeds_[near.index];
    EdgeStrands& strands = entry_of(found, edge);
    if (strands.is_exact(kExact * model_.diagonal()) ||
        strands.has(t, edge_points_.row(near.index)))
      continue;
    strands.add(model_, project_on_edge(model_, edge, x, t));
  }
  for (const EdgeStrands& strands : found) feet.edges.push_back(strands.nearest());
  std::sort(feet.edges.begin(), feet.edges.end(),
            [](const EdgeFoot& a, const EdgeFoot& b) { return a.distance < b.distance; });
}

// A foot on the carrier surface outside the wires belongs to another face, or to none.
void FootFinder::drop_outside(double edge_reach, NodeFeet& feet) const {
  // To the nearest near edge of a face; infinite without one.
  const auto distance_to_wire = [&](FaceId face) {
    for (const EdgeFoot& foot : feet.edges)
      if (foot.distance <= edge_reach + model_.edges()[foot.edge].tolerance)
        for (const CoedgeId c : model_.edges()[foot.edge].coedges)
          if (model_.coedges()[c].face == face) return foot.distance;
    return std::numeric_limits<double>::infinity();
  };
  for (FaceCandidate& c : feet.faces)
    if (!model_.is_inside(c.face, c.uv)) c.gap = distance_to_wire(c.face);
  std::erase_if(feet.faces, [](const FaceCandidate& c) { return std::isinf(c.gap); });
}

Vector2d FootFinder::seed(FaceId face, const Vector3d& x, double radius) const {
  const double own = faces_.face_spacing[face];
  for (const Neighbour& near : near_faces_.within(
           x, [&](double spacing) { return spacing >= own ? 2 * own + radius : -1; }))
    if (faces_.face[near.index] == face) return faces_.uv[near.index];
  return project_globally(model_, face, x).uv;
}

}  // namespace cadmorph
