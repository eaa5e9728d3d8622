#pragma once

#include <optional>
#include <utility>
#include <vector>

#include "cad/entity_motion.h"
#include "cad/match_side.h"
#include "core/kd_tree.h"

namespace cadmorph {

/// The nodes of a colour: where there are several, the topology can't tell them apart.
struct ColourClass {
  std::vector<int> base, variant;
};

std::vector<ColourClass> classes_of(const ColourRefinement& colours, int entities);
/// Colours of several entities.
std::vector<ColourClass> open_classes(const ColourRefinement& colours, int entities);

/// A first guess of the motion, and the scale that it gives to lengths.
struct MotionGuess {
  RoughMotion motion;
  double scale = 1;
};

/// Decides every open entity by closeness to where the guess and the entities decided so far
/// predict it, the surest ones first, each decision carried on over the adjacency by refinement.
/// Returns the decided colours; nothing when it gets stuck or needs more than `most_refinements`,
/// as a wrong guess makes it.
std::optional<ColourRefinement> decide_by_closeness(const MatchSide& base, const MatchSide& variant,
                                                    ColourRefinement colours,
                                                    const MotionGuess& guess, int most_refinements);

/// Distance of a base entity, predicted at `at` and of its size times `scale`, to a variant entity.
double squared_distance(const EntityFeature& base, const EntityFeature& variant,
                        const Eigen::Vector3d& at, double scale);

/// Finds the nearest of some variant entities.
class NearestMembers {
 public:
  NearestMembers(const MatchSide& variant, const std::vector<int>& members);

  /// The `count` nearest ones to a base entity predicted at `at`: squared_distance and node,
  /// nearest first.
  std::vector<std::pair<double, int>> find(const EntityFeature& base, const Eigen::Vector3d& at,
                                           double scale, int count) const;

 private:
  const MatchSide& variant_;
  const std::vector<int>& members_;
  std::optional<KdTree> tree_;  // over centre and size, where there are many
};

}  // namespace cadmorph
