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
// Bits that a start costs once for all curves which a seam links. Any other start than that by the
// parameters claims that the seam moved: it has to save a factor of four in what the curves cost.
// Where the curves are the same, no claim is needed. A predicted start is the least certain one.
// With 1 bit for 2 a narrow groove does not follow its part's twist, with 4 rims of five parts
// follow their seams; with half or twice of kAsAroundBits, 14 pairs and the tests of seams come out
// right.
constexpr double kMovedSeamBits = 2, kAsAroundBits = 3;
constexpr double kTie = 1e-3;  // bits: far above the rounding of costs, far below their weights
// Other closed curves on a curve's faces tell how it turns where they lie round it and turn as one:
// the farthest is farther from its axis than kLever, in its sizes, their mean is nearer, and one
// motion carries all of them, but for the part kAsOne of their distances. With twice kLever or half
// kAsOne a ring's rims do not turn with the pockets between them.
constexpr double kLever = 0.5, kAsOne = 0.05;
// Closed curves of a face that are asked: enough for one rotation where there are thousands.
constexpr std::size_t kMostBeside = 64;

bool runs_through(const CadModel& model, CurveId curve, VertexId vertex) {
  return std::ranges::any_of(model.skeleton().curves[curve].links, [&](const CurveLink& link) {
    const CadEdge& edge = model.edges()[link.edge];
    return vertex >= 0 && (edge.start == vertex || edge.end == vertex);
  });
}

// Closed curves in groups that faces which close on themselves link, seam to seam: a seam that
// moved moves where all of them start. Not those that several edges make up: these are laid edge to
// edge, wherever one of the seams that cut them went.
std::vector<std::vector<CurveId>> linked_curves(const CadModel& model) {
  const auto& curves = model.skeleton().curves;
  IdVector<FaceId, std::vector<CurveId>> closed_of_face(model.faces().size());
  for (const CurveId c : curves.ids())
    if (curves[c].is_closed() && curves[c].links.size() == 1)
      for (const FaceId f : curves[c].faces) closed_of_face[f].push_back(c);
  IdVector<CurveId, CurveId> group;
  for (const CurveId c : curves.ids()) group.push_back(c);
  for (const FaceId f : closed_of_face.ids()) {
    CurveId first;
    for (const EdgeId seam : seams(model, f))
      for (const CurveId c : closed_of_face[f]) {
        const CadEdge& edge = model.edges()[seam];
        if (!runs_through(model, c, edge.start) && !runs_through(model, c, edge.end)) continue;
        if (first < 0) first = c;
        const CurveId from = group[c], to = group[first];
        std::ranges::replace(group, from, to);
      }
  }
  std::map<CurveId, std::vector<CurveId>> members;
  for (const CurveId c : curves.ids())
    if (curves[c].is_closed()) members[group[c]].push_back(c);
  std::vector<std::vector<CurveId>> linked;
  for (auto& [id, one] : members) linked.push_back(std::move(one));
  return linked;
}

// The motions of the curves between corners that share a face with each closed curve: nothing
// leaves them open. The same for all holes of a plate. Where there are none, that of the other
// closed curves' centres, where these lie round it: a ring's rims turn with the pockets between.
class MotionsAround {
 public:
  MotionsAround(const CadModel& model, const CurveMaps& maps)
      : model_(model),
        maps_(maps),
        open_of_face_(model.faces().size()),
        closed_of_face_(model.faces().size()) {
    for (const CurveId c : maps.ids())
      for (const FaceId f : model.skeleton().curves[c].faces)
        (maps[c].is_closed() ? closed_of_face_ : open_of_face_)[f].push_back(c);
    place_of_.resize(maps.size());
    parallel_for(std::ssize(maps), 1, [&](Index begin, Index end) {
      for (CurveId c(begin); c < end; ++c)
        if (maps[c].is_closed()) place_of_[c] = maps[c].place();
    });
  }

  /// Nothing where there are no such curves.
  std::optional<MotionAround> of(CurveId closed) {
    std::vector<FaceId> faces = model_.skeleton().curves[closed].faces;
    std::erase_if(faces, [&](FaceId f) { return open_of_face_[f].empty(); });
    if (faces.empty()) return of_places(closed);
    const auto [known, is_new] = motions_.try_emplace(faces);
    if (is_new) {
      std::vector<Vector3d> from, to;
      for (const FaceId f : faces)
        for (const CurveId c : open_of_face_[f]) maps_[c].add_images(from, to);
      known->second = fit_similarity(from, to);
    }
    return MotionAround{known->second};
  }

 private:
  std::optional<MotionAround> of_places(CurveId closed) const {
    const ClosedPlace& own = place_of_[closed];
    std::vector<Vector3d> from, to;
    Vector3d sum = Vector3d::Zero();
    double farthest = 0;
    for (const FaceId f : model_.skeleton().curves[closed].faces) {
      const std::vector<CurveId>& beside = closed_of_face_[f];
      const std::size_t step = 1 + beside.size() / kMostBeside;
      for (std::size_t i = 0; i < beside.size(); i += step) {
        if (beside[i] == closed) continue;
        const ClosedPlace& other = place_of_[beside[i]];
        const Vector3d way = other.centre - own.centre, image = other.image - own.image;
        farthest = std::max(farthest, own.off_axis(other.centre));
        sum += other.centre;
        from.insert(from.end(), {way, -way});  // about the centre
        to.insert(to.end(), {image, -image});
      }
    }
    if (farthest < kLever || own.off_axis(2.0 / double(from.size()) * sum) > kLever)
      return std::nullopt;
    const Similarity motion = fit_similarity(from, to);
    double off = 0, squares = 0;
    for (std::size_t i = 0; i < from.size(); ++i) {
      off += (motion(from[i]) - to[i]).squaredNorm();
      squares += to[i].squaredNorm();
    }
    if (off > kAsOne * kAsOne * squares) return std::nullopt;
    return MotionAround{motion, true};
  }

  const CadModel& model_;
  const CurveMaps& maps_;
  IdVector<FaceId, std::vector<CurveId>> open_of_face_, closed_of_face_;
  IdVector<CurveId, ClosedPlace> place_of_;            // of closed ones
  std::map<std::vector<FaceId>, Similarity> motions_;  // of faces
};

double moved_seam(Start start, const std::vector<CurveId>& linked, const CurveMaps& maps) {
  switch (start) {
    case Start::Parameters:
      return 0;
    case Start::InPlace:
      return kMovedSeamBits;
    case Start::WithPart:
      return std::ranges::all_of(linked, [&](CurveId c) { return maps[c].is_same(); })
                 ? 0
                 : kMovedSeamBits;
    case Start::Predicted:
      break;
  }
  return std::ranges::any_of(linked, [&](CurveId c) { return maps[c].is_told_by_places(); })
             ? kMovedSeamBits
             : kAsAroundBits;
}

// One start for all curves of a group: the cheapest.
void choose_start(const std::vector<CurveId>& linked, CurveMaps& maps) {
  Start best = Start::Parameters;
  double least = 1e300;
  for (const Start start : kAllStarts) {
    double cost = moved_seam(start, linked, maps);
    for (const CurveId c : linked) cost += maps[c].cost(start);
    if (cost >= least - kTie) continue;
    best = start;
    least = cost;
  }
  for (const CurveId c : linked) maps[c].take(best);
}

// Which of several possible places a closed curve starts at, that no corner holds.
void choose_starts(const CadModel& model, CurveMaps& maps) {
  MotionsAround motions(model, maps);
  std::vector<std::pair<CurveMap*, std::optional<MotionAround>>> closed;
  for (const CurveId c : maps.ids())
    if (maps[c].is_closed()) closed.emplace_back(&maps[c], motions.of(c));
  parallel_for(std::ssize(closed), 1, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) closed[i].first->rate_starts(closed[i].second);
  });
  for (const std::vector<CurveId>& linked : linked_curves(model)) choose_start(linked, maps);
}

}  // namespace

CurveMaps map_curves(const ModelPair& pair) {
  const auto count = static_cast<Index>(pair.base.skeleton().curves.size());
  std::vector<std::unique_ptr<CurveMap>> made(static_cast<std::size_t>(count));
  parallel_for(count, 1, [&](Index begin, Index end) {
    for (Index c = begin; c < end; ++c) made[c] = std::make_unique<CurveMap>(pair, CurveId(c));
  });
  CurveMaps maps;
  for (auto& map : made) maps.push_back(std::move(*map));
  choose_starts(pair.base, maps);
  return maps;
}

Vector3d map_vertex(const ModelPair& pair, const CurveMaps& maps, VertexId vertex) {
  const CadSkeleton& skeleton = pair.base.skeleton();
  const CornerId corner = skeleton.corner_of_vertex[vertex];
  if (corner >= 0)
    return pair.variant.vertices()[pair.variant.skeleton().corners[pair.match.corners[corner]]]
        .point;
  const auto& edges = pair.base.edges();
  const auto edge = std::find_if(edges.begin(), edges.end(), [&](const CadEdge& e) {
    return e.is_physical() && (e.start == vertex || e.end == vertex);
  });
  const EdgeId id(edge - edges.begin());
  const CurveLocation to =
      maps[skeleton.curve_of_edge[id]]({id, edge->start == vertex ? edge->first : edge->last});
  return pair.variant.evaluate_edge(to.edge, to.t).point;
}

}  // namespace cadmorph
