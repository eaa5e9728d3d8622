#pragma once

#include <CLI/CLI.hpp>
#include <cmath>
#include <string>

namespace cadmorph {

/// The check of an option that takes numbers for which `is_good` holds; `what` they are, in a
/// message, and `type` of the option, in its help. CLI11's own checks let NaN through, and name the
/// largest double in all its 309 digits.
template <class Predicate>
CLI::Validator number_check(Predicate is_good, const std::string& what, const std::string& type) {
  return CLI::Validator(
      [is_good, what](const std::string& text) -> std::string {
        double value = 0;
        const bool is_number = CLI::detail::lexical_cast(text, value);
        return is_number && is_good(value) ? "" : "'" + text + "' is not a " + what;
      },
      type);
}

inline CLI::Validator positive_number() {
  return number_check([](double value) { return value > 0 && std::isfinite(value); },
                      "number greater than 0", "POSITIVE");
}

inline CLI::Validator number_from_zero() {
  return number_check([](double value) { return value >= 0 && std::isfinite(value); },
                      "finite number of at least 0", "NONNEGATIVE");
}

inline CLI::Validator number_between(double least, double most) {
  return number_check(
      [=](double value) { return value >= least && value <= most; },
      "number from " + CLI::detail::to_string(least) + " to " + CLI::detail::to_string(most), "");
}

}  // namespace cadmorph
