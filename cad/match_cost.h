#pragma once

#include <optional>
#include <vector>

#include "cad/entity_motion.h"
#include "cad/match_side.h"
#include "cad/topology_match.h"

// What a match costs: its terms and their weights.

namespace cadmorph {

/// Of the diagonal: exchanged B-Reps are known to 1e-7 of a part's size, centroids of their
/// entities to a hundred times that.
inline constexpr double kCentroidRounding = 1e-5;

/// Radians: of what hardly turned, to look for other matches is of no use.
inline constexpr double kHardlyTurned = 1e-3;

/// Sets match.alignment (see align) and match.cost, but for its names. Distances x, in diagonals of
/// the variant, cost log2(1 + x / x0) + x / x1: a root mean square over entities of the
/// deformation, the mean of what each costs of departures from the neighbours' motion.
void rate(const MatchSide& base, const MatchSide& variant, TopologyMatch& match);

/// Whether a rated match deforms nothing, to the rounding of exchanged files.
bool fits_exactly(const TopologyMatch& match);

/// Whichever costs less; the other one is a runner-up, where it costs less than those known.
std::optional<TopologyMatch> cheaper(std::optional<TopologyMatch> a,
                                     std::optional<TopologyMatch> b);

/// Node of the variant for each entity node of the base.
std::vector<int> partners(const MatchSide& base, const TopologyMatch& match);

/// The motion of the entities, as so many neighbours of each tell.
EntityMotion motion_of(const MatchSide& base, const MatchSide& variant, const TopologyMatch& match,
                       int neighbours);

/// Root mean square distance of corners and curves, in variant diagonals; of faces, too, where
/// there are no corners: centroids of faces depend a little on the parametrisation.
double distance_after(const MatchSide& base, const MatchSide& variant, const TopologyMatch& match,
                      const Similarity& t);

/// Whether the order of so many entities, faces first, hardly fits by accident.
bool is_order_evidence(const EntityGraph& graph, int count);

}  // namespace cadmorph
