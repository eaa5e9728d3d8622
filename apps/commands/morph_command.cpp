#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <memory>

#include "apps/commands/command.h"
#include "apps/commands/options.h"
#include "apps/report/morph_showing.h"
#include "apps/summary/json_report.h"
#include "apps/summary/progress_bar.h"
#include "apps/summary/summary.h"
#include "apps/summary/text_table.h"
#include "apps/summary/whole_progress.h"
#include "core/parallel.h"

namespace cadmorph {
namespace {

namespace fs = std::filesystem;

struct MorphCommand {
  MorphFiles files;
  MorphOptions options;
  std::string output, json;
  ShowFiles show;
  bool is_quiet = false;
  int threads = 0;  ///< 0: all
};

void add_show_options(CLI::App& app, ShowFiles& show) {
  app.add_option("--report", show.report,
                 "write a page to look at: figures, charts, pictures, 3D view")
      ->type_name("FILE.html");
  app.add_option("--picture", show.picture, "write a picture of the mesh before and after")
      ->type_name("FILE.png");
}

void add_options(CLI::App& app, MorphCommand& command) {
  app.add_option("BASE", command.files.base_cad, "STEP file the mesh was made for");
  app.add_option("VARIANT", command.files.variant_cad, "STEP file to move the mesh onto");
  app.add_option("MESH", command.files.mesh,
                 "mesh of BASE: a file or folder of any format of 'cadmorph help formats'");
  app.add_option("-o,--output", command.output, "morphed mesh (default: <stem>.morphed.<ext>)")
      ->type_name("OUT");
  app.add_option("--via", command.files.via,
                 "CAD model between BASE and VARIANT to morph through; may be repeated")
      ->type_name("STEP")
      ->allow_extra_args(false);
  add_json_option(app, command.json);
  add_show_options(app, command.show);
  app.add_flag("--diagnostics", command.files.has_diagnostics,
               "add displacement, CAD entity, (u,v) and scaled Jacobian to the output");
  app.add_flag("--quiet", command.is_quiet, "print errors only");
  add_threads_option(app, command.threads);
  add_timeout_option(app, command.files.read_cad);
  add_morph_options(app, command.options);
}

// A command that was not known is taken for the base CAD.
void check_command(const CLI::App& app, const fs::path& base) {
  std::error_code error;
  if (base.empty() || fs::exists(base, error)) return;
  std::vector<std::string> commands;
  for (const CLI::App* command : app.get_subcommands({})) commands.push_back(command->get_name());
  if (const std::string hint = did_you_mean(base.string(), commands); !hint.empty())
    throw UsageError("there is no command '" + base.string() + "'" + hint);
}

void check_inputs(const MorphFiles& files) {
  const char* missing = files.base_cad.empty()      ? "BASE.step, VARIANT.step and MESH"
                        : files.variant_cad.empty() ? "VARIANT.step and MESH"
                        : files.mesh.empty()        ? "MESH"
                                                    : nullptr;
  if (missing)
    throw UsageError("missing " + std::string(missing) +
                     "; usage: cadmorph BASE.step VARIANT.step MESH [-o OUT] (see --help)");
}

void check_files(const MorphCommand& command) {
  const MorphFiles& files = command.files;
  std::vector<fs::path> inputs = files.inputs();
  inputs.push_back(command.options.face_map);
  check_outputs({{"-o", files.output},
                 {"-o", failed_path(files.output)},
                 json_output(command.json),
                 {"--report", command.show.report},
                 {"--picture", command.show.picture},
                 {"--cache", command.options.pipeline.cache, false}},
                inputs);
  check_extension("--report", command.show.report, {".html", ".htm"});
  check_extension("--picture", command.show.picture, {".png"});
  check_format(files.output, files.mesh);
}

void complain(const PipelineReport& report) {
  std::fprintf(stderr, "cadmorph: error: %s\n%s%s", refusal_text(report).c_str(),
               diagnosis_text(*report.diagnosis).c_str(),
               troubleshooting_line(ExitCode::Quality).c_str());
}

ExitCode run_morph(const MorphCommand& command, PipelineOptions options) {
  const double start_up = process_seconds();
  set_thread_count(command.threads);
  ProgressBar bar(!command.is_quiet);
  WholeProgress whole(static_cast<int>(command.files.via.size()) + 1);
  options.progress = [&](std::string_view phase, double fraction) {
    bar.show(phase, whole(phase, fraction));
  };
  std::vector<std::string> told;
  options.notice = [&](const std::string& warning) {
    if (command.is_quiet || std::ranges::find(told, warning) != told.end()) return;
    bar.erase();
    std::fprintf(stderr, "cadmorph: warning: %s\n", warning.c_str());
    told.push_back(warning);
  };
  MorphShowing showing(command.show);
  MorphFiles files = command.files;
  if (!command.show.is_empty())
    files.on_result = [&](const MorphResult& result) { showing.collect(result); };
  PipelineReport report = morph_files(files, options);
  report.run.phases.insert(report.run.phases.begin(), {"start", start_up});
  report.run.seconds += start_up;
  ExitCode code = report.outcome == Outcome::Done ? ExitCode::Done : ExitCode::Quality;
  std::vector<std::string> warnings = mesh_remarks(report.mesh.file, report.mesh.remarks);
  warnings.insert(warnings.end(), report.run.warnings.begin(), report.run.warnings.end());
  if (!report.run.cache.remark.empty()) warnings.push_back(report.run.cache.remark);
  ShowReport shown;
  if (!command.show.is_empty()) shown = showing.write(report, static_cast<int>(code));
  if (!shown.failures.empty() && code == ExitCode::Done) code = ExitCode::Resources;
  warnings.insert(warnings.end(), shown.warnings.begin(), shown.warnings.end());
  bar.erase();
  for (const std::string& warning : warnings)
    if (!command.is_quiet && std::ranges::find(told, warning) == told.end())
      std::fprintf(stderr, "cadmorph: warning: %s\n", warning.c_str());
  std::string summary = summary_text(report);
  if (!shown.written.report.empty()) summary += labelled("Report", shown.written.report.string());
  if (!shown.written.picture.empty())
    summary += labelled("Picture", shown.written.picture.string());
  hand_over(command.json, command.is_quiet, summary, to_json(report, static_cast<int>(code)));
  for (const std::string& failure : shown.failures)
    std::fprintf(stderr, "cadmorph: error: %s\n", failure.c_str());
  if (report.outcome != Outcome::Done) complain(report);
  return code;
}

void prepare(MorphCommand& command, Action& action) {
  action.json = command.json;
  MorphFiles& files = command.files;
  check_inputs(files);
  std::vector<fs::path> inputs = {files.base_cad, files.variant_cad, files.mesh};
  if (order_inputs(inputs, 2)) {
    files.base_cad = inputs[0];
    files.variant_cad = inputs[1];
    files.mesh = inputs[2];
  }
  files.output = command.output.empty() ? default_output(files.mesh) : fs::path(command.output);
  check_files(command);
  if (!files.via.empty() && !command.options.face_map.empty())
    throw UsageError("--map names faces of two CAD models and can't be used with --via");
  const PipelineOptions options = resolve(command.options);
  action.run = [command, options] { return run_morph(command, options); };
}

}  // namespace

void add_morph_command(CLI::App& app, Action& action) {
  const auto command = std::make_shared<MorphCommand>();
  add_options(app, *command);
  app.callback([&app, &action, command] {
    if (!app.get_subcommands().empty()) return;
    check_command(app, command->files.base_cad);
    prepare(*command, action);
  });
}

}  // namespace cadmorph
