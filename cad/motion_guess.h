#pragma once

#include <vector>

#include "cad/match_search.h"

namespace cadmorph {

/// What TopologyMatch::how says of a match by position.
inline constexpr const char* kInPlace = "position";
inline constexpr const char* kTurned = "position after a turn";

struct NamedGuess {
  MotionGuess motion;
  const char* how;  ///< kInPlace or kTurned
};

/// First guesses of the motion: in place; by bounding boxes; by what the topology decides, as an
/// affine map and as a similarity; by the spread of what it can't tell apart, which may turn; by
/// principal axes.
std::vector<NamedGuess> first_guesses(const MatchSide& base, const MatchSide& variant,
                                      const ColourRefinement& colours);

/// Scale and shift that carry the bounding box of one model to that of the other.
Similarity align_bounds(const CadModel& base, const CadModel& variant);

}  // namespace cadmorph
