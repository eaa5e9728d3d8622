#pragma once

#include <string>
#include <string_view>

namespace cadmorph {

/// Encodes bytes in base64, without line breaks.
std::string base64(std::string_view bytes);

}  // namespace cadmorph
