#include <CLI/CLI.hpp>
#include <memory>

#include "apps/batch/sensitivity_files.h"
#include "apps/commands/derivative_command.h"
#include "apps/commands/help_format.h"
#include "apps/pipeline/design_velocity.h"
#include "apps/summary/derivative_summary.h"

namespace cadmorph {
namespace {

namespace fs = std::filesystem;

struct GradientCommand : DerivativeCommand {
  fs::path base, mesh, parameters, sensitivity, output;
  CadReader read_cad;
  std::string array;
};

void check(const GradientCommand& command) {
  check_extension("-o", command.output, {".csv"});
  if (command.sensitivity.extension() == ".csv" && !command.array.empty())
    throw UsageError("--array names an array of a mesh file; " + command.sensitivity.string() +
                     " is a table, whose columns are Sensitivity_x, _y, _z");
  check_outputs({{"-o", command.output},
                 json_output(command.json),
                 {"--cache", command.options.pipeline.cache, false}},
                {command.base, command.mesh, command.parameters, command.sensitivity,
                 command.options.face_map});
}

DerivativeOutcome run_gradient(const GradientCommand& command, const PipelineOptions& options) {
  const ParameterFiles files{command.base, read_parameters(command.parameters), command.read_cad};
  const auto mesh = std::make_shared<const MeshFile>(command.mesh);
  const Sensitivity sensitivity = read_sensitivity(command.sensitivity, command.array, *mesh);
  const GradientReport report = gradient_files(files, mesh, sensitivity, options);
  if (!command.output.empty()) write_text(command.output, gradient_csv(report));
  return {report.warnings, gradient_text(report),
          gradient_json(report, static_cast<int>(ExitCode::Done))};
}

}  // namespace

void add_gradient_command(CLI::App& app, Action& action) {
  const auto command = std::make_shared<GradientCommand>();
  CLI::App* parser =
      app.add_subcommand("gradient", "dJ/dp of CAD parameters from dJ/dX of the nodes");
  parser->footer(
      help_end({"gradient wing.step wing.su2 parameters.csv --sensitivity surface_sens.csv",
                "gradient part.step part.vtu table.csv --sensitivity adjoint.vtu --array dJdX"},
               {0, 1, 2, 3, 4, 6}));
  parser->add_option("BASE", command->base, "STEP file the mesh was made for")->required();
  parser
      ->add_option("MESH", command->mesh, "mesh of BASE, of any format of 'cadmorph help formats'")
      ->required();
  parser
      ->add_option("PARAMETERS", command->parameters,
                   "table with the columns name,plus,minus,step: the STEP files with a parameter "
                   "larger and smaller by a step")
      ->required();
  parser
      ->add_option("--sensitivity", command->sensitivity,
                   "dJ/dX: SU2's surface table (.csv: PointID, x, y, z, Sensitivity_x, ...) or a "
                   "mesh file with an array")
      ->type_name("FILE")
      ->required();
  parser
      ->add_option("--array", command->array,
                   "name of the array (default: the only one with 3 components)")
      ->type_name("NAME");
  parser->add_option("-o,--output", command->output, "table of the gradient")->type_name("OUT.csv");
  add_timeout_option(*parser, command->read_cad);
  finish_derivative_command(
      *parser, action, command, [command = command.get()] { check(*command); },
      [command = command.get()](const PipelineOptions& given) {
        return run_gradient(*command, given);
      });
}

}  // namespace cadmorph
