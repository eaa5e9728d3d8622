#include "cad/match_search.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "core/parallel.h"

namespace cadmorph {
namespace {

using Eigen::Vector3d;

// A nearest candidate is clear when it is nearer than this part of the distance to the second
// nearest: its confidence, d2 / (d1 + d2), is then above two thirds.
constexpr double kClearMargin = 0.5;
// How much a prediction may be wrong, as part of the distance to the nearest decided entity: a
// strain of 15 % between the two that decided entities say nothing of. Half and double leave all
// known pairs as they are.
constexpr double kDoubt = 0.15;
// Candidates that are tried one after the other: a place in a square grid and those round it are
// nine. Six and 24 leave all known pairs as they are.
constexpr int kMaxTries = 12;
constexpr int kNeighbours = 12;       // three times the unknowns of a local affine fit
constexpr std::size_t kFewKnown = 4;  // points that an affine map needs
// Looked through one by one; from there on by a kd-tree, which finds the same members.
constexpr std::size_t kFewMembers = 48;
constexpr Index kGrain = 256;  // entities, some microseconds each

struct Ranked {
  int base = -1;
  double doubt = 0;
  std::vector<std::pair<double, int>> candidates;  // squared distance, variant node; nearest first
  double nearest() const { return std::sqrt(candidates[0].first) + doubt; }
  double second() const { return candidates.size() < 2 ? 1e300 : std::sqrt(candidates[1].first); }
  double ratio() const { return nearest() / (second() + 1e-300); }
  bool is_clear() const { return candidates.size() < 2 || nearest() < kClearMargin * second(); }
};

using RankedClass = std::vector<Ranked>;

class Search {
 public:
  Search(const MatchSide& base, const MatchSide& variant, ColourRefinement colours,
         const MotionGuess& guess, int most_refinements)
      : base_(base),
        variant_(variant),
        colours_(std::move(colours)),
        guess_(guess),
        most_refinements_(most_refinements) {}

  std::optional<ColourRefinement> run() {
    for (;;) {
      const auto open = open_classes(colours_, base_.graph.entity_count());
      if (open.empty()) return colours_;
      if (refinements_ >= most_refinements_) return std::nullopt;
      std::vector<RankedClass> ranked(open.size());
      const EntityMotion motion = motion_so_far();
      parallel_for(std::ssize(open), 1, [&](Index begin, Index end) {
        for (Index i = begin; i < end; ++i) ranked[i] = rank(open[i], motion);
      });
      if (!decide_clear_classes(ranked) && !decide_clear_pairs(ranked) && !decide_one(ranked))
        return std::nullopt;
    }
  }

 private:
  EntityMotion motion_so_far() const {
    std::map<int, std::pair<int, int>> last;  // node of the variant and count, a colour
    const int entities = base_.graph.entity_count();
    for (int n = 0; n < entities; ++n) {
      auto& [node, count] = last[colours_.variant_colours()[n]];
      node = n;
      ++count;
    }
    std::vector<Vector3d> from, to;
    for (int n = 0; n < entities; ++n) {
      const auto& [node, count] = last.at(colours_.base_colours()[n]);
      if (count > 1) continue;
      from.push_back(base_.features[n].centre);
      to.push_back(variant_.features[node].centre);
    }
    if (from.size() < kFewKnown) from.clear(), to.clear();
    return {guess_.motion, from, to, kNeighbours};
  }

  RankedClass rank(const ColourClass& members, const EntityMotion& motion) const {
    RankedClass ranked(members.base.size());
    const NearestMembers nearest(variant_, members.variant);
    parallel_for(std::ssize(ranked), kGrain, [&](Index begin, Index end) {
      for (Index i = begin; i < end; ++i) {
        const int b = members.base[static_cast<std::size_t>(i)];
        const EntityFeature& feature = base_.features[b];
        const EntityMotion::Place place = motion.place_of(feature.centre);
        ranked[static_cast<std::size_t>(i)] = {
            b, kDoubt * guess_.scale * place.reach,
            nearest.find(feature, place.point, guess_.scale, kMaxTries)};
      }
    });
    return ranked;
  }

  // Whether all members have a clear, different nearest candidate.
  static bool is_clear(const RankedClass& members) {
    std::vector<int> taken;
    for (const Ranked& r : members) {
      if (!r.is_clear()) return false;
      taken.push_back(r.candidates[0].second);
    }
    std::sort(taken.begin(), taken.end());
    return std::adjacent_find(taken.begin(), taken.end()) == taken.end();
  }

  bool try_pairs(const std::vector<Ranked>& pairs, std::size_t candidate = 0) {
    if (pairs.empty() || refinements_ >= most_refinements_) return false;
    ColourRefinement trial = colours_;
    for (const Ranked& r : pairs) trial.individualise(r.base, r.candidates[candidate].second);
    ++refinements_;
    if (!trial.refine()) return false;
    colours_ = std::move(trial);
    return true;
  }

  // All clear classes at once; where they contradict each other, the first that stands alone.
  bool decide_clear_classes(const std::vector<RankedClass>& open) {
    std::vector<const RankedClass*> clear;
    std::vector<Ranked> all;
    for (const RankedClass& members : open) {
      if (!is_clear(members)) continue;
      all.insert(all.end(), members.begin(), members.end());
      clear.push_back(&members);
    }
    return try_pairs(all) || std::any_of(clear.begin(), clear.end(), [&](const RankedClass* one) {
             return clear.size() > 1 && try_pairs(*one);
           });
  }

  // Members that are clear though their class is not, and that no other member comes nearer to.
  bool decide_clear_pairs(const std::vector<RankedClass>& open) {
    std::vector<Ranked> pairs;
    for (const RankedClass& members : open) {
      std::map<int, double> nearest;  // to a variant node
      for (const Ranked& r : members) {
        const auto [it, is_new] = nearest.emplace(r.candidates[0].second, r.candidates[0].first);
        if (!is_new) it->second = std::min(it->second, r.candidates[0].first);
      }
      for (const Ranked& r : members) {
        double& least = nearest[r.candidates[0].second];
        if (!r.is_clear() || r.candidates[0].first > least) continue;
        least = -1;  // taken
        pairs.push_back(r);
      }
    }
    std::sort(pairs.begin(), pairs.end(),
              [](const Ranked& a, const Ranked& b) { return a.ratio() < b.ratio(); });
    // The surest half, if not all of them are possible, and so on.
    for (; !pairs.empty(); pairs.resize(pairs.size() / 2))
      if (try_pairs(pairs)) return true;
    return false;
  }

  bool decide_one(const std::vector<RankedClass>& open) {
    const Ranked* best = nullptr;
    for (const RankedClass& members : open)
      for (const Ranked& r : members)
        if (!best || r.ratio() < best->ratio()) best = &r;
    for (std::size_t k = 0; k < best->candidates.size(); ++k)
      if (try_pairs({*best}, k)) return true;
    return false;
  }

  const MatchSide& base_;
  const MatchSide& variant_;
  ColourRefinement colours_;
  const MotionGuess& guess_;
  int most_refinements_;
  int refinements_ = 0;
};

}  // namespace

std::vector<ColourClass> classes_of(const ColourRefinement& colours, int entities) {
  std::map<int, ColourClass> classes;
  for (int n = 0; n < entities; ++n) {
    classes[colours.base_colours()[n]].base.push_back(n);
    classes[colours.variant_colours()[n]].variant.push_back(n);
  }
  std::vector<ColourClass> result;
  for (auto& [colour, members] : classes) result.push_back(std::move(members));
  return result;
}

std::vector<ColourClass> open_classes(const ColourRefinement& colours, int entities) {
  std::vector<ColourClass> open = classes_of(colours, entities);
  std::erase_if(open, [](const ColourClass& members) { return members.base.size() < 2; });
  return open;
}

std::optional<ColourRefinement> decide_by_closeness(const MatchSide& base, const MatchSide& variant,
                                                    ColourRefinement colours,
                                                    const MotionGuess& guess,
                                                    int most_refinements) {
  return Search(base, variant, std::move(colours), guess, most_refinements).run();
}

double squared_distance(const EntityFeature& base, const EntityFeature& variant, const Vector3d& at,
                        double scale) {
  const double size = scale * base.size - variant.size;
  return (at - variant.centre).squaredNorm() + size * size;
}

NearestMembers::NearestMembers(const MatchSide& variant, const std::vector<int>& members)
    : variant_(variant), members_(members) {
  if (members.size() <= kFewMembers) return;
  RowMatrix rows(static_cast<Index>(members.size()), 4);
  for (Index i = 0; i < rows.rows(); ++i) {
    const EntityFeature& feature = variant.features[members[static_cast<std::size_t>(i)]];
    rows.row(i) << feature.centre.transpose(), feature.size;
  }
  tree_.emplace(rows);
}

std::vector<std::pair<double, int>> NearestMembers::find(const EntityFeature& base,
                                                         const Vector3d& at, double scale,
                                                         int count) const {
  std::vector<std::pair<double, int>> found;
  const auto add = [&](int v) {
    found.emplace_back(squared_distance(base, variant_.features[v], at, scale), v);
  };
  if (tree_) {
    const Eigen::Vector4d query(at.x(), at.y(), at.z(), scale * base.size);
    for (const Neighbour& near : tree_->nearest(query.data(), count))
      add(members_[static_cast<std::size_t>(near.index)]);
  } else {
    std::for_each(members_.begin(), members_.end(), add);
  }
  const auto keep = std::min(found.size(), static_cast<std::size_t>(count));
  std::partial_sort(found.begin(), found.begin() + static_cast<std::ptrdiff_t>(keep), found.end());
  found.resize(keep);
  return found;
}

}  // namespace cadmorph
