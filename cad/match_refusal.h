#pragma once

#include "cad/match_side.h"

namespace cadmorph {

/// Throws a TopologyError that names the entities without a partner, by closeness.
[[noreturn]] void refuse_match(const MatchSide& base, const MatchSide& variant);

}  // namespace cadmorph
