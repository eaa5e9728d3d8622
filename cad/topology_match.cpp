#include "cad/topology_match.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <fstream>
#include <limits>
#include <map>
#include <numeric>
#include <optional>
#include <sstream>
#include <string_view>
#include <utility>

#include "cad/alignment.h"
#include "cad/match_choice.h"
#include "cad/match_cost.h"
#include "cad/match_refusal.h"
#include "cad/match_search.h"
#include "core/byte_order_mark.h"
#include "core/errors.h"
#include "core/remedies.h"

namespace cadmorph {
namespace {

// Half and double of the next two leave all known pairs as they are.
// A name that stays with its face is worth eight times as good a fit.
constexpr double kNameBits = 3;
// Of a match that ignores the joints of smooth curves: it has to fit twice as well as one for which
// they are corners.
constexpr double kJointBits = 1;
// Of the diagonal, and radians, off a plane: ten times what exchanged files keep.
constexpr double kInPlane = 1e-6;
// Confidence of a pair of a flat and a round face below which it is none: another face is less than
// four times as far. A chamfer in a fillet's place is nearer by far.
constexpr double kOfOtherKind = 0.8;
// Short edges that are looked through for slivers: 20 pairs of models to match at most.
constexpr std::size_t kMostSlivers = 6;

// Colours with the first `count` of the pairs given, or nothing where these can't be.
std::optional<ColourRefinement> with_given(ColourRefinement colours, const MatchOptions& options,
                                           std::size_t count) {
  for (std::size_t i = 0; i < count; ++i) {
    const auto& [b, v] = options.given_faces[i];
    colours.individualise(b - 1, v - 1);
  }
  if (count > 0 && !colours.refine()) return std::nullopt;
  return colours;
}

void apply_given(const MatchSide& base, const MatchSide& variant, const MatchOptions& options,
                 ColourRefinement& colours) {
  for (const auto& [b, v] : options.given_faces) {
    if (b < 1 || b > base.graph.faces || v < 1 || v > variant.graph.faces)
      throw InvalidInputError("face map: pair " + std::to_string(b) + "," + std::to_string(v) +
                              " is outside 1.." + std::to_string(base.graph.faces) + " and 1.." +
                              std::to_string(variant.graph.faces) + "; face numbers are those of " +
                              words_for(Remedy::ListPairs) + ".");
  }
  const std::size_t all = options.given_faces.size();
  if (auto given = with_given(colours, options, all)) {
    colours = std::move(*given);
    return;
  }
  std::size_t possible = 0, impossible = all;
  while (impossible - possible > 1) {
    const std::size_t middle = std::midpoint(possible, impossible);
    (with_given(colours, options, middle) ? possible : impossible) = middle;
  }
  const auto& [b, v] = options.given_faces[possible];
  throw TopologyError("face map: with pair " + std::to_string(b) + "," + std::to_string(v) +
                      (possible == 0 ? "" : " and those before it") +
                      " the pairs contradict how the faces of the two models are connected. "
                      "Check them against " +
                      words_for(Remedy::ListPairs) + ".");
}

using Names = std::vector<std::pair<std::string, FaceId>>;  // name and face

// Names that occur once, in the order of the file.
Names unique_names(const CadModel& model) {
  std::map<std::string, int> count;
  for (const CadFace& face : model.faces()) ++count[face.name];
  Names names;
  for (const FaceId f : model.faces().ids()) {
    const std::string& name = model.faces()[f].name;
    if (!name.empty() && name != "NONE" && count[name] == 1) names.emplace_back(name, f);
  }
  return names;
}

// Whether names are nothing but numbers that an exporter gave away in the order of the file.
bool is_numbered(const Names& names) {
  std::string prefix;
  long last = -1;
  for (std::size_t i = 0; i < names.size(); ++i) {
    const std::string& name = names[i].first;
    const auto digits = name.find_last_not_of("0123456789") + 1;
    if (digits == name.size() || name.size() - digits > 9) return false;
    if (i > 0 && name.compare(0, digits, prefix) != 0) return false;
    prefix = name.substr(0, digits);
    const long number = std::stol(name.substr(digits));
    if (number <= last) return false;
    last = number;
  }
  return !names.empty();
}

// Faces of one name: it occurs once in both files, and is no mere numbering.
std::vector<std::pair<FaceId, FaceId>> named_faces(const CadModel& base, const CadModel& variant) {
  const Names b = unique_names(base), v = unique_names(variant);
  std::vector<std::pair<FaceId, FaceId>> pairs;
  if (is_numbered(b) && is_numbered(v)) return pairs;
  const std::map<std::string, FaceId> face_of(v.begin(), v.end());
  for (const auto& [name, face] : b)
    if (const auto other = face_of.find(name); other != face_of.end())
      pairs.emplace_back(face, other->second);
  return pairs;
}

std::optional<TopologyMatch> decide(const MatchSide& base, const MatchSide& variant,
                                    const ColourRefinement& colours, const char* how) {
  std::optional<TopologyMatch> match;
  if (open_classes(colours, base.graph.entity_count()).empty()) {
    match = to_match(base, colours);
    match->how = how;
    rate(base, variant, *match);
  } else {
    match = match_by_position(base, variant, colours);
  }
  if (match) set_confidence(base, variant, colours, *match);
  return match;
}

// By names, where they don't contradict the adjacency, or by position, whichever costs less.
std::optional<TopologyMatch> best_match(const MatchSide& base, const MatchSide& variant,
                                        const MatchOptions& options) {
  ColourRefinement colours(base.graph, variant.graph);
  if (!colours.refine()) return std::nullopt;
  apply_given(base, variant, options, colours);
  ColourRefinement bulging = colours;
  bulging.hint(base.bulges, variant.bulges);
  if (bulging.refine()) colours = std::move(bulging);
  const char* how = options.given_faces.empty() ? "structure" : "map file";
  if (open_classes(colours, base.graph.entity_count()).empty())
    return decide(base, variant, colours, how);
  const auto named = named_faces(base.model, variant.model);
  ColourRefinement by_name = colours;
  for (const auto& [b, v] : named) by_name.individualise(b, v);
  std::optional<TopologyMatch> match;
  if (!named.empty() && by_name.refine()) match = decide(base, variant, by_name, "names");
  if (match && fits_exactly(*match)) return match;
  auto other = decide(base, variant, colours, how);
  if (other) {
    const auto renamed = std::ranges::count_if(
        named, [&](const auto& pair) { return other->faces[pair.first] != pair.second; });
    other->cost.names = kNameBits * std::log2(1 + static_cast<double>(renamed));
  }
  return cheaper(std::move(match), std::move(other));
}

// A feature that came and another one that went leave the counts as they were.
bool has_wrong_kinds(const CadModel& base, const CadModel& variant, const TopologyMatch& match) {
  const auto is_flat = [](SurfaceType type) { return type == SurfaceType::Plane; };
  const auto is_round = [](SurfaceType type) {
    using enum SurfaceType;
    return type == Cylinder || type == Sphere || type == Torus;
  };
  for (const FaceId face : base.faces().ids()) {
    const SurfaceType from = base.faces()[face].type, to = variant.faces()[match.faces[face]].type;
    const bool is_other = (is_flat(from) && is_round(to)) || (is_round(from) && is_flat(to));
    if (is_other && match.face_confidence[face] < kOfOtherKind) return true;
  }
  return false;
}

bool are_solid(const CadModel& model) {
  return std::ranges::all_of(model.faces(), [](const CadFace& face) { return face.solid >= 0; });
}

// The normal of a plane that all of a model lies in; zero where there is none.
Eigen::Vector3d normal_of_plane(const CadModel& model) {
  if (model.faces().empty()) return Eigen::Vector3d::Zero();
  const auto normal = [&](FaceId face) {
    return model.normal(face, (model.faces()[face].lower + model.faces()[face].upper) / 2);
  };
  const Eigen::Vector3d first = normal(FaceId(0));
  const double tolerance = kInPlane * model.diagonal();
  for (const FaceId f : model.faces().ids())
    if (model.faces()[f].type != SurfaceType::Plane || normal(f).cross(first).norm() > kInPlane)
      return Eigen::Vector3d::Zero();
  for (const CadVertex& vertex : model.vertices())
    if (std::abs((vertex.point - model.vertices().front().point).dot(first)) > tolerance)
      return Eigen::Vector3d::Zero();
  return first;
}

// Oriented first. Shells that are no solids have no outside: one exporter's normals are the other
// way round than another's, so they match as they cost less. Sheets in one plane are seen from one
// side: turned over, all elements of a mesh would be, too. One exporter writes solids, another
// their shells alone: solids count where both models have as many.
std::optional<TopologyMatch> match_skeletons(const CadModel& base, const CadModel& variant,
                                             const MatchOptions& options) {
  const bool has_solids = base.solid_count() == variant.solid_count();
  const bool are_solids = are_solid(base) && are_solid(variant);
  Eigen::Vector3d plane = normal_of_plane(base);
  const Eigen::Vector3d of_variant = normal_of_plane(variant);
  if (of_variant.isZero(0) || plane.cross(of_variant).norm() > kInPlane) plane.setZero();
  std::optional<TopologyMatch> best;
  for (const bool is_oriented : {true, false}) {
    const GraphOptions graph{
        .is_oriented = is_oriented, .seen_along = plane, .has_solids = has_solids};
    const MatchSide b = make_match_side(base, graph), v = make_match_side(variant, graph);
    if (b.graph.faces != v.graph.faces || b.graph.curves != v.graph.curves ||
        b.graph.corners != v.graph.corners)
      return std::nullopt;
    auto match = best_match(b, v, options);
    if (match && (!options.given_faces.empty() || !has_wrong_kinds(base, variant, *match))) {
      match->is_oriented = is_oriented && are_solids;
      best = cheaper(std::move(best), std::move(match));
    }
    if (best && (are_solids || !plane.isZero(0))) break;
  }
  return best;
}

// A match without joints: what that costs, also its runner-up.
void add_cost_of_joining(TopologyMatch& joined, double parameters) {
  const auto add = [&](MatchCost& cost) {
    cost.joints += kJointBits;
    cost.parameters = std::max(cost.parameters, parameters);
  };
  add(joined.cost);
  if (joined.runner_up) add(joined.runner_up->cost);
}

// Joints of smooth curves are corners while that makes sense. One exporter cuts a circle at its
// seam, another at the old seam and at its own: then joints can't be matched, or move where nothing
// else does. A shape that lies where it lay does not move, whatever its joints and parameters say.
std::optional<TopologyMatch> find_match(const CadModel& base, const CadModel& variant,
                                        const MatchOptions& options) {
  auto cut = match_skeletons(base, variant, options);
  const CadModel joined_base = base.with_joined_edges();
  if (cut && joined_base.skeleton().corners.size() == base.skeleton().corners.size()) return cut;
  auto joined = match_skeletons(joined_base, variant.with_joined_edges(), options);
  if (joined) {
    joined->joins_edges = true;
    // There are fewer edges whose parameters may be others.
    add_cost_of_joining(*joined, cut ? cut->cost.parameters : 0);
    if (stays(*joined) && !(cut && stays(*cut))) return joined;
  }
  return cheaper(std::move(cut), std::move(joined));
}

// A seam cuts a bore with a keyway in two faces, another export's seam elsewhere: then the edge
// between them can be matched, but is no place of the part. Without this 19 known pairs come out
// wrong, most of them split rings and keyed hubs.
std::optional<MatchedModels> match_across_seams(const CadModel& base, const CadModel& variant,
                                                const std::optional<TopologyMatch>& cut) {
  const auto b = base.with_merged_faces(FaceMerge::AcrossSeams);
  const auto v = variant.with_merged_faces(FaceMerge::AcrossSeams);
  if (!b || !v) return std::nullopt;
  auto merged = find_match(*b, *v, {});
  if (!merged) return std::nullopt;
  add_cost_of_joining(*merged, 0);
  if (cut && !stays(*merged) && merged->cost.sum() >= cut->cost.sum()) return std::nullopt;
  return MatchedModels{*b, *v, std::move(*merged)};
}

// Slivers of the variant that the base does not have: its mesh has no nodes on them. Those of the
// base have. Of the shortest edges, which the base may have, too, those that leave the best match.
std::optional<MatchedModels> match_without_slivers(const CadModel& base, const CadModel& variant) {
  const auto more = std::ssize(variant.skeleton().curves) - std::ssize(base.skeleton().curves);
  std::vector<EdgeId> edges = variant.short_edges();
  if (edges.size() > kMostSlivers) edges.resize(kMostSlivers);
  if (more <= 0 || more > std::ssize(edges) || base.faces().size() != variant.faces().size())
    return std::nullopt;
  std::vector<char> is_point(edges.size(), 0);
  std::fill_n(is_point.begin(), more, 1);
  std::optional<MatchedModels> best;
  do {
    std::vector<EdgeId> points;
    for (std::size_t i = 0; i < edges.size(); ++i)
      if (is_point[i]) points.push_back(edges[i]);
    const CadModel without = variant.with_points_for(points);
    auto match = find_match(base, without, {});
    if (match && (!best || match->cost.sum() < best->match.cost.sum()))
      best = {base, without, std::move(*match)};
  } while (std::ranges::prev_permutation(is_point).found);
  return best;
}

// In the base the angle of a joint of smooth curves tells whether it is a corner. In the variant
// the sharpest joints are corners: as many as the base has.
std::optional<MatchedModels> match_other_angles(const CadModel& base, const CadModel& variant,
                                                const MatchOptions& options) {
  const std::size_t corners = base.skeleton().corners.size();
  if (corners == variant.skeleton().corners.size()) return std::nullopt;
  const CadModel other = variant.with_corners(corners);
  auto match = match_skeletons(base, other, options);
  if (!match) return std::nullopt;
  return MatchedModels{base, other, std::move(*match)};
}

MatchedModels find_models(const CadModel& base, const CadModel& variant,
                          const MatchOptions& options) {
  auto match = find_match(base, variant, options);
  if (!match)
    if (auto found = match_other_angles(base, variant, options)) return std::move(*found);
  if (!options.given_faces.empty()) {
    if (match) return {base, variant, std::move(*match)};
  } else {
    if (match && stays(*match)) return {base, variant, std::move(*match)};
    if (auto merged = match_across_seams(base, variant, match)) return std::move(*merged);
    if (match) return {base, variant, std::move(*match)};
    const auto merged_base = base.with_merged_faces(), merged_variant = variant.with_merged_faces();
    std::vector<std::pair<const CadModel*, const CadModel*>> pairs;
    if (merged_variant) pairs.push_back({&base, &*merged_variant});
    if (merged_base) pairs.push_back({&*merged_base, &variant});
    if (merged_base && merged_variant) pairs.push_back({&*merged_base, &*merged_variant});
    for (const auto& [b, v] : pairs)
      if (auto found = find_match(*b, *v, options)) return {*b, *v, std::move(*found)};
    if (auto found = match_without_slivers(base, variant)) return std::move(*found);
  }
  refuse_match(make_match_side(base, {}), make_match_side(variant, {}));
}

// A program that turned all surfaces into B-splines keeps no angles, nor maybe lengths: nodes would
// slide.
void use_analytic_faces(MatchedModels& models) {
  std::vector<FaceId> faces;
  for (const FaceId face : models.base.faces().ids()) {
    using enum SurfaceType;
    const SurfaceType type = models.base.faces()[face].type;
    const FaceId image = models.match.faces[face];
    if ((type == Plane || type == Cylinder || type == Cone || type == Sphere) &&
        models.variant.faces()[image].type == BSpline)
      faces.push_back(image);
  }
  if (faces.empty()) return;
  const std::size_t corners = models.variant.skeleton().corners.size();
  if (auto analytic = models.variant.with_analytic_faces(faces))
    models.variant = analytic->skeleton().corners.size() == corners
                         ? std::move(*analytic)
                         : analytic->with_corners(corners);
}

}  // namespace

double lead(const TopologyMatch& match) {
  return match.runner_up ? match.runner_up->cost.sum() - match.cost.sum()
                         : std::numeric_limits<double>::infinity();
}

std::string paired_otherwise(const TopologyMatch& match) {
  constexpr int kMost = 10;
  std::string numbers;
  int count = 0;
  for (const FaceId f : match.runner_up->faces.ids()) {
    if (match.runner_up->faces[f] == match.faces[f] || ++count > kMost) continue;
    numbers += (count > 1 ? ", " : " ") + std::to_string(f + 1);
  }
  if (count == 0) return {};
  if (count > kMost) numbers += " and " + std::to_string(count - kMost) + " more";
  return (count == 1 ? "face" : "faces") + numbers;
}

TopologyMatch match_topology(const CadModel& base, const CadModel& variant,
                             const MatchOptions& options) {
  if (auto match = find_match(base, variant, options)) return std::move(*match);
  refuse_match(make_match_side(base, {}), make_match_side(variant, {}));
}

MatchedModels match_models(const CadModel& base, const CadModel& variant,
                           const MatchOptions& options) {
  MatchedModels models = find_models(base, variant, options);
  use_analytic_faces(models);
  return models;
}

std::vector<std::pair<int, int>> read_face_map(const std::filesystem::path& path) {
  std::ifstream in(path);
  if (!in) throw IoError(path.string() + ": the face map can't be opened. Check the path.");
  std::vector<std::pair<int, int>> pairs;
  std::string line;
  for (int number = 1; std::getline(in, line); ++number) {
    if (number == 1) line.erase(0, byte_order_mark_size(line));
    line = line.substr(0, line.find('#'));
    std::replace(line.begin(), line.end(), ',', ' ');
    std::istringstream fields(line);
    int base = 0, variant = 0;
    std::string rest;
    if (fields >> base >> variant && !(fields >> rest)) {
      pairs.emplace_back(base, variant);
      continue;
    }
    const auto start = line.find_first_not_of(" \t\r");
    if (start == std::string::npos) continue;
    const bool is_header = number == 1 &&
                           std::isdigit(static_cast<unsigned char>(line[start])) == 0 &&
                           line.find_first_of("0123456789") == std::string::npos;
    if (!is_header)
      throw InvalidInputError(path.string() + ":" + std::to_string(number) +
                              ": expected two face numbers 'base,variant'.");
  }
  if (pairs.empty())
    throw InvalidInputError(path.string() +
                            ": holds no pair of face numbers; give lines 'base,variant'.");
  return pairs;
}

}  // namespace cadmorph
