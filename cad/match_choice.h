#pragma once

#include <optional>

#include "cad/match_side.h"
#include "cad/topology_match.h"

namespace cadmorph {

/// Decides what `colours` leave open by position: under several first guesses of the motion, with
/// and without the hints of entity_forms, and in the order of the files. Of the matches found it
/// takes the one of least match_cost. Nothing where no match is possible.
std::optional<TopologyMatch> match_by_position(const MatchSide& base, const MatchSide& variant,
                                               const ColourRefinement& colours);

/// The match that `colours`, all decided, describe. Confidences are not set.
TopologyMatch to_match(const MatchSide& base, const ColourRefinement& colours);

/// Sets the confidences of a match: 1 where `colours` leave one possibility; else d2 / (d1 + d2),
/// d1 the distance of the entity from where its neighbours' motion puts it, d2 that of the nearest
/// other possibility.
void set_confidence(const MatchSide& base, const MatchSide& variant,
                    const ColourRefinement& colours, TopologyMatch& match);

}  // namespace cadmorph
