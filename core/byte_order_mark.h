#pragma once

#include <cstddef>
#include <string_view>

namespace cadmorph {

/// The length of the byte-order mark that Windows' editors put before a text in UTF-8; 0 where
/// `text` has none.
constexpr std::size_t byte_order_mark_size(std::string_view text) {
  constexpr std::string_view kMark = "\xef\xbb\xbf";
  return text.starts_with(kMark) ? kMark.size() : 0;
}

}  // namespace cadmorph
