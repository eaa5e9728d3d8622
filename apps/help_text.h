#pragma once

#include <string_view>

namespace cadmorph {

/// docs/troubleshooting.md, put into the program by the build.
extern const std::string_view kTroubleshooting;

}  // namespace cadmorph
