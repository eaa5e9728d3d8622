#include <CLI/CLI.hpp>
#include <memory>

#include "apps/commands/command.h"
#include "apps/commands/help_format.h"
#include "apps/commands/options.h"
#include "apps/summary/json_report.h"
#include "apps/summary/summary.h"
#include "cad/step_reader.h"

namespace cadmorph {
namespace {

struct MatchCommand {
  std::filesystem::path base, variant;
  std::string face_map, json;
  CadReader read_cad = read_step;
  bool is_explained = false;
};

ExitCode run_match(const MatchCommand& command) {
  MatchOptions options;
  if (!command.face_map.empty()) options.given_faces = read_face_map(command.face_map);
  const MatchedModels cad =
      match_models(command.read_cad(command.base), command.read_cad(command.variant), options);
  std::string text = match_text(cad.base, cad.variant, cad.match);
  if (command.is_explained) text += cost_text(cad.match);
  hand_over(command.json, false, text, match_json(cad.base, cad.variant, cad.match));
  return ExitCode::Done;
}

}  // namespace

void add_match_command(CLI::App& app, Action& action) {
  const auto command = std::make_shared<MatchCommand>();
  CLI::App* parser = app.add_subcommand("match", "show which CAD face became which");
  parser->footer(
      help_end({"match part.step part_b.step", "match part.step part_b.step --map pairs.csv"},
               {0, 1, 2, 3, 6}));
  parser->add_option("BASE", command->base, "STEP file")->required();
  parser->add_option("VARIANT", command->variant, "STEP file")->required();
  add_face_map_option(*parser, command->face_map);
  parser->add_flag("--explain", command->is_explained,
                   "print what speaks against this match, and against the next best");
  add_timeout_option(*parser, command->read_cad);
  add_json_option(*parser, command->json);
  parser->callback([&action, command] {
    action.json = command->json;
    check_outputs({json_output(command->json)},
                  {command->base, command->variant, command->face_map});
    action.run = [command] { return run_match(*command); };
  });
}

}  // namespace cadmorph
