#pragma once

#include <string>

#include "apps/pipeline/field_files.h"

namespace cadmorph {

/// A line about a field file.
std::string field_text(const FieldFigures& field);

/// The report of `cadmorph apply` for people and as JSON.
std::string apply_text(const ApplyReport& report);
std::string apply_json(const ApplyReport& report, int exit_code);

}  // namespace cadmorph
