#pragma once

#include <CLI/CLI.hpp>
#include <cmath>
#include <string>

namespace cadmorph {

/// The check of an option that takes numbers above zero. CLI11's own names the largest double in
/// all its 309 digits, and zero as allowed.
inline CLI::Validator positive_number() {
  return CLI::Validator(
      [](const std::string& text) -> std::string {
        double value = 0;
        const bool is_number = CLI::detail::lexical_cast(text, value);
        return is_number && value > 0 && std::isfinite(value)
                   ? ""
                   : "'" + text + "' is not a number greater than 0";
      },
      "POSITIVE");
}

/// The check of an option that takes numbers of [least, most]. CLI11's own lets NaN through.
inline CLI::Validator number_between(double least, double most) {
  const std::string range =
      "from " + CLI::detail::to_string(least) + " to " + CLI::detail::to_string(most);
  return CLI::Validator(
      [least, most, range](const std::string& text) -> std::string {
        double value = 0;
        const bool is_number = CLI::detail::lexical_cast(text, value);
        return is_number && value >= least && value <= most
                   ? ""
                   : "'" + text + "' is not a number " + range;
      },
      "");
}

/// The check of an option that takes finite numbers from zero on.
inline CLI::Validator number_from_zero() {
  return CLI::Validator(
      [](const std::string& text) -> std::string {
        double value = 0;
        const bool is_number = CLI::detail::lexical_cast(text, value);
        return is_number && value >= 0 && std::isfinite(value)
                   ? ""
                   : "'" + text + "' is not a finite number of at least 0";
      },
      "NONNEGATIVE");
}

}  // namespace cadmorph
