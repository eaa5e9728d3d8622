#pragma once

#include <string>
#include <vector>

#include "apps/pipeline/morph_report.h"

namespace cadmorph {

/// The report as a page of aligned text with units, for people.
std::string summary_text(const PipelineReport& report);

/// A line of a summary.
std::string labelled(std::string label, const std::string& text);

/// What changed, in rows of name, before and after.
std::vector<std::vector<std::string>> distance_rows(const PipelineReport& report);
std::vector<std::vector<std::string>> quality_rows(const MeshFigures& before,
                                                   const MeshFigures& after);
/// None where no first cell moved.
std::vector<std::vector<std::string>> layer_rows(const LayerFigures& layers);

/// What rounding to the digits of a file came to.
std::string rounding_text(const CoordinateRounding& rounding);
/// What came of the file to keep the base side in, in a few words.
std::string cache_text(const CacheReport& cache);

/// What hints are about: also elements that are poor in the input already, or what was lost alone.
enum class HintsOn { All, Losses };

/// What to do where elements became poor, or layers lower or higher, a line each.
std::vector<std::string> hints(const PipelineReport& report, HintsOn on = HintsOn::All);

/// Why a result was refused and where its mesh is, in one line.
std::string refusal_text(const PipelineReport& report);

/// How many elements it was refused for, and what they are.
std::string bad_cells_text(const PipelineReport& report);

/// The diagnosis of a refused result in a few lines.
std::string diagnosis_text(const Diagnosis& diagnosis);

/// The figures of `cadmorph quality`.
std::string quality_text(const std::filesystem::path& file, const Mesh& mesh,
                         const QualityReport& quality, const ValidityReport& validity,
                         const QualityChecks& checks);

/// The table of `cadmorph match`.
std::string match_text(const CadModel& base, const CadModel& variant, const TopologyMatch& match);

/// The terms of a match's cost by their names, in bits.
std::vector<std::pair<std::string, double>> cost_terms(const MatchCost& cost);

/// The table of `cadmorph match --explain`: what the match cost, and the runner-up.
std::string cost_text(const TopologyMatch& match);

/// Names as in messages and options.
std::string to_string(const Kernel& kernel);
std::string to_string(SolverKind solver);
std::string to_string(CacheUse use);

}  // namespace cadmorph
