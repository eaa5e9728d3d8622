#include "cad/match_refusal.h"

#include <algorithm>
#include <array>
#include <limits>
#include <numeric>
#include <sstream>

#include "cad/match_search.h"
#include "cad/motion_guess.h"
#include "core/errors.h"

namespace cadmorph {
namespace {

constexpr int kMaxNamed = 6;        // more lines hide the message
constexpr int kMostPartners = 500;  // all of a part that is not large

std::string list(const std::vector<std::string>& items) {
  std::string text;
  for (std::size_t i = 0; i < items.size() && i < kMaxNamed; ++i)
    text += (i ? "; " : "") + items[i];
  if (items.size() > kMaxNamed)
    text += "; and " + std::to_string(items.size() - kMaxNamed) + " more";
  return text;
}

// Entities, of the base and of the variant.
struct Leftovers {
  std::vector<int> base, variant;
};

// Entities [begin, end) of one kind left over by greedy pairing, nearest first. With colours only
// entities of the same pair.
Leftovers leftovers(const MatchSide& base, const MatchSide& variant, const Similarity& t,
                    std::array<int, 2> b, std::array<int, 2> v,
                    const ColourRefinement* colours = nullptr) {
  struct Pair {
    double distance;
    int base, variant;
  };
  std::vector<Pair> pairs;
  std::vector<int> members(static_cast<std::size_t>(v[1] - v[0]));
  std::iota(members.begin(), members.end(), v[0]);
  const NearestMembers nearest(variant, members);
  const int count = std::min<int>(static_cast<int>(members.size()), kMostPartners);
  for (int i = b[0]; i < b[1]; ++i) {
    const Eigen::Vector3d at = t(base.features[i].centre);
    for (const auto& [distance, j] : nearest.find(base.features[i], at, t.scale, count))
      if (!colours || colours->base_colours()[i] == colours->variant_colours()[j])
        pairs.push_back({distance, i, j});
  }
  std::sort(pairs.begin(), pairs.end(),
            [](const Pair& x, const Pair& y) { return x.distance < y.distance; });
  std::vector<char> is_paired_base(base.features.size()),
      is_paired_variant(variant.features.size());
  for (const Pair& p : pairs)
    if (!is_paired_base[p.base] && !is_paired_variant[p.variant])
      is_paired_base[p.base] = is_paired_variant[p.variant] = 1;
  Leftovers result;
  for (int i = b[0]; i < b[1]; ++i)
    if (!is_paired_base[i]) result.base.push_back(i);
  for (int j = v[0]; j < v[1]; ++j)
    if (!is_paired_variant[j]) result.variant.push_back(j);
  return result;
}

std::vector<std::string> names(const MatchSide& base, const MatchSide& variant,
                               const Leftovers& left) {
  std::vector<std::string> result;
  for (const int i : left.base) result.push_back("base " + describe(base, i));
  for (const int j : left.variant) result.push_back("variant " + describe(variant, j));
  return result;
}

// Of faces, edges and vertices, the first that are not as many.
std::vector<std::string> without_partner(const MatchSide& base, const MatchSide& variant,
                                         const Similarity& t) {
  int b = 0, v = 0;
  for (const auto& [of_base, of_variant] :
       {std::array{base.graph.faces, variant.graph.faces},
        std::array{base.graph.curves, variant.graph.curves},
        std::array{base.graph.corners, variant.graph.corners}}) {
    if (of_base != of_variant)
      return names(base, variant,
                   leftovers(base, variant, t, {b, b + of_base}, {v, v + of_variant}));
    b += of_base;
    v += of_variant;
  }
  return {};
}

// How many edges bound a face, seams not counted.
int edge_count(const EntityGraph& graph, int face) {
  return static_cast<int>(graph.arcs[face].size());
}

// The faces that have other edges than any left of the other part, where the counts agree: those
// where the first difference shows when one goes from each face to its neighbours.
std::vector<std::string> connected_otherwise(const MatchSide& base, const MatchSide& variant,
                                             const Similarity& t) {
  const GraphOptions plain{.is_oriented = false, .has_solids = false};
  const EntityGraph b = build_graph(base.model, plain), v = build_graph(variant.model, plain);
  ColourRefinement colours(b, v);
  if (colours.refine()) return {};
  const Leftovers left = leftovers(base, variant, t, {0, b.faces}, {0, v.faces}, &colours);
  std::vector<std::string> result;
  const auto add = [&](const char* whose, const MatchSide& side, const EntityGraph& graph,
                       const std::vector<int>& faces) {
    for (const int face : faces)
      result.push_back(whose + describe(side, face) + " with " +
                       std::to_string(edge_count(graph, face)) + " edges");
  };
  add("base ", base, b, left.base);
  add("variant ", variant, v, left.variant);
  return result;
}

// A solid of a part: its faces' mean centroid and their number.
struct Body {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  int faces = 0;
};

std::vector<Body> bodies_of(const MatchSide& side) {
  std::vector<Body> bodies(static_cast<std::size_t>(side.model.solid_count()));
  for (const FaceId f : side.model.faces().ids())
    for (const int solid : {side.model.faces()[f].solid, side.model.faces()[f].other_solid}) {
      if (solid < 0) continue;
      bodies[solid].centre += side.features[f].centre;
      ++bodies[solid].faces;
    }
  for (Body& body : bodies) body.centre /= std::max(body.faces, 1);
  return bodies;
}

// The solids that one part has more than the other: those farthest from any of the other's.
std::vector<std::string> leftover_bodies(const MatchSide& base, const MatchSide& variant,
                                         const Similarity& t) {
  const std::vector<Body> b = bodies_of(base), v = bodies_of(variant);
  const bool is_of_base = b.size() > v.size();
  const std::vector<Body>&more = is_of_base ? b : v, &less = is_of_base ? v : b;
  const auto place = [&](const Body& body, bool of_base) {
    return of_base ? t(body.centre) : body.centre;
  };
  std::vector<std::pair<double, std::size_t>> alone;  // distance from the nearest, and which
  for (std::size_t i = 0; i < more.size(); ++i) {
    double nearest = std::numeric_limits<double>::infinity();
    for (const Body& other : less)
      nearest = std::min(nearest, (place(other, !is_of_base) - place(more[i], is_of_base)).norm());
    alone.emplace_back(-nearest, i);
  }
  std::ranges::sort(alone);
  std::vector<std::string> result;
  for (std::size_t k = 0; k < more.size() - less.size(); ++k) {
    const Body& body = more[alone[k].second];
    std::ostringstream text;
    text.precision(4);
    text << (is_of_base ? "base" : "variant") << " solid " << alone[k].second + 1 << " ("
         << body.faces << " faces, about " << body.centre.x() << ' ' << body.centre.y() << ' '
         << body.centre.z() << " mm)";
    result.push_back(text.str());
  }
  return result;
}

// Physical edges with a face on one side alone.
int open_edges(const CadModel& model) {
  const auto& curves = model.skeleton().curves;
  return static_cast<int>(std::count_if(
      curves.begin(), curves.end(), [](const CadCurve& curve) { return curve.faces.size() == 1; }));
}

// What to do about it.
std::string remedy(const MatchSide& base, const MatchSide& variant) {
  const int b = open_edges(base.model), v = open_edges(variant.model);
  if ((b == 0) == (v == 0))
    return "A feature was added, removed or split; use a variant with the same topology, "
           "written by the same program with the same settings (some cut closed faces in two).";
  const bool is_base = b > 0;
  return std::string("The faces of the ") + (is_base ? "base" : "variant") +
         " are not joined along " + std::to_string(is_base ? b : v) +
         " edges: sew them, or export a solid.";
}

}  // namespace

void refuse_match(const MatchSide& base, const MatchSide& variant) {
  const EntityGraph &b = base.graph, &v = variant.graph;
  const Similarity t = (base.model.lower() - variant.model.lower()).norm() +
                                   (base.model.upper() - variant.model.upper()).norm() <
                               0.1 * base.model.diagonal()
                           ? Similarity{}
                           : align_bounds(base.model, variant.model);
  const int b_solids = base.model.solid_count(), v_solids = variant.model.solid_count();
  std::vector<std::string> lost;
  if (b_solids != v_solids && std::min(b_solids, v_solids) > 0)
    lost = leftover_bodies(base, variant, t);
  if (lost.empty()) lost = without_partner(base, variant, t);
  const std::vector<std::string> other =
      lost.empty() ? connected_otherwise(base, variant, t) : std::vector<std::string>();
  std::ostringstream text;
  text << variant.model.file_name() << " does not correspond to " << base.model.file_name()
       << ": base has " << b_solids << " solids, " << b.faces << " faces, " << b.curves
       << " edges, " << b.corners << " vertices, variant " << v_solids << ", " << v.faces << ", "
       << v.curves << ", " << v.corners << " (seams not counted). "
       << (!lost.empty() ? "Without a partner: " + list(lost)
           : other.empty()
               ? "The counts agree but the faces are connected differently, or are of other kinds"
               : "The counts agree but faces are connected differently: " + list(other))
       << ". " << remedy(base, variant);
  throw TopologyError(text.str());
}

}  // namespace cadmorph
