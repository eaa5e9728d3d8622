#pragma once

#include <functional>
#include <string_view>

#include "api.h"

namespace cadmorph::CADMORPH_V1 {

/// Called by long work with the phase's name and the fraction of it done, in [0, 1]; the work ends
/// with CancelledError where it returns false. Called from one thread at a time, not always the
/// caller's, some times a second at most; may be empty. What it throws comes out of the work.
using Progress = std::function<bool(std::string_view phase, double fraction)>;

}  // namespace cadmorph::CADMORPH_V1
