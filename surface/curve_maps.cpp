#include "surface/curve_maps.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <numeric>

#include "core/parallel.h"

namespace cadmorph {
namespace {

using Eigen::Vector3d;

constexpr double kEqualTurn = 2e-3, kLeastTurn = 0.01;  // of a turn

// Closed curves that are linked by the faces which close on themselves between them, seam to seam:
// a seam that moved moves where all of them start.
std::vector<std::vector<int>> linked_curves(const CadModel& base,
                                            const std::vector<CurveMap>& maps) {
  std::vector<int> group(maps.size());
  std::iota(group.begin(), group.end(), 0);
  const auto closes = [&](int f) { return !base.faces()[f].period.isZero(0); };
  std::vector<int> first(base.faces().size(), -1);
  for (int c = 0; c < static_cast<int>(maps.size()); ++c) {
    if (!maps[c].turn()) continue;
    for (const int f : base.skeleton().curves[c].faces) {
      if (!closes(f)) continue;
      if (first[f] < 0) first[f] = c;
      const int from = group[c], to = group[first[f]];
      std::replace(group.begin(), group.end(), from, to);
    }
  }
  std::map<int, std::vector<int>> members;
  for (int c = 0; c < static_cast<int>(maps.size()); ++c)
    if (maps[c].turn()) members[group[c]].push_back(c);
  std::vector<std::vector<int>> linked;
  for (auto& [id, curves] : members) linked.push_back(std::move(curves));
  return linked;
}

// A seam that moved turns all linked curves by one angle, to the digit; a twist of the part turns
// them by different ones. Only the former is an artefact.
void undo_moved_seams(const CadModel& base, std::vector<CurveMap>& maps) {
  for (const std::vector<int>& linked : linked_curves(base, maps)) {
    if (linked.size() < 2) continue;
    const Vector3d turn = *maps[linked.front()].turn();
    // Half a turn is one either way round.
    const bool is_equal = std::all_of(linked.begin(), linked.end(), [&](int c) {
      const double limit = kEqualTurn * turn.norm();
      const Vector3d other = *maps[c].turn();
      return (other - turn).norm() < limit ||
             ((other + turn).norm() < limit && 0.5 - turn.norm() < limit);
    });
    if (is_equal && turn.norm() > kLeastTurn)
      for (const int c : linked) maps[c].take_least_motion();
  }
}

}  // namespace

std::vector<CurveMap> map_curves(const ModelPair& pair) {
  const auto count = static_cast<Index>(pair.base.skeleton().curves.size());
  std::vector<std::unique_ptr<CurveMap>> made(static_cast<std::size_t>(count));
  parallel_for(count, 1, [&](Index begin, Index end) {
    for (Index c = begin; c < end; ++c)
      made[c] = std::make_unique<CurveMap>(pair, static_cast<int>(c));
  });
  std::vector<CurveMap> maps;
  for (auto& map : made) maps.push_back(std::move(*map));
  undo_moved_seams(pair.base, maps);
  return maps;
}

Vector3d map_vertex(const ModelPair& pair, const std::vector<CurveMap>& maps, int vertex) {
  const CadSkeleton& skeleton = pair.base.skeleton();
  const int corner = skeleton.corner_of_vertex[vertex];
  if (corner >= 0)
    return pair.variant.vertices()[pair.variant.skeleton().corners[pair.match.corners[corner]]]
        .point;
  const auto& edges = pair.base.edges();
  const auto edge = std::find_if(edges.begin(), edges.end(), [&](const CadEdge& e) {
    return e.is_physical() && (e.start == vertex || e.end == vertex);
  });
  const int id = static_cast<int>(edge - edges.begin());
  const CurveLocation to =
      maps[skeleton.curve_of_edge[id]]({id, edge->start == vertex ? edge->first : edge->last});
  return pair.variant.evaluate_edge(to.edge, to.t).point;
}

}  // namespace cadmorph
