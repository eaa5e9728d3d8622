#include "cad/topology_match.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <limits>
#include <map>
#include <numeric>
#include <sstream>

#include "cad/alignment.h"
#include "cad/entity_graph.h"
#include "core/errors.h"

namespace cadmorph {
namespace {

using Eigen::Vector3d;

// A nearest candidate is taken with others of its class at once when it is this much nearer than
// the second nearest.
constexpr double kClearMargin = 0.5;
constexpr const char* kFileOrder = "file order, verified";
constexpr const char* kTurned = "position after a turn";
constexpr int kMaxTries = 12;
// Refinements that one alignment may cost, and that one may where a match is known already.
constexpr int kMostRefinements = 2000, kFewRefinements = 60;
constexpr int kMaxNamed = 6;
// Matches whose distances differ by less than this part of the diagonal, or this factor, are
// equally good: symmetric parts have many.
constexpr double kTie = 1e-5;
constexpr double kSlack = 1.02;
constexpr double kFarBetter = 0.3;
// A large change of shape blurs distances: neighbours that swap may seem nearer than the truth.
constexpr double kFileOrderSlack = 2;
constexpr double kHardlyTurned = 1e-3;  // radians

struct Side {
  const CadModel& model;
  EntityGraph graph;
  std::vector<EntityFeature> features;
};

std::string describe(const Side& side, int node) {
  std::ostringstream text;
  text.precision(4);
  const Vector3d& c = side.features[node].centre;
  if (node < side.graph.faces) {
    text << "face " << node + 1 << " (" << to_string(side.model.faces()[node].type);
    if (!side.model.faces()[node].name.empty())
      text << " '" << side.model.faces()[node].name << "'";
  } else if (node < side.graph.faces + side.graph.curves) {
    text << "edge " << node - side.graph.faces + 1 << " (length " << side.features[node].size
         << " mm";
  } else {
    text << "vertex " << node - side.graph.faces - side.graph.curves + 1 << " (point";
  }
  text << " at " << c.x() << ' ' << c.y() << ' ' << c.z() << ')';
  return text.str();
}

struct Candidate {
  Similarity alignment;
  std::string how;
};

double squared_distance(const EntityFeature& b, const EntityFeature& v, const Similarity& t) {
  const double size = t.scale * b.size - v.size;
  return (t(b.centre) - v.centre).squaredNorm() + size * size;
}

// Nodes of one colour that is not yet decided.
struct ColourClass {
  std::vector<int> base, variant;
};

std::vector<ColourClass> open_classes(const ColourRefinement& colours, int entities) {
  std::map<int, ColourClass> classes;
  for (int n = 0; n < entities; ++n) {
    classes[colours.base_colours()[n]].base.push_back(n);
    classes[colours.variant_colours()[n]].variant.push_back(n);
  }
  std::vector<ColourClass> open;
  for (auto& [colour, members] : classes)
    if (members.base.size() > 1) open.push_back(std::move(members));
  return open;
}

struct Ranked {
  int base = -1;
  std::vector<std::pair<double, int>> candidates;  // squared distance, variant node; nearest first
  double margin() const {
    return candidates.size() < 2 ? 1e300 : candidates[1].first - candidates[0].first;
  }
  bool is_clear() const {
    return candidates.size() < 2 ||
           candidates[0].first < kClearMargin * kClearMargin * candidates[1].first;
  }
};

class Matcher {
 public:
  Matcher(const Side& base, const Side& variant, const Similarity& alignment, int most_refinements)
      : base_(base),
        variant_(variant),
        alignment_(alignment),
        most_refinements_(most_refinements) {}

  // Decides every entity by closeness, consistently with the adjacency. False when it gets stuck or
  // has to refine too often, as a wrong alignment makes it.
  bool solve(ColourRefinement& colours, std::vector<double>& confidence) {
    for (;;) {
      const auto open = open_classes(colours, base_.graph.entity_count());
      if (open.empty()) return true;
      if (refinements_ >= most_refinements_ || (!decide_clear_classes(open, colours, confidence) &&
                                                !decide_one(open, colours, confidence)))
        return false;
    }
  }

 private:
  Ranked rank(int base, const std::vector<int>& variant) const {
    Ranked ranked{base, {}};
    for (const int v : variant)
      ranked.candidates.emplace_back(
          squared_distance(base_.features[base], variant_.features[v], alignment_), v);
    const auto keep = std::min<std::size_t>(ranked.candidates.size(), kMaxTries);
    std::partial_sort(ranked.candidates.begin(),
                      ranked.candidates.begin() + static_cast<std::ptrdiff_t>(keep),
                      ranked.candidates.end());
    ranked.candidates.resize(keep);
    return ranked;
  }

  // Pairs of a class whose members all have a clear, different nearest candidate; else nothing.
  std::vector<Ranked> clear_pairs(const ColourClass& members) const {
    std::vector<Ranked> ranks;
    std::vector<int> taken;
    for (const int b : members.base) {
      ranks.push_back(rank(b, members.variant));
      if (!ranks.back().is_clear()) return {};
      taken.push_back(ranks.back().candidates[0].second);
    }
    std::sort(taken.begin(), taken.end());
    taken.erase(std::unique(taken.begin(), taken.end()), taken.end());
    return taken.size() == members.base.size() ? ranks : std::vector<Ranked>{};
  }

  bool try_pairs(const std::vector<Ranked>& pairs, ColourRefinement& colours,
                 std::vector<double>& confidence) {
    ColourRefinement trial = colours;
    for (const Ranked& r : pairs) trial.individualise(r.base, r.candidates[0].second);
    ++refinements_;
    if (!trial.refine()) return false;
    for (const Ranked& r : pairs) confidence[r.base] = confidence_of(r);
    colours = std::move(trial);
    return true;
  }

  // All clear classes at once; where they contradict each other, the first that stands alone.
  bool decide_clear_classes(const std::vector<ColourClass>& open, ColourRefinement& colours,
                            std::vector<double>& confidence) {
    std::vector<std::vector<Ranked>> clear;
    std::vector<Ranked> all;
    for (const ColourClass& members : open) {
      auto pairs = clear_pairs(members);
      if (pairs.empty()) continue;
      all.insert(all.end(), pairs.begin(), pairs.end());
      clear.push_back(std::move(pairs));
    }
    if (all.empty()) return false;
    if (try_pairs(all, colours, confidence)) return true;
    return std::any_of(clear.begin(), clear.end(), [&](const std::vector<Ranked>& pairs) {
      return refinements_ < most_refinements_ && try_pairs(pairs, colours, confidence);
    });
  }

  bool decide_one(const std::vector<ColourClass>& open, ColourRefinement& colours,
                  std::vector<double>& confidence) {
    Ranked best;
    for (const ColourClass& members : open)
      for (const int b : members.base) {
        Ranked r = rank(b, members.variant);
        if (best.base < 0 || r.margin() > best.margin()) best = std::move(r);
      }
    for (const auto& [distance, v] : best.candidates) {
      ColourRefinement trial = colours;
      trial.individualise(best.base, v);
      ++refinements_;
      if (!trial.refine()) continue;
      confidence[best.base] = confidence_of(best);
      colours = std::move(trial);
      return true;
    }
    return false;
  }

  static double confidence_of(const Ranked& r) {
    if (r.candidates.size() < 2 || r.candidates[1].first <= 0) return 0.5;
    return std::clamp(1 - 0.5 * std::sqrt(r.candidates[0].first / r.candidates[1].first), 0.5, 1.0);
  }

  const Side& base_;
  const Side& variant_;
  Similarity alignment_;
  int most_refinements_;
  int refinements_ = 0;
};

TopologyMatch to_match(const Side& base, const ColourRefinement& colours,
                       const std::vector<double>& confidence) {
  std::map<int, int> variant_of;
  const int entities = base.graph.entity_count();
  for (int n = 0; n < entities; ++n) variant_of[colours.variant_colours()[n]] = n;
  TopologyMatch match;
  for (int n = 0; n < entities; ++n) {
    const int v = variant_of.at(colours.base_colours()[n]);
    if (n < base.graph.faces) {
      match.faces.push_back(v);
      match.face_confidence.push_back(confidence[n]);
    } else if (n < base.graph.faces + base.graph.curves) {
      match.curves.push_back(v - base.graph.faces);
    } else {
      match.corners.push_back(v - base.graph.faces - base.graph.curves);
    }
  }
  return match;
}

// Root mean square distance of corners and curves, in variant diagonals; of faces, too, where there
// are no corners. Face centroids depend a little on the parametrisation.
double quality(const Side& base, const Side& variant, const TopologyMatch& match,
               const Similarity& t) {
  double sum = 0;
  int count = 0;
  const auto add = [&](int b, int v) {
    sum += squared_distance(base.features[b], variant.features[v], t);
    ++count;
  };
  for (int c = 0; c < base.graph.curves; ++c)
    add(base.graph.curve_node(c), variant.graph.curve_node(match.curves[c]));
  for (int c = 0; c < base.graph.corners; ++c)
    add(base.graph.corner_node(c), variant.graph.corner_node(match.corners[c]));
  for (int f = 0; f < base.graph.faces && base.graph.corners == 0; ++f) add(f, match.faces[f]);
  return std::sqrt(sum / count) / variant.model.diagonal();
}

Similarity by_bounds(const CadModel& base, const CadModel& variant) {
  Similarity s;
  s.scale = variant.diagonal() / base.diagonal();
  s.translation =
      0.5 * (variant.lower() + variant.upper()) - s.scale * 0.5 * (base.lower() + base.upper());
  return s;
}

// Alignment by the entities that the topology alone decides.
std::optional<Similarity> by_unique_entities(const Side& base, const Side& variant,
                                             const ColourRefinement& colours) {
  std::map<int, std::vector<int>> b, v;
  for (int n = 0; n < base.graph.entity_count(); ++n) {
    b[colours.base_colours()[n]].push_back(n);
    v[colours.variant_colours()[n]].push_back(n);
  }
  std::vector<Vector3d> from, to;
  for (const auto& [colour, nodes] : b) {
    // A class with several members still has one centroid.
    Vector3d x = Vector3d::Zero(), y = Vector3d::Zero();
    for (const int n : nodes) x += base.features[n].centre / static_cast<double>(nodes.size());
    for (const int n : v[colour])
      y += variant.features[n].centre / static_cast<double>(nodes.size());
    from.push_back(x);
    to.push_back(y);
  }
  if (from.size() < 3) return std::nullopt;
  return fit_similarity(from, to);
}

Eigen::Matrix3d principal_axes(const Side& side, Vector3d& mean) {
  mean.setZero();
  double weight = 0;
  for (const auto& f : side.features) {
    mean += (f.size + 1e-12) * f.centre;
    weight += f.size + 1e-12;
  }
  mean /= weight;
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  for (const auto& f : side.features)
    scatter += (f.size + 1e-12) * (f.centre - mean) * (f.centre - mean).transpose();
  Eigen::Matrix3d axes = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(scatter).eigenvectors();
  if (axes.determinant() < 0) axes.col(2) *= -1;
  return axes;
}

// The four proper rotations that carry principal axes onto each other.
std::vector<Similarity> by_principal_axes(const Side& base, const Side& variant) {
  Vector3d a, b;
  const Eigen::Matrix3d from = principal_axes(base, a), to = principal_axes(variant, b);
  std::vector<Similarity> all;
  for (const auto& signs :
       {Vector3d(1, 1, 1), Vector3d(1, -1, -1), Vector3d(-1, 1, -1), Vector3d(-1, -1, 1)}) {
    Similarity s;
    s.rotation = to * signs.asDiagonal() * from.transpose();
    s.scale = variant.model.diagonal() / base.model.diagonal();
    s.translation = b - s.scale * (s.rotation * a);
    all.push_back(s);
  }
  return all;
}

std::vector<Candidate> candidate_alignments(const Side& base, const Side& variant,
                                            const ColourRefinement& colours) {
  std::vector<Candidate> all{{{}, "position"}};
  all.push_back({by_bounds(base.model, variant.model), "position"});
  if (const auto unique = by_unique_entities(base, variant, colours))
    all.push_back({*unique, kTurned});
  for (const auto& s : by_principal_axes(base, variant)) all.push_back({s, kTurned});
  return all;
}

std::string list(const std::vector<std::string>& items) {
  std::string text;
  for (std::size_t i = 0; i < items.size() && i < kMaxNamed; ++i)
    text += (i ? "; " : "") + items[i];
  if (items.size() > kMaxNamed)
    text += "; and " + std::to_string(items.size() - kMaxNamed) + " more";
  return text;
}

// Entities [begin, end) of one kind left over by greedy pairing, nearest first.
void leftovers(const Side& base, const Side& variant, const Similarity& t, std::array<int, 2> b,
               std::array<int, 2> v, std::vector<std::string>& unpaired_base,
               std::vector<std::string>& unpaired_variant) {
  struct Pair {
    double distance;
    int base, variant;
  };
  std::vector<Pair> pairs;
  for (int i = b[0]; i < b[1]; ++i)
    for (int j = v[0]; j < v[1]; ++j)
      pairs.push_back({squared_distance(base.features[i], variant.features[j], t), i, j});
  std::sort(pairs.begin(), pairs.end(),
            [](const Pair& x, const Pair& y) { return x.distance < y.distance; });
  std::vector<char> is_paired_base(base.features.size()),
      is_paired_variant(variant.features.size());
  for (const Pair& p : pairs)
    if (!is_paired_base[p.base] && !is_paired_variant[p.variant])
      is_paired_base[p.base] = is_paired_variant[p.variant] = 1;
  for (int i = b[0]; i < b[1]; ++i)
    if (!is_paired_base[i]) unpaired_base.push_back("base " + describe(base, i));
  for (int j = v[0]; j < v[1]; ++j)
    if (!is_paired_variant[j]) unpaired_variant.push_back("variant " + describe(variant, j));
}

[[noreturn]] void refuse(const Side& base, const Side& variant) {
  const EntityGraph &b = base.graph, &v = variant.graph;
  std::vector<std::string> lost, added;
  const Similarity t = (base.model.lower() - variant.model.lower()).norm() +
                                   (base.model.upper() - variant.model.upper()).norm() <
                               0.1 * base.model.diagonal()
                           ? Similarity{}
                           : by_bounds(base.model, variant.model);
  leftovers(base, variant, t, {0, b.faces}, {0, v.faces}, lost, added);
  if (lost.empty() && added.empty())
    leftovers(base, variant, t, {b.faces, b.faces + b.curves}, {v.faces, v.faces + v.curves}, lost,
              added);
  if (lost.empty() && added.empty())
    leftovers(base, variant, t, {b.faces + b.curves, b.entity_count()},
              {v.faces + v.curves, v.entity_count()}, lost, added);
  lost.insert(lost.end(), added.begin(), added.end());
  std::ostringstream text;
  text << variant.model.file_name() << " does not correspond to " << base.model.file_name()
       << ": base has " << b.faces << " faces, " << b.curves << " edges, " << b.corners
       << " vertices, variant " << v.faces << ", " << v.curves << ", " << v.corners
       << " (seams not counted). "
       << (lost.empty() ? "The counts agree but the faces are connected differently"
                        : "Without a partner: " + list(lost))
       << ". A feature was added, removed or split; use a variant with the same topology.";
  throw TopologyError(text.str());
}

void apply_given(const Side& base, const Side& variant, const MatchOptions& options,
                 ColourRefinement& colours) {
  for (const auto& [b, v] : options.given_faces) {
    if (b < 1 || b > base.graph.faces || v < 1 || v > variant.graph.faces)
      throw InvalidInputError("face map: pair " + std::to_string(b) + "," + std::to_string(v) +
                              " is outside 1.." + std::to_string(base.graph.faces) + " and 1.." +
                              std::to_string(variant.graph.faces) +
                              "; face numbers are those that 'cadmorph match' prints.");
    colours.individualise(b - 1, v - 1);
  }
  if (!options.given_faces.empty() && !colours.refine())
    throw TopologyError(
        "face map: the given pairs contradict the adjacency of the two models. "
        "Check them against 'cadmorph match'.");
}

// Names are a hint: they count where unique in both files and consistent with the adjacency.
void apply_names(const Side& base, const Side& variant, ColourRefinement& colours) {
  const auto unique_names = [](const CadModel& model) {
    std::map<std::string, int> face_of;
    for (int f = 0; f < static_cast<int>(model.faces().size()); ++f) {
      const auto& name = model.faces()[f].name;
      if (name.empty() || name == "NONE") continue;
      const auto [it, is_new] = face_of.emplace(name, f);
      if (!is_new) it->second = -1;
    }
    return face_of;
  };
  const auto b = unique_names(base.model), v = unique_names(variant.model);
  ColourRefinement trial = colours;
  bool is_any = false;
  for (const auto& [name, face] : b) {
    const auto other = v.find(name);
    if (face < 0 || other == v.end() || other->second < 0) continue;
    trial.individualise(face, other->second);
    is_any = true;
  }
  if (is_any && trial.refine()) colours = std::move(trial);
}

// Entities in the order of the files, where that is consistent with the adjacency; faces alone
// where the files list edges differently.
std::optional<TopologyMatch> by_file_order(const Side& base, const Side& variant,
                                           const ColourRefinement& colours,
                                           const Similarity& alignment) {
  for (const int count : {base.graph.entity_count(), base.graph.faces}) {
    ColourRefinement trial = colours;
    bool is_possible = true;
    for (int n = 0; n < count && is_possible; ++n) {
      is_possible = trial.base_colours()[n] == trial.variant_colours()[n];
      if (is_possible) trial.individualise(n, n);
    }
    if (!is_possible || !trial.refine()) continue;
    std::vector<double> confidence(base.graph.entity_count(), 1.0);
    if (!Matcher(base, variant, alignment, kMostRefinements).solve(trial, confidence)) continue;
    TopologyMatch match = to_match(base, trial, confidence);
    match.how = kFileOrder;
    return match;
  }
  return std::nullopt;
}

std::optional<TopologyMatch> by_alignment(const Side& base, const Side& variant,
                                          ColourRefinement colours, const Candidate& candidate,
                                          int most_refinements) {
  std::vector<double> confidence(base.graph.entity_count(), 1.0);
  if (!Matcher(base, variant, candidate.alignment, most_refinements).solve(colours, confidence))
    return std::nullopt;
  TopologyMatch match = to_match(base, colours, confidence);
  match.how = candidate.how;
  return match;
}

// Collects possible matches and chooses among them.
class Selection {
 public:
  Selection(const Side& base, const Side& variant) : base_(base), variant_(variant) {}

  // Returns whether no other match can be better: an exact one that hardly turns, or in file order.
  bool offer(std::optional<TopologyMatch> match) {
    if (!match) return false;
    for (const TopologyMatch& other : matches_)
      if (other.faces == match->faces && other.curves == match->curves &&
          other.corners == match->corners)
        return false;
    align(base_.model, variant_.model, *match);
    distance_.push_back(quality(base_, variant_, *match, match->alignment));
    matches_.push_back(std::move(*match));
    const TopologyMatch& last = matches_.back();
    return distance_.back() < kTie && (last.how == kFileOrder || angle(last) < kHardlyTurned);
  }

  bool is_empty() const { return matches_.empty(); }

  // A turn must pay: matches by file order or without a turn give way only to one that fits far
  // better. Among either, the file's order if it fits nearly as well as any; else the nearest, of
  // equals the one of least rotation.
  std::optional<TopologyMatch> best() {
    if (matches_.empty()) return std::nullopt;
    const double unturned = least_distance([](const TopologyMatch& m) { return m.how != kTurned; });
    const double turned = least_distance([](const TopologyMatch& m) { return m.how == kTurned; });
    const bool is_turned = turned < kFarBetter * unturned - kTie;
    const double least = is_turned ? turned : unturned;
    std::size_t best = matches_.size();
    for (std::size_t i = 0; i < matches_.size(); ++i) {
      if ((matches_[i].how == kTurned) != is_turned) continue;
      if (matches_[i].how == kFileOrder && distance_[i] <= kFileOrderSlack * least + kTie)
        return std::move(matches_[i]);
      if (distance_[i] > kSlack * least + kTie) continue;
      if (best == matches_.size() || angle(matches_[i]) < angle(matches_[best])) best = i;
    }
    return std::move(matches_[best]);
  }

 private:
  template <class Predicate>
  double least_distance(const Predicate& is_asked) const {
    double result = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < matches_.size(); ++i)
      if (is_asked(matches_[i])) result = std::min(result, distance_[i]);
    return result;
  }

  static double angle(const TopologyMatch& match) {
    return Eigen::AngleAxisd(match.alignment.rotation).angle();
  }

  const Side& base_;
  const Side& variant_;
  std::vector<TopologyMatch> matches_;
  std::vector<double> distance_;
};

// The preferred match first: nothing moved; the file's own order, which tells how a symmetric part
// was turned as a whole; then by position under several alignments.
std::optional<TopologyMatch> by_position(const Side& base, const Side& variant,
                                         const ColourRefinement& colours) {
  const auto candidates = candidate_alignments(base, variant, colours);
  auto in_place = by_alignment(base, variant, colours, candidates.front(), kMostRefinements);
  Selection selection(base, variant);
  if (in_place && quality(base, variant, *in_place, Similarity{}) < kTie) {
    selection.offer(std::move(in_place));
    return selection.best();
  }
  if (selection.offer(by_file_order(base, variant, colours, candidates[1].alignment)))
    return selection.best();
  selection.offer(std::move(in_place));
  for (std::size_t i = 1; i < candidates.size(); ++i) {
    const int most = selection.is_empty() ? kMostRefinements : kFewRefinements;
    if (selection.offer(by_alignment(base, variant, colours, candidates[i], most))) break;
  }
  return selection.best();
}

std::optional<TopologyMatch> best_match(const Side& base, const Side& variant,
                                        const MatchOptions& options) {
  ColourRefinement colours(base.graph, variant.graph);
  if (!colours.refine()) return std::nullopt;
  apply_given(base, variant, options, colours);
  apply_names(base, variant, colours);
  if (!open_classes(colours, base.graph.entity_count()).empty())
    return by_position(base, variant, colours);
  TopologyMatch match =
      to_match(base, colours, std::vector<double>(base.graph.entity_count(), 1.0));
  match.how = options.given_faces.empty() ? "structure" : "map file";
  align(base.model, variant.model, match);
  return match;
}

Side make_side(const CadModel& model, bool is_oriented) {
  return {model, build_graph(model, is_oriented), entity_features(model)};
}

// Oriented first; shells that are no solids may be turned over.
std::optional<TopologyMatch> match_skeletons(const CadModel& base, const CadModel& variant,
                                             const MatchOptions& options) {
  for (const bool is_oriented : {true, false}) {
    const Side b = make_side(base, is_oriented), v = make_side(variant, is_oriented);
    if (b.graph.faces != v.graph.faces || b.graph.curves != v.graph.curves ||
        b.graph.corners != v.graph.corners)
      return std::nullopt;
    if (auto match = best_match(b, v, options)) return match;
  }
  return std::nullopt;
}

}  // namespace

TopologyMatch match_topology(const CadModel& base, const CadModel& variant,
                             const MatchOptions& options) {
  if (auto match = match_skeletons(base, variant, options)) return std::move(*match);
  if (auto match =
          match_skeletons(base.with_joined_edges(), variant.with_joined_edges(), options)) {
    match->joins_edges = true;
    return std::move(*match);
  }
  refuse(make_side(base, true), make_side(variant, true));
}

std::vector<std::pair<int, int>> read_face_map(const std::filesystem::path& path) {
  std::ifstream in(path);
  if (!in) throw IoError(path.string() + ": the face map can't be opened. Check the path.");
  std::vector<std::pair<int, int>> pairs;
  std::string line;
  for (int number = 1; std::getline(in, line); ++number) {
    line = line.substr(0, line.find('#'));
    std::replace(line.begin(), line.end(), ',', ' ');
    std::istringstream fields(line);
    int base = 0, variant = 0;
    std::string rest;
    if (fields >> base >> variant && !(fields >> rest)) {
      pairs.emplace_back(base, variant);
    } else if (line.find_first_not_of(" \t\r") != std::string::npos && number > 1) {
      throw InvalidInputError(path.string() + ":" + std::to_string(number) +
                              ": expected two face numbers 'base,variant'.");
    }
  }
  return pairs;
}

}  // namespace cadmorph
