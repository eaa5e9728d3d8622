#include "surface/curve_maps.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <numeric>
#include <set>

#include "core/parallel.h"

namespace cadmorph {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kEqualTurn = 2e-3, kLikeTurn = 0.1, kFollows = 0.1;  // of a turn's angle
constexpr double kLeastTurn = 0.01;                                   // of a full turn
constexpr double kSameEnd = 1e-6;                                     // of the diagonal
constexpr double kSameMotion = 1e-6;                                  // of sums of squares
constexpr double kAlike = 0.985, kUnlike = 0.866;                     // cosines of 10, 30 degrees

class MovedSeams {
 public:
  MovedSeams(const ModelPair& pair, std::vector<CurveMap>& maps)
      : pair_(pair), base_(pair.base), maps_(maps), curves_of_face_(pair.base.faces().size()) {
    for (int c = 0; c < static_cast<int>(maps.size()); ++c)
      for (const int f : base_.skeleton().curves[c].faces)
        if (curves_of_face_[f].empty() || curves_of_face_[f].back() != c)
          curves_of_face_[f].push_back(c);
  }

  // A seam that moved turns all linked curves by one angle, to the digit, and what lies beside them
  // stays; a twist of the part turns them by different ones, or their neighbours with them. Only
  // the former is an artefact. Where the curves change their form, too, the angles agree roughly:
  // then the neighbours must say so.
  void undo() {
    for (const std::vector<int>& linked : linked_curves()) {
      std::vector<int> kept = linked;  // those that kept their form
      std::erase_if(kept, [&](int c) { return !maps_[c].keeps_form(); });
      if (kept.size() > 1 && turns_as_one(kept, kEqualTurn) && moves_needlessly(kept) &&
          !neighbours_follow(kept))
        take_least_motion(kept);
      else if (turns_as_one(linked, kLikeTurn) && moves_needlessly(linked) &&
               neighbours_contradict(linked))
        take_least_motion(linked);
    }
    while (undo_twists()) {
    }
  }

 private:
  // Cylinders and cones have straight seams: where both models have one, its ends turn alike. Where
  // they do not, some were started elsewhere. Returns whether a curve changed.
  bool undo_twists() {
    bool is_any = false;
    for (int f = 0; f < static_cast<int>(curves_of_face_.size()); ++f) {
      if (!is_straight(base_.faces()[f]) ||
          !is_straight(pair_.variant.faces()[pair_.match.faces[f]]))
        continue;
      std::vector<int> turning, still;
      for (const int c : curves_at_seam(f))
        if (is_turning(c))
          turning.push_back(c);
        else if (maps_[c].turn() || maps_[c].is_by_least_motion())
          still.push_back(c);
      if (turning.empty()) continue;
      const bool turns_whole = still.empty() && turns_as_one(turning, kLikeTurn);
      const bool is_twisted = !turns_whole && !keeps_seam(f);
      if (!is_twisted || !moves_needlessly(turning)) continue;
      take_least_motion(turning);
      is_any = true;
    }
    return is_any;
  }

  // Whether the curves at the ends of each seam of a face lead both to those of one of the
  // variant's.
  bool keeps_seam(int face) const {
    const CadModel& variant = pair_.variant;
    const auto leads_to = [&](int v, int w) {
      const bool is_apex =
          std::ranges::none_of(curves_of_face_[face], [&](int c) { return runs_through(c, v); });
      if (is_apex) return true;
      if (w < 0) return false;
      const CadVertex& end = variant.vertices()[w];
      return (end.point - map_vertex(pair_, maps_, v)).norm() <=
             std::max(end.tolerance, kSameEnd * variant.diagonal());
    };
    const std::vector<int> images = seams(variant, pair_.match.faces[face]);
    return std::ranges::all_of(seams(base_, face), [&](int seam) {
      const CadEdge& from = base_.edges()[seam];
      return std::ranges::any_of(images, [&](int image) {
        const CadEdge& to = variant.edges()[image];
        return (leads_to(from.start, to.start) && leads_to(from.end, to.end)) ||
               (leads_to(from.start, to.end) && leads_to(from.end, to.start));
      });
    });
  }

  static bool is_straight(const CadFace& face) {
    return face.type == SurfaceType::Cylinder || face.type == SurfaceType::Cone;
  }

  bool is_turning(int c) const { return maps_[c].turn() && maps_[c].turn()->norm() > kLeastTurn; }

  // Curves that share a face with some of those, ascending.
  std::set<int> neighbours(const std::vector<int>& curves) const {
    std::set<int> beside;
    for (const int c : curves)
      for (const int f : base_.skeleton().curves[c].faces)
        beside.insert(curves_of_face_[f].begin(), curves_of_face_[f].end());
    for (const int c : curves) beside.erase(c);
    return beside;
  }

  // Closed curves of a face that start where a seam of its own ends, ascending.
  std::vector<int> curves_at_seam(int face) const {
    std::vector<int> ends;
    for (const int seam : seams(base_, face))
      for (const int c : curves_of_face_[face])
        if (base_.skeleton().curves[c].is_closed() && (runs_through(c, base_.edges()[seam].start) ||
                                                       runs_through(c, base_.edges()[seam].end)))
          ends.push_back(c);
    std::ranges::sort(ends);
    ends.erase(std::unique(ends.begin(), ends.end()), ends.end());
    return ends;
  }

  bool runs_through(int curve, int vertex) const {
    return std::ranges::any_of(base_.skeleton().curves[curve].links, [&](const CurveLink& link) {
      const CadEdge& edge = base_.edges()[link.edge];
      return vertex >= 0 && (edge.start == vertex || edge.end == vertex);
    });
  }

  // Closed curves that are linked by the faces which close on themselves between them, seam to
  // seam: a seam that moved moves where all of them start. A ring between two closed curves links
  // them where they turn nearly alike: not the seams, but the part does that.
  std::vector<std::vector<int>> linked_curves() const {
    std::vector<int> group(maps_.size());
    std::iota(group.begin(), group.end(), 0);
    for (std::size_t f = 0; f < curves_of_face_.size(); ++f) {
      const bool closes = !base_.faces()[f].period.isZero(0);
      if (!closes && !is_ring(curves_of_face_[f])) continue;
      const std::vector<int> around =
          closes ? curves_at_seam(static_cast<int>(f)) : curves_of_face_[f];
      int first = -1;
      for (const int c : around) {
        if (!maps_[c].turn()) continue;
        if (first < 0) first = c;
        const int from = group[c], to = group[first];
        std::replace(group.begin(), group.end(), from, to);
      }
    }
    std::map<int, std::vector<int>> members;
    for (int c = 0; c < static_cast<int>(maps_.size()); ++c)
      if (maps_[c].turn()) members[group[c]].push_back(c);
    std::vector<std::vector<int>> linked;
    for (auto& [id, curves] : members) linked.push_back(std::move(curves));
    return linked;
  }

  bool is_ring(const std::vector<int>& around) const {
    if (around.size() != 2 || !maps_[around[0]].turn() || !maps_[around[1]].turn()) return false;
    const Vector3d a = *maps_[around[0]].turn(), b = *maps_[around[1]].turn();
    return difference(a, b) < kFollows * std::max(a.norm(), b.norm());
  }

  // Of turns, whose axes may differ: a tube may end obliquely. A turn is also the one the other way
  // round.
  static double difference(const Vector3d& a, const Vector3d& b) {
    const double difference = a.norm() - std::copysign(b.norm(), a.dot(b));
    return std::abs(difference - std::round(difference));
  }

  void take_least_motion(const std::vector<int>& curves) {
    for (const int c : curves) maps_[c].take_least_motion();
  }

  bool turns_as_one(const std::vector<int>& linked, double tolerance) const {
    const Vector3d turn = *maps_[linked.front()].turn();
    return turn.norm() > kLeastTurn && std::all_of(linked.begin(), linked.end(), [&](int c) {
             return difference(turn, *maps_[c].turn()) < tolerance * turn.norm();
           });
  }

  // Whether the parameters move the curves more than the least motion does, seen from where they
  // were, or from where the part went as a whole. The prediction that the least motion follows may
  // itself be wrong, where little but the curves is there to predict from. A bore that grows in
  // place moves as far as one that turns along with the holes around it: rounding does not decide.
  bool moves_needlessly(const std::vector<int>& linked) const {
    Vector2d in_place = Vector2d::Zero(), with_part = in_place;
    for (const int c : linked) {
      in_place += maps_[c].moved_beyond(Similarity{});
      with_part += maps_[c].moved_beyond(pair_.match.alignment);
    }
    const Vector2d moved = in_place.cwiseMin(with_part);
    return moved[0] > (1 + kSameMotion) * moved[1];
  }

  // How far the curves round about turned whose motion is certain, between corners or closed ones
  // that don't turn, and how far the linked ones do: cosines and sines of the angles, times
  // positive numbers.
  struct Spins {
    Vector2d certain, by_parameter, by_least;
  };

  Spins spins(const std::vector<int>& linked) const {
    const Vector3d axis = maps_[linked.front()].turn()->normalized();
    Spins sums{Vector2d::Zero(), Vector2d::Zero(), Vector2d::Zero()};
    for (const int c : linked) {
      sums.by_parameter += maps_[c].spin(axis);
      sums.by_least += maps_[c].spin_of_least_motion(axis);
    }
    for (const int c : neighbours(linked))
      if (!base_.skeleton().curves[c].is_closed() || (maps_[c].turn() && !is_turning(c)))
        sums.certain += maps_[c].spin(axis);
    return sums;
  }

  static double cosine(const Vector2d& a, const Vector2d& b) {
    return a.normalized().dot(b.normalized());
  }

  // Whether the neighbours turned as the linked ones do by their parameters, rather than as they
  // would by the least motion.
  bool neighbours_follow(const std::vector<int>& linked) const {
    const Spins s = spins(linked);
    return !s.certain.isZero(0) &&
           cosine(s.certain, s.by_parameter) > cosine(s.certain, s.by_least);
  }

  // Whether the neighbours turned as the linked ones would by the least motion, and far from as
  // they do by their parameters.
  bool neighbours_contradict(const std::vector<int>& linked) const {
    const Spins s = spins(linked);
    return !s.certain.isZero(0) && cosine(s.certain, s.by_least) > kAlike &&
           cosine(s.certain, s.by_parameter) < kUnlike;
  }

  const ModelPair& pair_;
  const CadModel& base_;
  std::vector<CurveMap>& maps_;
  std::vector<std::vector<int>> curves_of_face_;
};

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
  MovedSeams(pair, maps).undo();
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
