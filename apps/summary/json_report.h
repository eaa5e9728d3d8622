#pragma once

#include <string>

#include "apps/pipeline/morph_report.h"

namespace cadmorph {

/// The reports as JSON texts. Lengths in millimetres where the key ends in _mm, else in the mesh's
/// unit; cell ids from 0, CAD face numbers from 1.
std::string to_json(const PipelineReport& report, int exit_code);
std::string quality_json(const std::filesystem::path& mesh, Index nodes,
                         const QualityReport& quality, const ValidityReport& validity,
                         const QualityChecks& checks, int exit_code);
std::string match_json(const CadModel& base, const CadModel& variant, const TopologyMatch& match);

/// Whether a text is a report of this program, of whatever command and version.
bool is_json_report(const std::string& text);

/// What stands in a report's place after an error.
std::string error_json(const std::string& message, int exit_code);

}  // namespace cadmorph
