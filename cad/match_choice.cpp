#include "cad/match_choice.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "cad/match_search.h"
#include "cad/motion_guess.h"

namespace cadmorph {
namespace {

using Eigen::Vector3d;

constexpr const char* kFileOrder = "file order, verified";
// Refinements that one guess may cost, and that one may where a match is known already.
constexpr int kMostRefinements = 2000, kFewRefinements = 60;
// Matches whose distances differ by less than this part of the diagonal, or this factor, are
// equally good: symmetric parts have many.
constexpr double kTie = 1e-5;
constexpr double kSlack = 1.02;
constexpr double kFarBetter = 0.3;
// A large change of shape blurs distances: neighbours that swap may seem nearer than the truth.
constexpr double kFileOrderSlack = 2;
constexpr double kSamePlace = 1e-9;     // of the diagonal: coincident copies are equally near
constexpr double kHardlyTurned = 1e-3;  // radians
// Of the diagonal: a change of parameters moves entities by less, on the mean. And the factor by
// which a match that turns the part moves them farther.
constexpr double kSmallMove = 0.2, kFartherMove = 2;
constexpr double kTurn = 0.3;  // radians
// An order that fits by accident is no evidence: bits that it must carry.
constexpr double kOrderBits = 20;
constexpr int kSmoothing = 40, kFollowing = 12;  // neighbours
constexpr double kRougher = 3, kSmooth = 1e-4;   // factor, of the diagonal
constexpr double kWorthImproving = 1e-3;         // of the diagonal
constexpr int kImprovements = 3;
constexpr double kAgreement = 0.75, kMoreAgreement = 0.05;  // parts of all forms
constexpr double kManyFaces = 8;                            // more that agree are no accident

struct Scored {
  TopologyMatch match;
  double distance;   // after the best similarity, in diagonals of the variant
  double roughness;  // see above
  double agreement;  // part of the forms that are the same
  double unturned;   // distance after a shift and a change of scale alone
  double angle() const { return Eigen::AngleAxisd(match.alignment.rotation).angle(); }
};

// Node of the variant for each entity node of the base.
std::vector<int> partners(const MatchSide& base, const TopologyMatch& match) {
  std::vector<int> nodes = match.faces;
  for (const int c : match.curves) nodes.push_back(base.graph.curve_node(c));
  for (const int c : match.corners) nodes.push_back(base.graph.corner_node(c));
  return nodes;
}

EntityMotion motion_of(const MatchSide& base, const MatchSide& variant, const TopologyMatch& match,
                       int neighbours) {
  std::vector<Vector3d> from, to;
  const auto nodes = partners(base, match);
  for (std::size_t n = 0; n < nodes.size(); ++n) {
    from.push_back(base.features[n].centre);
    to.push_back(variant.features[nodes[n]].centre);
  }
  return {fit_affine(from, to, match.alignment), from, to, neighbours};
}

// Root mean square distance of corners and curves, in variant diagonals; of faces, too, where there
// are no corners. Face centroids depend a little on the parametrisation.
double distance_after(const MatchSide& base, const MatchSide& variant, const TopologyMatch& match,
                      const Similarity& t) {
  double sum = 0;
  int count = 0;
  const auto add = [&](int b, int v) {
    const EntityFeature& feature = base.features[b];
    sum += squared_distance(feature, variant.features[v], t(feature.centre), t.scale);
    ++count;
  };
  for (int c = 0; c < base.graph.curves; ++c)
    add(base.graph.curve_node(c), variant.graph.curve_node(match.curves[c]));
  for (int c = 0; c < base.graph.corners; ++c)
    add(base.graph.corner_node(c), variant.graph.corner_node(match.corners[c]));
  for (int f = 0; f < base.graph.faces && base.graph.corners == 0; ++f) add(f, match.faces[f]);
  return std::sqrt(sum / count) / variant.model.diagonal();
}

// The shift that carries the entities best, after the change of the part's size.
Similarity shift_of(const MatchSide& base, const MatchSide& variant, const TopologyMatch& match) {
  std::vector<Vector3d> from, to;
  const auto nodes = partners(base, match);
  for (std::size_t n = 0; n < nodes.size(); ++n) {
    from.push_back(base.features[n].centre);
    to.push_back(variant.features[nodes[n]].centre);
  }
  return fit_shift(from, to, variant.model.diagonal() / base.model.diagonal());
}

using UseForms = std::map<std::pair<int, int>, std::vector<std::uint64_t>>;

UseForms forms_of_uses(const MatchSide& side) {
  UseForms forms;
  for (const EntityGraph::Use& use : side.graph.uses)
    forms[{side.model.coedges()[use.coedge].face, use.curve}].push_back(side.forms[use.node]);
  return forms;
}

double agreement_of(const UseForms& base, const UseForms& variant, const TopologyMatch& match) {
  int same = 0, all = 0;
  for (const auto& [use, forms] : base) {
    const auto partner = variant.find({match.faces[use.first], match.curves[use.second]});
    for (const std::uint64_t form : forms) {
      ++all;
      same +=
          form != 0 && partner != variant.end() &&
          std::find(partner->second.begin(), partner->second.end(), form) != partner->second.end();
    }
  }
  return all > 0 ? static_cast<double>(same) / all : 0;
}

double log2_factorial(int n) { return std::lgamma(n + 1.0) / std::log(2.0); }

// Entities in the order of the files, where that is consistent with the adjacency and hardly by
// accident; faces alone where the files list edges differently. Symmetry may double the chances
// many times over: half of the bits count.
std::optional<TopologyMatch> by_file_order(const MatchSide& base, const MatchSide& variant,
                                           const ColourRefinement& colours,
                                           const MotionGuess& guess) {
  const EntityGraph& graph = base.graph;
  for (const int count : {graph.entity_count(), graph.faces}) {
    double bits = log2_factorial(graph.faces);
    if (count > graph.faces) bits += log2_factorial(graph.curves) + log2_factorial(graph.corners);
    ColourRefinement trial = colours;
    bool is_possible = bits >= kOrderBits;
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

// Collects possible matches and chooses among them.
class Selection {
 public:
  Selection(const MatchSide& base, const MatchSide& variant)
      : base_(base),
        variant_(variant),
        base_forms_(forms_of_uses(base)),
        variant_forms_(forms_of_uses(variant)) {}

  // Returns whether no other match can be better: an exact one that hardly turns, is in file order,
  // or agrees in its parameters.
  bool offer(std::optional<TopologyMatch> match) {
    if (!match) return false;
    for (const Scored& other : all_)
      if (other.match.faces == match->faces && other.match.curves == match->curves &&
          other.match.corners == match->corners)
        return false;
    align(base_.model, variant_.model, *match);
    const double distance = distance_after(base_, variant_, *match, match->alignment);
    const double agreement = distance < kTie
                                 ? parameter_agreement(base_.model, variant_.model, *match)
                                 : agreement_of(base_forms_, variant_forms_, *match);
    const double rough = roughness(base_, variant_, *match);
    const double unturned =
        distance_after(base_, variant_, *match, shift_of(base_, variant_, *match));
    all_.push_back({std::move(*match), distance, rough, agreement, unturned});
    const Scored& last = all_.back();
    return distance < kTie && (last.match.how == kFileOrder || last.angle() < kHardlyTurned ||
                               agreement > 1 - kMoreAgreement);
  }

  bool is_empty() const { return all_.empty(); }

  // The smoothest of those found so far.
  const Scored& smoothest() const {
    return *std::min_element(all_.begin(), all_.end(), [](const Scored& a, const Scored& b) {
      return a.roughness < b.roughness;
    });
  }

  std::optional<TopologyMatch> best() {
    if (all_.empty()) return std::nullopt;
    keep_near();
    const double limit = kRougher * smoothest().roughness + kSmooth;
    std::erase_if(all_, [&](const Scored& s) { return s.roughness > limit; });
    keep_agreeing();
    return std::move(choose().match);
  }

 private:
  // Where a match moves entities a little, one that turns the part and moves them far is no change
  // of parameters: a hole that crosses the middle of a plate, not the plate turned over. The same
  // part exported turned keeps its parameters.
  void keep_near() {
    double least = std::numeric_limits<double>::infinity();
    for (const Scored& s : all_) {
      if (s.distance < kTie && s.agreement > 1 - kMoreAgreement) return;
      least = std::min(least, s.unturned);
    }
    if (least > kSmallMove) return;
    std::erase_if(all_, [&](const Scored& s) {
      return std::max(s.angle() / kTurn, s.unturned / kSmallMove) > 1 &&
             s.unturned > kFartherMove * least + kTie;
    });
  }

  void keep_agreeing() {
    double most = 0;
    for (const Scored& s : all_) most = std::max(most, s.agreement);
    const auto faces = static_cast<double>(base_.graph.faces);
    const auto agrees = [&](const Scored& s) {
      const double less = most - s.agreement;
      return less < kMoreAgreement || (most < kAgreement && less * faces < kManyFaces);
    };
    const double least = least_distance([](const Scored&) { return true; });
    if (least_distance(agrees) <= kFileOrderSlack * least + kTie)
      std::erase_if(all_, [&](const Scored& s) { return !agrees(s); });
  }

  // A turn must pay: matches by file order or without a turn give way only to one that fits far
  // better. Among either, the file's order if it fits nearly as well as any; else the nearest, of
  // equals the one of least rotation.
  Scored& choose() {
    const auto is_by_turn = [](const Scored& s) { return s.match.how == kTurned; };
    const double unturned = least_distance([&](const Scored& s) { return !is_by_turn(s); });
    const double turned = least_distance(is_by_turn);
    const bool is_turned = turned < kFarBetter * unturned - kTie;
    const double least = is_turned ? turned : unturned;
    Scored* best = nullptr;
    for (Scored& s : all_) {
      if (is_by_turn(s) != is_turned) continue;
      if (s.match.how == kFileOrder && s.distance <= kFileOrderSlack * least + kTie) return s;
      if (s.distance > kSlack * least + kTie) continue;
      if (!best || s.angle() < best->angle()) best = &s;
    }
    return *best;
  }

  template <class Predicate>
  double least_distance(const Predicate& is_asked) const {
    double result = std::numeric_limits<double>::infinity();
    for (const Scored& s : all_)
      if (is_asked(s)) result = std::min(result, s.distance);
    return result;
  }

  const MatchSide& base_;
  const MatchSide& variant_;
  UseForms base_forms_, variant_forms_;
  std::vector<Scored> all_;
};

// Tries one guess after the other until nothing better can come.
class PositionMatcher {
 public:
  PositionMatcher(const MatchSide& base, const MatchSide& variant, const ColourRefinement& colours)
      : base_(base), variant_(variant), plain_(colours), selection_(base, variant) {
    ColourRefinement hinted = colours;
    hinted.hint(base.forms, variant.forms);
    if (hinted.refine()) hinted_ = std::move(hinted);
  }

  std::optional<TopologyMatch> run() {
    const auto guesses = first_guesses(base_, variant_, hinted_ ? *hinted_ : plain_);
    auto in_place = decide(plain_, guesses.front());
    if (in_place && distance_after(base_, variant_, *in_place, Similarity{}) < kTie) {
      selection_.offer(std::move(in_place));
      return selection_.best();
    }
    if (selection_.offer(by_file_order(base_, variant_, plain_, guesses[1].motion)))
      return selection_.best();
    if (selection_.offer(std::move(in_place))) return selection_.best();
    for (const NamedGuess& guess : guesses)
      if (offer_both(guess)) return selection_.best();
    improve();
    return selection_.best();
  }

 private:
  std::optional<TopologyMatch> decide(const ColourRefinement& colours,
                                      const NamedGuess& guess) const {
    const int most = selection_.is_empty() ? kMostRefinements : kFewRefinements;
    const auto decided = decide_by_closeness(base_, variant_, colours, guess.motion, most);
    if (!decided) return std::nullopt;
    TopologyMatch match = to_match(base_, *decided);
    match.how = guess.how;
    return match;
  }

  bool offer_both(const NamedGuess& guess) {
    return (hinted_ && selection_.offer(decide(*hinted_, guess))) ||
           selection_.offer(decide(plain_, guess));
  }

  // Entities that a bad guess exchanged stand out of the smoothed motion of the others: guess by
  // that.
  void improve() {
    for (int i = 0; i < kImprovements && !selection_.is_empty(); ++i) {
      const Scored& best = selection_.smoothest();
      const double before = best.roughness;
      if (before < kWorthImproving) return;
      const auto motion =
          std::make_shared<EntityMotion>(motion_of(base_, variant_, best.match, kSmoothing));
      const bool is_turned = best.match.how == kTurned;
      const NamedGuess guess{
          {[motion](const Vector3d& x) { return (*motion)(x); }, best.match.alignment.scale},
          is_turned ? kTurned : kInPlace};
      offer_both(guess);
      if (selection_.smoothest().roughness > 0.9 * before) return;
    }
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
      match.faces.push_back(v);
    else if (n < graph.faces + graph.curves)
      match.curves.push_back(v - graph.faces);
    else
      match.corners.push_back(v - graph.faces - graph.curves);
  }
  return match;
}

double roughness(const MatchSide& base, const MatchSide& variant, const TopologyMatch& match) {
  const auto nodes = partners(base, match);
  const EntityMotion motion = motion_of(base, variant, match, kSmoothing);
  double sum = 0;
  for (std::size_t n = 0; n < nodes.size(); ++n)
    sum +=
        (motion(base.features[n].centre, static_cast<int>(n)) - variant.features[nodes[n]].centre)
            .squaredNorm();
  return std::sqrt(sum / static_cast<double>(nodes.size())) / variant.model.diagonal();
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
