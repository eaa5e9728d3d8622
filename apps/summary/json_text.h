#pragma once

#include <nlohmann/json.hpp>
#include <string>

namespace cadmorph {

/// What every report of the program begins with.
nlohmann::ordered_json json_header(int exit_code);

/// A number; null where it is not finite, for which JSON has no word.
nlohmann::ordered_json json_number(double value);

/// The text of a report. Bytes that are not UTF-8, as in names of files, become U+FFFD.
std::string json_text(const nlohmann::ordered_json& json);

}  // namespace cadmorph
