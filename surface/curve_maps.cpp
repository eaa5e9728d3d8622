#include "surface/curve_maps.h"

#include <algorithm>
#include <array>
#include <map>
#include <memory>
#include <numeric>
#include <optional>
#include <utility>

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
constexpr double kInPlaceBits = 2, kWithPartBits = 2.5, kAsAroundBits = 3;
constexpr double kTie = 1e-3;  // bits

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

// The motions of the curves between corners that share a face with each closed curve: nothing
// leaves them open. The same for all holes of a plate.
class MotionsAround {
 public:
  MotionsAround(const CadModel& model, const std::vector<CurveMap>& maps)
      : model_(model), maps_(maps), open_of_face_(model.faces().size()) {
    for (int c = 0; c < static_cast<int>(maps.size()); ++c)
      if (!maps[c].is_closed())
        for (const int f : model.skeleton().curves[c].faces) open_of_face_[f].push_back(c);
  }

  /// Nothing where there are no such curves.
  std::optional<Similarity> of(int closed) {
    std::vector<int> faces = model_.skeleton().curves[closed].faces;
    std::erase_if(faces, [&](int f) { return open_of_face_[f].empty(); });
    if (faces.empty()) return std::nullopt;
    const auto [known, is_new] = motions_.try_emplace(faces);
    if (is_new) {
      std::vector<Vector3d> from, to;
      for (const int f : faces)
        for (const int c : open_of_face_[f]) maps_[c].add_images(from, to);
      known->second = fit_similarity(from, to);
    }
    return known->second;
  }

 private:
  const CadModel& model_;
  const std::vector<CurveMap>& maps_;
  std::vector<std::vector<int>> open_of_face_;
  std::map<std::vector<int>, Similarity> motions_;  // of faces
};

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
  return kAsAroundBits;
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
  MotionsAround motions(model, maps);
  std::vector<std::pair<CurveMap*, std::optional<Similarity>>> closed;
  for (int c = 0; c < static_cast<int>(maps.size()); ++c)
    if (maps[c].is_closed()) closed.emplace_back(&maps[c], motions.of(c));
  parallel_for(std::ssize(closed), 1, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) closed[i].first->rate_starts(closed[i].second);
  });
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
