#include "cad/match_cost.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <numeric>
#include <tuple>

#include "cad/match_search.h"

namespace cadmorph {
namespace {

using Eigen::Vector3d;

// The weights of the terms, fitted to what the matches of 2,800 pairs cost that the search offers:
// the corpus, with its changes as they are and made 0.97, 0.995 and 1.1 times as large, and with
// seams elsewhere, all of which come out right, and with turns by 2.5 and 3.1 radians besides. With
// any of them a tenth larger or smaller at most four come out wrong.
// Of the diagonal, what costs the first bit, and what costs a bit more: changes of parameters move
// entities by a hundredth to a tenth of the diagonal, on the mean.
constexpr double kChange = 1e-3, kDesign = 1.0 / 30;
// The same of the distance from the motion of neighbours, half of which counts: it grows with the
// deformation. The first is ten times what centroids are known to.
constexpr double kRough = 1e-4, kJump = 0.05, kRoughBits = 0.5;
// Neighbours of an entity whose motion is smoothed: exchanged pairs among forty stand out.
constexpr int kSmoothed = 40;
// Of the diagonal, by which entities turn. A change of design leaves a part in its frame; an export
// that turns it keeps the parameters, and then a turn costs nothing.
constexpr double kSmallTurn = 0.2, kTurnBits = 6;
// A face that lies where an equal one lay, parameters and all, most likely rests: the largest
// weight of all.
constexpr double kRestBits = 8;
// A face hardly ever moves through one like it, as a hole that jumps over the next of its row
// would. Faces are alike if their sizes differ by less than kAlike, a part of the size. One passes
// through another if on their ways the two come nearer to each other than the part kThrough of the
// lesser of their distances before and after.
constexpr double kPassBits = 4, kAlike = 0.1, kThrough = 0.25;
// Of the logarithms of the lengths' ratios to base 2: edges alike change alike.
constexpr double kStretch = 0.02;
// Places of edges in their faces' parameters change with the shape, but hardly ever come together
// by accident.
constexpr double kParameterBits = 4;
// A program writes what it wrote before in the same order, where that order is no accident: that
// has fewer bits than the second. With 2 bits holes jump over others: kernels write a pattern's
// holes by where they lie, which may still fit the adjacency.
constexpr double kOrder = 1, kOrderBits = 20;
// Of the fitted distance: standing still fits clearly better. A quarter and three quarters leave
// all known pairs as they are.
constexpr double kStill = 0.5;

double bits(double x, double unit) { return std::log2(1 + x / unit); }

// Root mean square distance by which the alignment turns the entities, in variant diagonals. What
// turns about its own middle moves by its size: a round far field about a small body. Without that
// a throttle whose disc tilts the other way comes out wrong.
double turned_by(const MatchSide& base, const MatchSide& variant, const Similarity& t) {
  Vector3d mean = Vector3d::Zero();
  for (const EntityFeature& feature : base.features) mean += feature.centre;
  mean /= static_cast<double>(base.features.size());
  double sum = 0;
  for (const EntityFeature& feature : base.features) {
    const Vector3d way = feature.centre - mean;
    sum += (t.scale * (t.rotation * way - way)).squaredNorm();
  }
  // Points of a disk lie off its middle by the 2 pi-th part of its area, squares on the mean.
  const double lengthening = std::max(0.0, 3 - t.rotation.trace()) / (2 * std::numbers::pi);
  for (int f = 0; f < base.graph.faces; ++f)
    sum += lengthening * std::pow(t.scale * base.features[f].size, 2);
  return std::sqrt(sum / static_cast<double>(base.features.size())) / variant.model.diagonal();
}

// Standard deviation of the logarithms to base 2 by which the lengths of curves change.
double stretch(const MatchSide& base, const MatchSide& variant, const TopologyMatch& match) {
  const auto length = [](const MatchSide& side, CurveId c) {
    return side.features[side.graph.curve_node(c)].size;
  };
  double sum = 0, squares = 0;
  int count = 0;
  for (const CurveId c : match.curves.ids()) {
    const double from = length(base, c), to = length(variant, match.curves[c]);
    if (from == 0 || to == 0) continue;
    const double change = std::log2(to / from);
    sum += change;
    squares += change * change;
    ++count;
  }
  return count == 0 ? 0 : std::sqrt(std::max(0.0, squares / count - std::pow(sum / count, 2)));
}

using UseForms = std::map<std::pair<FaceId, CurveId>, std::vector<std::uint64_t>>;

UseForms forms_of_uses(const MatchSide& side) {
  UseForms forms;
  for (const EntityGraph::Use& use : side.graph.uses)
    forms[{side.model.coedges()[use.coedge].face, use.curve}].push_back(side.forms[use.node]);
  return forms;
}

// Uses of curves by faces whose pcurve lies elsewhere in the parameters of the surface.
int other_forms(const MatchSide& base, const MatchSide& variant, const TopologyMatch& match) {
  const UseForms before = forms_of_uses(base), after = forms_of_uses(variant);
  int others = 0;
  for (const auto& [use, forms] : before) {
    const auto partner = after.find({match.faces[use.first], match.curves[use.second]});
    for (const std::uint64_t form : forms)
      others += form == 0 || partner == after.end() ||
                std::ranges::find(partner->second, form) == partner->second.end();
  }
  return others;
}

// Faces that the match turns, though one alike lies where they lie, parameters and all.
int turned_from_rest(const MatchSide& base, const MatchSide& variant, const TopologyMatch& match) {
  if (Eigen::AngleAxisd(match.alignment.rotation).angle() < kHardlyTurned) return 0;
  std::vector<int> faces(static_cast<std::size_t>(variant.graph.faces));
  std::iota(faces.begin(), faces.end(), 0);
  const NearestMembers nearest(variant, faces);
  int count = 0;
  for (const FaceId f : match.faces.ids()) {
    const EntityFeature& feature = base.features[f];
    const int alike = nearest.find(feature, feature.centre, 1, 1)[0].second;
    count += carries_parameters({}, base.model, f, variant.model, variant.graph.face(alike));
  }
  return count;
}

// Faces that have to pass through one alike on their way, as a hole does that jumps over others of
// its row. In a mirror image all do.
int passing(const MatchSide& base, const MatchSide& variant, const TopologyMatch& match) {
  if (is_mirror_image(base.model, variant.model, match)) return 0;
  struct Way {
    Vector3d from, by;
    double length, size;
  };
  std::vector<Way> ways;
  for (const FaceId f : match.faces.ids()) {
    const Vector3d from = match.alignment(base.features[f].centre);
    const Vector3d by = variant.features[match.faces[f]].centre - from;
    ways.push_back({from, by, by.norm(), base.features[f].size});
  }
  const double least = kCentroidRounding * variant.model.diagonal();
  int count = 0;
  for (const Way& a : ways)
    count += a.length > least && std::ranges::any_of(ways, [&](const Way& b) {
               if (b.length > a.length || std::abs(b.size - a.size) > kAlike * a.size) return false;
               const Vector3d apart = b.from - a.from, change = b.by - a.by;
               // Farther apart than three ways, two come no nearer than a third of that.
               if (apart.squaredNorm() > 9 * a.length * a.length || change.isZero(0)) return false;
               const double t = std::clamp(-apart.dot(change) / change.squaredNorm(), 0.0, 1.0);
               return (apart + t * change).norm() <
                      kThrough * std::min(apart.norm(), (apart + change).norm());
             });
  return count;
}

double log2_factorial(int n) { return std::lgamma(n + 1.0) / std::log(2.0); }

// Bits that the order of so many entities carries. Symmetry may double the chances that it fits
// many times over: half of the bits count.
double order_bits(const EntityGraph& graph, int count) {
  double bits = log2_factorial(graph.faces);
  if (count > graph.faces) bits += log2_factorial(graph.curves) + log2_factorial(graph.corners);
  return bits;
}

bool keeps_order(const IdVector<FaceId, FaceId>& faces) {
  for (const FaceId f : faces.ids())
    if (faces[f] != f) return false;
  return true;
}

// What the distances of entities from where their neighbours' motion, smoothed over some forty of
// them, would put them cost, on the mean: nothing for an affine change, little for a smooth one,
// much where entities are exchanged. Each counts for itself: of a root mean square the edge of
// what moves as a whole makes so much that an exchange within goes unseen.
double roughness(const MatchSide& base, const MatchSide& variant, const TopologyMatch& match) {
  const auto nodes = partners(base, match);
  const EntityMotion motion = motion_of(base, variant, match, kSmoothed);
  double sum = 0;
  for (std::size_t n = 0; n < nodes.size(); ++n) {
    const double distance =
        (motion(base.features[n].centre, static_cast<int>(n)) - variant.features[nodes[n]].centre)
            .norm() /
        variant.model.diagonal();
    sum += kRoughBits * (bits(distance, kRough) + distance / kJump);
  }
  return sum / static_cast<double>(nodes.size());
}

// Geometry alone tells equals apart: the lesser turn, then the lesser shift.
bool costs_less(const TopologyMatch& a, const TopologyMatch& b) {
  const auto key = [](const TopologyMatch& match) {
    return std::tuple(match.cost.sum(), match.cost.turn, match.alignment.translation.norm());
  };
  return key(a) < key(b);
}

// Congruent shapes (`is_exact`) don't deform, though the sampled centroids of their faces may
// differ; whether they turned is told by their parameters.
MatchCost cost_of(const MatchSide& base, const MatchSide& variant, const TopologyMatch& match,
                  bool is_exact) {
  const double agreement = is_exact ? parameter_agreement(base.model, variant.model, match) : 0;
  const double others =
      is_exact ? (1 - agreement) * base.graph.faces : other_forms(base, variant, match);
  const double distance = is_exact ? 0 : distance_after(base, variant, match, match.alignment);
  const double rough = is_exact ? 0 : roughness(base, variant, match);
  const double turned = turned_by(base, variant, match.alignment);
  const bool is_export = others == 0 && is_exact;
  const bool looks_turned = is_exact && !is_export;
  const bool is_evidence = is_order_evidence(base.graph, base.graph.entity_count());
  return {.deformation = bits(distance, kChange) + distance / kDesign,
          .neighbours = rough,
          .lengths = is_exact ? 0 : bits(stretch(base, variant, match), kStretch),
          .parameters = kParameterBits * bits(others, 1),
          .turn = is_export ? 0 : kTurnBits * bits(turned, kSmallTurn),
          .rest = looks_turned ? kRestBits * bits(turned_from_rest(base, variant, match), 1) : 0,
          .passing = is_exact ? 0 : kPassBits * bits(passing(base, variant, match), 1),
          .order = is_evidence && !keeps_order(match.faces) ? kOrder : 0};
}

}  // namespace

std::vector<int> partners(const MatchSide& base, const TopologyMatch& match) {
  std::vector<int> nodes(match.faces.begin(), match.faces.end());
  for (const CurveId c : match.curves) nodes.push_back(base.graph.curve_node(c));
  for (const CornerId c : match.corners) nodes.push_back(base.graph.corner_node(c));
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

double distance_after(const MatchSide& base, const MatchSide& variant, const TopologyMatch& match,
                      const Similarity& t) {
  double sum = 0;
  int count = 0;
  const auto add = [&](int b, int v) {
    const EntityFeature& feature = base.features[b];
    sum += squared_distance(feature, variant.features[v], t(feature.centre), t.scale);
    ++count;
  };
  for (const CurveId c : match.curves.ids())
    add(base.graph.curve_node(c), variant.graph.curve_node(match.curves[c]));
  for (const CornerId c : match.corners.ids())
    add(base.graph.corner_node(c), variant.graph.corner_node(match.corners[c]));
  if (base.graph.corners == 0)
    for (const FaceId f : match.faces.ids()) add(f, match.faces[f]);
  return std::sqrt(sum / count) / variant.model.diagonal();
}

bool is_order_evidence(const EntityGraph& graph, int count) {
  return order_bits(graph, count) >= kOrderBits;
}

bool fits_exactly(const TopologyMatch& match) {
  return match.cost.deformation < bits(kCentroidRounding, kChange);
}

void rate(const MatchSide& base, const MatchSide& variant, TopologyMatch& match) {
  align(base.model, variant.model, match);
  // Where most stands still, as a far field about a small body, it stands still.
  if (!match.is_congruent && distance_after(base, variant, match, {}) <
                                 kStill * distance_after(base, variant, match, match.alignment))
    match.alignment = {};
  match.cost = cost_of(base, variant, match, match.is_congruent);
  // Where the parameters did not move with a congruent shape, the design may have: what turns in a
  // ring of equals is the shape as before, turned.
  if (!match.is_congruent || match.cost.parameters == 0) return;
  TopologyMatch designed = match;
  designed.alignment = {};
  const MatchCost cost = cost_of(base, variant, designed, false);
  if (cost.sum() < match.cost.sum()) match.cost = cost;
}

std::optional<TopologyMatch> cheaper(std::optional<TopologyMatch> a,
                                     std::optional<TopologyMatch> b) {
  if (!a || (b && costs_less(*b, *a))) std::swap(a, b);
  if (!b || (a->faces == b->faces && a->curves == b->curves && a->corners == b->corners)) return a;
  std::optional<ConsideredMatch> beaten{{b->how, b->cost, b->faces}};
  if (a->faces == b->faces && a->joins_edges != b->joins_edges) beaten.reset();  // not another one
  for (const auto& other : {beaten, b->runner_up})
    if (other && (!a->runner_up || other->cost.sum() < a->runner_up->cost.sum()))
      a->runner_up = other;
  return a;
}

}  // namespace cadmorph
