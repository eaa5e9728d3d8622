#include "surface/node_feet.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace cadmorph {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr Index kMinSamples = 20'000, kMaxSamples = 1'000'000, kSamplesPerNode = 4;

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
  for (const int face : faces_.face) spacing.push_back(faces_.face_spacing[face]);
  near_faces_ = SpacedSamples(faces_.points, spacing);
}

void FootFinder::sample_edges() {
  std::vector<Vector3d> points;
  std::vector<double> spacing;
  for (int e = 0; e < static_cast<int>(model_.edges().size()); ++e) {
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
  RowMatrix rows(static_cast<Index>(points.size()), 3);
  for (std::size_t i = 0; i < points.size(); ++i) rows.row(static_cast<Index>(i)) = points[i];
  near_edges_ = SpacedSamples(rows, spacing);
}

NodeFeet FootFinder::find(Index n) const {
  const Vector3d x = surface_.points.row(n);
  NodeFeet feet;
  find_edge_feet(n, x, feet);
  std::vector<int> seen;
  const std::vector<Neighbour> samples = near_faces_.near(x, reach(n));
  for (const Neighbour& near : samples) {
    const int face = faces_.face[near.index];
    if (std::find(seen.begin(), seen.end(), face) != seen.end()) continue;
    seen.push_back(face);
    const FaceFoot foot = project_on_face(model_, face, x, faces_.uv[near.index]);
    if (foot.distance <= reach(n) + model_.faces()[face].tolerance)
      feet.faces.push_back({face, foot.uv, foot.distance, foot.distance});
  }
  if (feet.faces.empty() && !seen.empty() &&
      std::sqrt(samples.front().squared_distance) <= faces_.face_spacing[seen.front()] + reach(n))
    retry_globally(n, x, seen.front(), feet);
  std::sort(feet.faces.begin(), feet.faces.end(),
            [](const FaceCandidate& a, const FaceCandidate& b) { return a.distance < b.distance; });
  drop_outside(n, feet);
  return feet;
}

// The local iteration may have left the basin; the nearest face deserves a global search.
void FootFinder::retry_globally(Index n, const Vector3d& x, int face, NodeFeet& feet) const {
  const FaceFoot foot = project_globally(model_, face, x);
  if (foot.distance <= reach(n) + model_.faces()[face].tolerance)
    feet.faces.push_back({face, foot.uv, foot.distance, foot.distance});
}

void FootFinder::find_edge_feet(Index n, const Vector3d& x, NodeFeet& feet) const {
  std::vector<int> seen;
  for (const Neighbour& near :
       near_edges_.within(x, [&](double spacing) { return spacing + edge_reach(n); })) {
    const auto [edge, t] = edge_seeds_[near.index];
    if (std::find(seen.begin(), seen.end(), edge) != seen.end()) continue;
    seen.push_back(edge);
    feet.edges.push_back(project_on_edge(model_, edge, x, t));
  }
  std::sort(feet.edges.begin(), feet.edges.end(),
            [](const EdgeFoot& a, const EdgeFoot& b) { return a.distance < b.distance; });
}

// The nearest near edge of a face; null without one.
const EdgeFoot* FootFinder::near_wire(Index n, int face, const NodeFeet& feet) const {
  for (const EdgeFoot& foot : feet.edges)
    if (foot.distance <= edge_reach(n) + model_.edges()[foot.edge].tolerance)
      for (const int c : model_.edges()[foot.edge].coedges)
        if (model_.coedges()[c].face == face) return &foot;
  return nullptr;
}

// A foot on the carrier surface outside the wires belongs to another face, or to none.
void FootFinder::drop_outside(Index n, NodeFeet& feet) const {
  for (FaceCandidate& c : feet.faces) {
    if (model_.is_inside(c.face, c.uv)) continue;
    const EdgeFoot* foot = near_wire(n, c.face, feet);
    c.gap = foot ? foot->distance : std::numeric_limits<double>::infinity();
  }
  std::erase_if(feet.faces, [](const FaceCandidate& c) { return std::isinf(c.gap); });
}

Vector2d FootFinder::seed(int face, const Vector3d& x, double radius) const {
  const double own = faces_.face_spacing[face];
  for (const Neighbour& near : near_faces_.within(
           x, [&](double spacing) { return spacing >= own ? 2 * own + radius : -1; }))
    if (faces_.face[near.index] == face) return faces_.uv[near.index];
  return project_globally(model_, face, x).uv;
}

}  // namespace cadmorph
