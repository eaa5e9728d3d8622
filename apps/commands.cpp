#include "apps/commands.h"

#include <cstdio>
#include <new>

#include "apps/json_report.h"
#include "apps/progress_bar.h"
#include "apps/summary.h"
#include "apps/text_table.h"
#include "cad/step_reader.h"
#include "core/parallel.h"

namespace cadmorph {
namespace {

void print(const std::string& text) {
  if (std::fwrite(text.data(), 1, text.size(), stdout) != text.size() || std::fflush(stdout) != 0)
    throw OutputError("can't write to the standard output");
}

// Prints the summary, or writes the report where it was asked for.
void hand_over(const CommandLine& line, const std::string& summary, const std::string& json) {
  if (!line.json.empty() && line.json != "-") write_text(line.json, json);
  if (line.json == "-")
    print(json);
  else if (!line.is_quiet)
    print(summary);
}

void check_json_output(const CommandLine& line) {
  if (line.json.empty() || line.json == "-") return;
  check_output(line.json, {line.files.base_cad, line.files.variant_cad, line.files.mesh});
}

void warn(const CommandLine& line, const std::vector<std::string>& warnings) {
  if (line.is_quiet) return;
  for (const std::string& warning : warnings)
    std::fprintf(stderr, "cadmorph: warning: %s\n", warning.c_str());
}

void complain(const PipelineReport& report, const PipelineOptions& options) {
  const Diagnosis& diagnosis = *report.diagnosis;
  const bool is_one = diagnosis.bad_cells == 1;
  std::string what = with_commas(diagnosis.bad_cells) + (is_one ? " element" : " elements");
  what += report.outcome == Outcome::Inverted ? (is_one ? " is inverted" : " are inverted")
                                              : format(is_one ? " has a scaled Jacobian below %g"
                                                              : " have a scaled Jacobian below %g",
                                                       *options.min_scaled_jacobian);
  std::fprintf(stderr, "cadmorph: error: %s; the refused mesh is %s (cell array cadmorph_bad)\n%s",
               what.c_str(), report.written.c_str(), diagnosis_text(diagnosis).c_str());
}

ExitCode run_morph(const CommandLine& line) {
  check_json_output(line);
  PipelineOptions options = line.pipeline;
  if (line.face_map) options.face_map = read_face_map(*line.face_map);
  ProgressBar bar(!line.is_quiet);
  options.progress = [&bar](std::string_view phase, double fraction) { bar.show(phase, fraction); };
  const PipelineReport report = morph_files(line.files, options);
  bar.erase();
  warn(line, report.warnings);
  const ExitCode code = report.outcome == Outcome::Done ? ExitCode::Done : ExitCode::Quality;
  hand_over(line, summary_text(report), to_json(report, static_cast<int>(code)));
  if (code != ExitCode::Done) complain(report, options);
  return code;
}

ExitCode run_quality(const CommandLine& line) {
  check_json_output(line);
  const MeshFile file(line.files.mesh);
  const Mesh& mesh = file.mesh();
  const Orientation orientation = detect_orientation(mesh);
  const QualityReport quality = measure_quality(mesh, mesh.points, orientation);
  const ValidityReport validity = check_validity(mesh, mesh.points, orientation);
  const QualityChecks checks =
      check_quality(mesh, mesh.points, find_cell_neighbours(mesh), orientation);
  const bool is_poor =
      line.pipeline.min_scaled_jacobian && quality.min < *line.pipeline.min_scaled_jacobian;
  const bool is_good = quality.inverted == 0 && validity.invalid == 0 && !is_poor;
  const ExitCode code = is_good ? ExitCode::Done : ExitCode::Quality;
  hand_over(line, quality_text(line.files.mesh, mesh.node_count(), quality, validity, checks),
            quality_json(line.files.mesh, mesh.node_count(), quality, validity, checks,
                         static_cast<int>(code)));
  if (!is_good)
    std::fprintf(stderr, "cadmorph: error: %s: %s\n", line.files.mesh.c_str(),
                 quality.inverted + validity.invalid > 0
                     ? "inverted elements"
                     : "the smallest scaled Jacobian is below what was asked");
  return code;
}

ExitCode run_match(const CommandLine& line) {
  check_json_output(line);
  MatchOptions options;
  if (line.face_map) options.given_faces = read_face_map(*line.face_map);
  const CadModel base = read_step(line.files.base_cad);
  const CadModel variant = read_step(line.files.variant_cad);
  const TopologyMatch match = match_topology(base, variant, options);
  hand_over(line, match_text(base, variant, match), match_json(base, variant, match));
  return ExitCode::Done;
}

template <class Type>
bool is(const std::exception& error) {
  return dynamic_cast<const Type*>(&error) != nullptr;
}

}  // namespace

ExitCode run_command(const CommandLine& line) {
  set_thread_count(line.threads);
  switch (line.command) {
    case Command::Quality:
      return run_quality(line);
    case Command::Match:
      return run_match(line);
    case Command::Morph:
      break;
  }
  return run_morph(line);
}

ExitCode exit_code_of(const std::exception& error) {
  if (is<UsageError>(error)) return ExitCode::Usage;
  if (is<OutputError>(error) || is<SolverError>(error)) return ExitCode::Resources;
  if (is<InvalidInputError>(error) || is<IoError>(error) || is<CadError>(error))
    return ExitCode::Input;
  if (is<TopologyError>(error)) return ExitCode::Topology;
  if (is<AssociationError>(error)) return ExitCode::Association;
  if (is<QualityError>(error)) return ExitCode::Quality;
  return ExitCode::Resources;
}

}  // namespace cadmorph
