#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>

#include "apps/commands/command.h"
#include "apps/commands/help_format.h"
#include "apps/commands/options.h"
#include "apps/pipeline/field_files.h"
#include "apps/summary/field_summary.h"
#include "apps/summary/json_report.h"
#include "apps/summary/progress_bar.h"
#include "apps/summary/summary.h"
#include "apps/summary/whole_progress.h"
#include "core/formats/mesh_format.h"
#include "core/parallel.h"

namespace cadmorph {
namespace {

struct FieldCommand {
  MorphFiles files;
  MorphOptions options;
  std::string json;
  bool is_quiet = false;
  int threads = 0;  ///< 0: all
};

void check(const FieldCommand& command) {
  const PipelineOptions& pipeline = command.options.pipeline;
  if (pipeline.untangle == UntangleMode::Always || pipeline.improve_below || pipeline.keep_layers)
    throw UsageError(
        "--untangle always, --improve and --keep-layers move single nodes, which a field of the "
        "position can't hold; leave them out, or morph the mesh by the main command");
  std::vector<std::filesystem::path> inputs = command.files.inputs();
  inputs.push_back(command.options.face_map);
  check_outputs(
      {{"-o", command.files.output}, json_output(command.json), {"--cache", pipeline.cache, false}},
      inputs);
  if (is_mesh_name(command.files.output))
    throw UsageError("-o " + command.files.output.string() +
                     ": field writes no mesh but a field file; name it " +
                     command.files.output.stem().string() +
                     ".cmf, and move meshes by cadmorph apply");
}

std::string field_summary(const FieldReport& report) {
  std::string text = summary_text(report.morph);
  if (report.morph.outcome == Outcome::Done) text += field_text(report.field);
  return text;
}

ExitCode run_field(const FieldCommand& command, PipelineOptions options) {
  set_thread_count(command.threads);
  ProgressBar bar(!command.is_quiet);
  WholeProgress whole(static_cast<int>(command.files.via.size()) + 1);
  options.progress = [&](std::string_view phase, double fraction) {
    bar.show(phase, whole(phase, fraction));
  };
  const FieldReport report = field_files(command.files, options);
  bar.erase();
  std::vector<std::string> warnings = report.morph.run.warnings;
  if (!report.morph.run.cache.remark.empty()) warnings.push_back(report.morph.run.cache.remark);
  for (const std::string& warning : warnings)
    if (!command.is_quiet) std::fprintf(stderr, "cadmorph: warning: %s\n", warning.c_str());
  const ExitCode code = report.morph.outcome == Outcome::Done ? ExitCode::Done : ExitCode::Quality;
  hand_over(command.json, command.is_quiet, field_summary(report),
            to_json(report.morph, static_cast<int>(code)));
  if (code != ExitCode::Done)
    std::fprintf(stderr,
                 "cadmorph: error: the field leaves inverted or poor elements in %s and was not "
                 "written; the main command may mend them by optimisation, which moves single "
                 "nodes and has no field\n%s",
                 command.files.mesh.c_str(), diagnosis_text(*report.morph.diagnosis).c_str());
  return code;
}

}  // namespace

void add_field_command(CLI::App& app, Action& action) {
  const auto command = std::make_shared<FieldCommand>();
  CLI::App* parser = app.add_subcommand("field", "write the deformation to move other points by");
  parser->footer(
      help_end({"field wing.step wing_thick.step wing.vtu -o thick.cmf"}, {0, 1, 2, 3, 4, 5, 6}));
  parser->add_option("BASE", command->files.base_cad, "STEP file the mesh was made for")
      ->required();
  parser->add_option("VARIANT", command->files.variant_cad, "STEP file to move the mesh onto")
      ->required();
  parser
      ->add_option("MESH", command->files.mesh,
                   "mesh of BASE, of any format of 'cadmorph help formats'")
      ->required();
  parser->add_option("-o,--output", command->files.output, "field file")
      ->type_name("FIELD.cmf")
      ->required();
  parser
      ->add_option("--via", command->files.via,
                   "CAD model between BASE and VARIANT to morph through; may be repeated")
      ->type_name("STEP")
      ->allow_extra_args(false);
  add_json_option(*parser, command->json);
  parser->add_flag("--quiet", command->is_quiet, "print errors only");
  add_threads_option(*parser, command->threads);
  add_timeout_option(*parser, command->files.read_cad);
  add_morph_options(*parser, command->options);
  parser->callback([&action, command] {
    action.json = command->json;
    MorphFiles& files = command->files;
    std::vector<std::filesystem::path> named = {files.base_cad, files.variant_cad, files.mesh};
    if (order_inputs(named, 2)) {
      files.base_cad = named[0];
      files.variant_cad = named[1];
      files.mesh = named[2];
    }
    check(*command);
    const PipelineOptions options = resolve(command->options);
    action.run = [command, options] { return run_field(*command, options); };
  });
}

}  // namespace cadmorph
