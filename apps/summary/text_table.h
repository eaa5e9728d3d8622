#pragma once

#include <string>
#include <vector>

namespace cadmorph {

/// Formats like std::printf.
[[gnu::format(printf, 1, 2)]] std::string format(const char* pattern, ...);

/// A count with separators of thousands: 13,056.
std::string with_commas(long long count);

/// A length in millimetres: "0 mm", "1.23e-07 mm", "0.125 mm", "1250 mm".
std::string millimetres(double length);

/// Rows of cells in columns as wide as their widest cell; the first column to the left, the others
/// to the right. Rows may be short.
std::string align(const std::vector<std::vector<std::string>>& rows);

}  // namespace cadmorph
