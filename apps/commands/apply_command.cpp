#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>

#include "apps/commands/command.h"
#include "apps/commands/help_format.h"
#include "apps/commands/options.h"
#include "apps/pipeline/field_files.h"
#include "apps/summary/field_summary.h"
#include "apps/summary/summary.h"
#include "apps/summary/text_table.h"
#include "core/length_units.h"
#include "core/parallel.h"

namespace cadmorph {
namespace {

namespace fs = std::filesystem;

struct ApplyCommand {
  fs::path field, mesh, output;
  std::string mesh_unit;
  std::string json;
  bool is_quiet = false;
  int threads = 0;  ///< 0: all
};

void check_files(const ApplyCommand& command) {
  check_outputs(
      {{"-o", command.output}, {"-o", failed_path(command.output)}, json_output(command.json)},
      {command.field, command.mesh});
  check_format(command.output, command.mesh);
}

void warn(const ApplyReport& report) {
  for (const std::string& remark : mesh_remarks(report.mesh, report.remarks))
    std::fprintf(stderr, "cadmorph: warning: %s\n", remark.c_str());
  if (report.outside == 0) return;
  std::fprintf(stderr,
               "cadmorph: warning: %s of %s points lie outside the box of %s, for which the field "
               "was made: it is extrapolated there; should they not, check that the unit is %s\n",
               with_commas(report.outside).c_str(), with_commas(report.nodes).c_str(),
               report.field.mesh.c_str(), unit_name(report.field.mesh_unit_mm).c_str());
}

ExitCode run_apply(const ApplyCommand& command) {
  set_thread_count(command.threads);
  const ApplyReport report =
      apply_files(command.field, command.mesh, command.output,
                  command.mesh_unit.empty() ? 0.0 : parse_unit(command.mesh_unit));
  if (!command.is_quiet) warn(report);
  const ExitCode code = report.bad_cells.empty() ? ExitCode::Done : ExitCode::Quality;
  hand_over(command.json, command.is_quiet, apply_text(report),
            apply_json(report, static_cast<int>(code)));
  if (code != ExitCode::Done)
    std::fprintf(stderr,
                 "cadmorph: error: %s %s inverted, the first is cell %lld; the refused mesh is %s "
                 "(cell array cadmorph_bad)\n",
                 with_commas(static_cast<long long>(report.bad_cells.size())).c_str(),
                 report.bad_cells.size() == 1 ? "element is" : "elements are",
                 static_cast<long long>(report.bad_cells.front()), report.written.c_str());
  return code;
}

}  // namespace

void add_apply_command(CLI::App& app, Action& action) {
  const auto command = std::make_shared<ApplyCommand>();
  CLI::App* parser = app.add_subcommand("apply", "move the points of a mesh by a field file");
  parser->footer(
      help_end({"apply thick.cmf finer.vtu -o finer_thick.vtu", "apply thick.cmf sensors.vtu"},
               {0, 1, 2, 5, 6}));
  parser->add_option("FIELD", command->field, "file written by cadmorph field")->required();
  parser->add_option("MESH", command->mesh, "mesh or points to move, of any format")->required();
  parser
      ->add_option("--mesh-unit", command->mesh_unit,
                   "length unit of MESH (default: the field's, or detected by the box)")
      ->type_name("mm|cm|m|inch|foot|NUMBER");
  parser->add_option("-o,--output", command->output, "moved mesh (default: <stem>.morphed.<ext>)")
      ->type_name("OUT");
  add_json_option(*parser, command->json);
  parser->add_flag("--quiet", command->is_quiet, "print errors only");
  add_threads_option(*parser, command->threads);
  parser->callback([&action, command] {
    action.json = command->json;
    if (command->output.empty()) command->output = default_output(command->mesh);
    check_files(*command);
    action.run = [command] { return run_apply(*command); };
  });
}

}  // namespace cadmorph
