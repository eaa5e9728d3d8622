#pragma once

#include <functional>
#include <string_view>

namespace cadmorph {

/// Called by long operations with the phase's name and the fraction done, in [0, 1]. The library
/// never prints; the programs turn this into a bar. May be empty. Called from one thread at a time.
using Progress = std::function<void(std::string_view phase, double fraction)>;

}  // namespace cadmorph
