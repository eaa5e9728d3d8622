#include "cad/match_choice.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <map>

#include "cad/match_cost.h"
#include "cad/match_search.h"
#include "cad/motion_guess.h"
#include "core/kd_tree.h"

namespace cadmorph {
namespace {

using Eigen::Vector3d;

constexpr const char* kFileOrder = "file order, verified";
// Refinements that one guess may cost: a part of 2,000 faces needs less than one a face. Once a
// match is known, a guess may cost kFewRefinements: right guesses need few. Each costs more in
// large models: above kManyEntities their product with the entities is bounded, down to
// kLeastRefinements.
constexpr int kMostRefinements = 2000, kFewRefinements = 60, kLeastRefinements = 10;
constexpr int kManyEntities = 2000;
// Of the diagonal, by which an entity at rest may be off: ten times what exchanged files keep.
constexpr double kRests = 1e-6;
constexpr double kSamePlace = 1e-9;  // of the diagonal: coincident copies are equally near
constexpr int kFollowing = 12;       // neighbours: enough for an affine motion of its own

// Entities in the order of the files, where that is consistent with the adjacency and hardly by
// accident; faces alone where the files list edges differently.
std::optional<TopologyMatch> by_file_order(const MatchSide& base, const MatchSide& variant,
                                           const ColourRefinement& colours,
                                           const MotionGuess& guess) {
  const EntityGraph& graph = base.graph;
  for (const int count : {graph.entity_count(), graph.faces}) {
    ColourRefinement trial = colours;
    bool is_possible = is_order_evidence(graph, count);
    for (int n = 0; n < count && is_possible; ++n) {
      is_possible = trial.base_colours()[n] == trial.variant_colours()[n];
      if (is_possible) trial.individualise(n, n);
    }
    if (!is_possible || !trial.refine()) continue;
    const auto decided = decide_by_closeness(base, variant, trial, guess, kMostRefinements);
    if (!decided) continue;
    TopologyMatch match = to_match(base, *decided);
    match.how = kFileOrder;
    return match;
  }
  return std::nullopt;
}

// Collects possible matches, the cheapest first.
class Selection {
 public:
  Selection(const MatchSide& base, const MatchSide& variant) : base_(base), variant_(variant) {}

  // Returns whether no other match can be better: an exact one that hardly turns, is in file order,
  // or agrees in its parameters.
  bool offer(std::optional<TopologyMatch> match) {
    if (!match) return false;
    for (const TopologyMatch& other : all_)
      if (other.faces == match->faces && other.curves == match->curves &&
          other.corners == match->corners)
        return false;
    rate(base_, variant_, *match);
    all_.push_back(std::move(*match));
    const TopologyMatch& last = all_.back();
    return fits_exactly(last) &&
           (last.how == kFileOrder || last.cost.parameters == 0 ||
            Eigen::AngleAxisd(last.alignment.rotation).angle() < kHardlyTurned);
  }

  bool is_empty() const { return all_.empty(); }

  std::optional<TopologyMatch> best() {
    std::optional<TopologyMatch> best;
    for (TopologyMatch& match : all_) best = cheaper(std::move(best), std::move(match));
    return best;
  }

 private:
  const MatchSide& base_;
  const MatchSide& variant_;
  std::vector<TopologyMatch> all_;
};

// Tries one guess after the other until nothing better can come.
class PositionMatcher {
 public:
  PositionMatcher(const MatchSide& base, const MatchSide& variant, const ColourRefinement& colours)
      : base_(base), variant_(variant), plain_(colours), selection_(base, variant) {
    ColourRefinement hinted = colours;
    hinted.hint(base.forms, variant.forms);
    if (hinted.refine() && hinted.count() > colours.count()) hinted_ = std::move(hinted);
  }

  std::optional<TopologyMatch> run() {
    const auto guesses = first_guesses(base_, variant_, hinted_ ? *hinted_ : plain_);
    std::optional<TopologyMatch> in_place;
    const bool may_stay = may_be_unmoved();
    if (may_stay) in_place = decide(plain_, guesses.front(), kMostRefinements);
    if (in_place && is_unmoved(*in_place)) {
      selection_.offer(std::move(in_place));
      return selection_.best();
    }
    if (selection_.offer(by_file_order(base_, variant_, plain_, guesses[1].motion)))
      return selection_.best();
    if (!may_stay) in_place = decide(plain_, guesses.front(), most_tried());
    if (selection_.offer(std::move(in_place))) return selection_.best();
    if (selection_.offer(with_resting(guesses.front()))) return selection_.best();
    for (const NamedGuess& guess : guesses)
      if (offer_both(guess)) return selection_.best();
    return selection_.best();
  }

 private:
  std::optional<TopologyMatch> decide(const ColourRefinement& colours, const NamedGuess& guess,
                                      int most) const {
    const auto decided = decide_by_closeness(base_, variant_, colours, guess.motion, most);
    if (!decided) return std::nullopt;
    TopologyMatch match = to_match(base_, *decided);
    match.how = guess.how;
    return match;
  }

  // Entities that lie where an equal one lay rest, and the others are decided after them: of a part
  // with many bodies a change moves a few, which mislead a search that begins with them.
  std::optional<TopologyMatch> with_resting(const NamedGuess& in_place) const {
    const double reach = kRests * variant_.model.diagonal();
    ColourRefinement resting = plain_;
    bool has_any = false;
    for (const ColourClass& members : open_classes(plain_, base_.graph.entity_count())) {
      const NearestMembers nearest(variant_, members.variant);
      std::map<int, std::vector<int>> rests;  // those of the base at a node of the variant
      for (const int b : members.base) {
        const EntityFeature& feature = base_.features[b];
        const auto two = nearest.find(feature, feature.centre, 1, 2);
        if (std::sqrt(two[0].first) <= reach && std::sqrt(two[1].first) > reach)
          rests[two[0].second].push_back(b);
      }
      for (const auto& [v, at] : rests)
        if (at.size() == 1) resting.individualise(at.front(), v), has_any = true;
    }
    if (!has_any || !resting.refine()) return std::nullopt;
    return decide(resting, in_place, most_tried());
  }

  // Whether corners lie where corners lay, but for what is_unmoved allows: a search of large
  // symmetric models for a match that can't be takes long.
  bool may_be_unmoved() const {
    const EntityGraph& graph = base_.graph;
    if (graph.corners == 0) return true;
    RowMatrix corners(graph.corners, 3);
    const auto ids = base_.model.skeleton().corners.ids();
    for (const CornerId c : ids)
      corners.row(c) = variant_.features[variant_.graph.corner_node(c)].centre;
    const KdTree tree(corners);
    double sum = 0;
    for (const CornerId c : ids)
      sum +=
          tree.nearest(base_.features[graph.corner_node(c)].centre.data(), 1)[0].squared_distance;
    const double reach = kCentroidRounding * variant_.model.diagonal();
    return sum <= reach * reach * (graph.corners + graph.curves);
  }

  // Centroids of faces are known roughly, the shapes tell.
  bool is_unmoved(TopologyMatch match) const {
    if (distance_after(base_, variant_, match, Similarity{}) < kCentroidRounding) return true;
    align(base_.model, variant_.model, match);
    return stays(match);
  }

  int most_tried() const {
    if (selection_.is_empty()) return kMostRefinements;
    const int entities = std::max(base_.graph.entity_count(), kManyEntities);
    return std::max(kLeastRefinements, kFewRefinements * kManyEntities / entities);
  }

  bool offer_both(const NamedGuess& guess) {
    return (hinted_ && selection_.offer(decide(*hinted_, guess, most_tried()))) ||
           selection_.offer(decide(plain_, guess, most_tried()));
  }

  const MatchSide& base_;
  const MatchSide& variant_;
  ColourRefinement plain_;
  std::optional<ColourRefinement> hinted_;
  Selection selection_;
};

}  // namespace

std::optional<TopologyMatch> match_by_position(const MatchSide& base, const MatchSide& variant,
                                               const ColourRefinement& colours) {
  return PositionMatcher(base, variant, colours).run();
}

TopologyMatch to_match(const MatchSide& base, const ColourRefinement& colours) {
  std::map<int, int> variant_of;
  const EntityGraph& graph = base.graph;
  const int entities = graph.entity_count();
  for (int n = 0; n < entities; ++n) variant_of[colours.variant_colours()[n]] = n;
  TopologyMatch match;
  for (int n = 0; n < entities; ++n) {
    const int v = variant_of.at(colours.base_colours()[n]);
    if (n < graph.faces)
      match.faces.push_back(graph.face(v));
    else if (n < graph.faces + graph.curves)
      match.curves.push_back(graph.curve(v));
    else
      match.corners.push_back(graph.corner(v));
  }
  return match;
}

void set_confidence(const MatchSide& base, const MatchSide& variant,
                    const ColourRefinement& colours, TopologyMatch& match) {
  const int entities = base.graph.entity_count();
  const auto nodes = partners(base, match);
  std::vector<double> confidence(static_cast<std::size_t>(entities), 1.0);
  const EntityMotion motion = motion_of(base, variant, match, kFollowing);
  const double least = kSamePlace * variant.model.diagonal();
  const double scale = match.alignment.scale;
  for (const ColourClass& members : open_classes(colours, entities)) {
    const NearestMembers nearest(variant, members.variant);
    for (const int b : members.base) {
      const EntityFeature& feature = base.features[b];
      const Vector3d at = motion(feature.centre, b);
      const auto two = nearest.find(feature, at, scale, 2);
      const double other = std::sqrt((two[0].second == nodes[b] ? two[1] : two[0]).first);
      const double own =
          std::sqrt(squared_distance(feature, variant.features[nodes[b]], at, scale));
      confidence[b] = (other + least) / (own + other + 2 * least);
    }
  }
  const auto begin = confidence.begin();
  match.face_confidence.assign(begin, begin + base.graph.faces);
  match.curve_confidence.assign(begin + base.graph.faces,
                                begin + base.graph.faces + base.graph.curves);
  match.corner_confidence.assign(begin + base.graph.faces + base.graph.curves, confidence.end());
}

}  // namespace cadmorph
