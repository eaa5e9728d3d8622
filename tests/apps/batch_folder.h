#pragma once

#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <string>

#include "command_line.h"

namespace cadmorph::testing {

/// The rows of results.jsonl (or of a shard) by id, without the column of seconds.
std::map<std::string, nlohmann::json> rows_of(const Workplace& place, const std::string& folder,
                                              const std::string& stem = "results");

/// The bytes of all meshes in a folder by name.
std::map<std::string, std::string> meshes_of(const Workplace& place, const std::string& folder);

}  // namespace cadmorph::testing
