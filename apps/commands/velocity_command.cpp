#include <CLI/CLI.hpp>
#include <memory>

#include "apps/commands/derivative_command.h"
#include "apps/commands/help_format.h"
#include "apps/commands/number_checks.h"
#include "apps/pipeline/design_velocity.h"
#include "apps/summary/derivative_summary.h"
#include "core/formats/mesh_format.h"

namespace cadmorph {
namespace {

struct VelocityCommand : DerivativeCommand {
  VelocityFiles files;
  std::vector<std::filesystem::path> half;
};

void check(VelocityCommand& command) {
  VelocityFiles& files = command.files;
  if (!command.half.empty()) {
    files.half_plus = command.half[0];
    files.half_minus = command.half[1];
  }
  check_outputs({{"-o", files.output},
                 json_output(command.json),
                 {"--cache", command.options.pipeline.cache, false}},
                {files.base_cad, files.plus, files.minus, files.mesh, files.half_plus,
                 files.half_minus, command.options.face_map});
  if (!is_vtk_name(files.output))
    throw UsageError("-o " + files.output.string() +
                     ": a velocity is an array of nodes, which files of VTK hold; name it " +
                     files.output.stem().string() + ".vtu");
}

DerivativeOutcome run_velocity(const VelocityCommand& command, const PipelineOptions& options) {
  const VelocityReport report = velocity_files(command.files, options);
  return {report.warnings, velocity_text(report),
          velocity_json(report, static_cast<int>(ExitCode::Done))};
}

}  // namespace

void add_velocity_command(CLI::App& app, Action& action) {
  const auto command = std::make_shared<VelocityCommand>();
  CLI::App* parser = app.add_subcommand("velocity", "write how a CAD parameter moves each node");
  parser->footer(help_end(
      {"velocity part.step plus.step minus.step part.vtu --step 0.1 -o speed.vtu",
       "velocity part.step p.step m.step part.vtu --step 0.1 --half p2.step m2.step -o speed.vtu"},
      {0, 1, 2, 3, 4, 6}));
  VelocityFiles& files = command->files;
  parser->add_option("BASE", files.base_cad, "STEP file the mesh was made for")->required();
  parser->add_option("PLUS", files.plus, "STEP file with the parameter larger by the step")
      ->required();
  parser->add_option("MINUS", files.minus, "STEP file with the parameter smaller by the step")
      ->required();
  parser->add_option("MESH", files.mesh, "mesh of BASE, of any format of 'cadmorph help formats'")
      ->required();
  parser->add_option("--step", files.step, "by which the parameter differs, in its own unit")
      ->check(positive_number())
      ->required();
  parser
      ->add_option("--half", command->half,
                   "models of half the step: a better velocity, and an estimate of its error")
      ->type_name("PLUS MINUS")
      ->expected(2);
  parser->add_option("-o,--output", files.output, "the mesh with the array cadmorph_velocity")
      ->type_name("OUT.vtu")
      ->required();
  add_timeout_option(*parser, files.read_cad);
  finish_derivative_command(
      *parser, action, command, [command = command.get()] { check(*command); },
      [command = command.get()](const PipelineOptions& given) {
        return run_velocity(*command, given);
      });
}

}  // namespace cadmorph
