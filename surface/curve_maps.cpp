#include "surface/curve_maps.h"

#include <algorithm>
#include <array>
#include <map>
#include <memory>
#include <numeric>

#include "cad/alignment.h"
#include "core/parallel.h"

namespace cadmorph {
namespace {

using Eigen::Vector3d;

// In the order in which equal costs are taken.
constexpr std::array kAllStarts{Start::Parameters, Start::InPlace, Start::WithPart,
                                Start::Predicted};
// Bits. Other starts take the parameters for moved, once for all that a seam links, which is worth
// four times as little turn; curves that are the same need none. In place explains more than with
// the part, and that more than the prediction.
constexpr double kInPlaceBits = 2, kWithPartBits = 2.5, kPredictedBits = 3;
constexpr double kTie = 1e-3;

bool runs_through(const CadModel& model, int curve, int vertex) {
  return std::ranges::any_of(model.skeleton().curves[curve].links, [&](const CurveLink& link) {
    const CadEdge& edge = model.edges()[link.edge];
    return vertex >= 0 && (edge.start == vertex || edge.end == vertex);
  });
}

// Closed curves in groups that faces which close on themselves link, seam to seam: a seam that
// moved moves where all of them start.
std::vector<std::vector<int>> linked_curves(const CadModel& model) {
  const auto& curves = model.skeleton().curves;
  std::vector<std::vector<int>> closed_of_face(model.faces().size());
  for (int c = 0; c < static_cast<int>(curves.size()); ++c)
    if (curves[c].is_closed())
      for (const int f : curves[c].faces) closed_of_face[f].push_back(c);
  std::vector<int> group(curves.size());
  std::iota(group.begin(), group.end(), 0);
  for (std::size_t f = 0; f < closed_of_face.size(); ++f) {
    int first = -1;
    for (const int seam : seams(model, static_cast<int>(f)))
      for (const int c : closed_of_face[f]) {
        const CadEdge& edge = model.edges()[seam];
        if (!runs_through(model, c, edge.start) && !runs_through(model, c, edge.end)) continue;
        if (first < 0) first = c;
        const int from = group[c], to = group[first];
        std::ranges::replace(group, from, to);
      }
  }
  std::map<int, std::vector<int>> members;
  for (int c = 0; c < static_cast<int>(curves.size()); ++c)
    if (curves[c].is_closed()) members[group[c]].push_back(c);
  std::vector<std::vector<int>> linked;
  for (auto& [id, one] : members) linked.push_back(std::move(one));
  return linked;
}

// The motion of the curves between corners that share a face with a curve: nothing leaves it open.
std::optional<Similarity> motion_around(const CadModel& model, int curve,
                                        const std::vector<std::vector<int>>& open_of_face,
                                        const std::vector<CurveMap>& maps) {
  std::vector<Vector3d> from, to;
  for (const int f : model.skeleton().curves[curve].faces)
    for (const int c : open_of_face[f]) maps[c].add_images(from, to);
  if (from.empty()) return std::nullopt;
  return fit_similarity(from, to);
}

double moved_seam(Start start, const std::vector<int>& linked, const std::vector<CurveMap>& maps) {
  switch (start) {
    case Start::Parameters:
      return 0;
    case Start::InPlace:
      return kInPlaceBits;
    case Start::WithPart:
      return std::ranges::all_of(linked, [&](int c) { return maps[c].is_same(); }) ? 0
                                                                                   : kWithPartBits;
    case Start::Predicted:
      break;
  }
  return kPredictedBits;
}

// One start for all curves of a group: the cheapest.
void choose_start(const std::vector<int>& linked, std::vector<CurveMap>& maps) {
  Start best = Start::Parameters;
  double least = 1e300;
  for (const Start start : kAllStarts) {
    double cost = moved_seam(start, linked, maps);
    for (const int c : linked) cost += maps[c].cost(start);
    if (cost >= least - kTie) continue;
    best = start;
    least = cost;
  }
  for (const int c : linked) maps[c].take(best);
}

// Which of several possible places a closed curve starts at, that no corner holds.
void choose_starts(const CadModel& model, std::vector<CurveMap>& maps) {
  std::vector<std::vector<int>> open_of_face(model.faces().size());
  for (int c = 0; c < static_cast<int>(maps.size()); ++c)
    if (!maps[c].is_closed())
      for (const int f : model.skeleton().curves[c].faces) open_of_face[f].push_back(c);
  for (int c = 0; c < static_cast<int>(maps.size()); ++c)
    if (maps[c].is_closed()) maps[c].rate_starts(motion_around(model, c, open_of_face, maps));
  for (const std::vector<int>& linked : linked_curves(model)) choose_start(linked, maps);
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
  choose_starts(pair.base, maps);
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
