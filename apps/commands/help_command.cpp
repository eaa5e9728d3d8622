#include <CLI/CLI.hpp>
#include <memory>

#include "apps/commands/command.h"
#include "apps/commands/help_format.h"
#include "apps/help_text.h"

namespace cadmorph {
namespace {

constexpr const char* kTopic = "exit-codes";

struct HelpCommand {
  std::string topic;
  int code = 0;  ///< 0: all
};

// What docs/troubleshooting.md says of an exit code; of all for 0.
std::string section(int code) {
  const std::string text(kTroubleshooting);
  if (code == 0) return text;
  const auto begin = text.find("## Exit code " + std::to_string(code) + ":");
  if (begin == std::string::npos) return "";
  return text.substr(begin, text.find("\n## ", begin) - begin) + "\n";
}

}  // namespace

void add_help_command(CLI::App& app, Action& action) {
  const auto command = std::make_shared<HelpCommand>();
  CLI::App* parser = app.add_subcommand(
      "help", "tell what exit codes mean and what to do, or what a command takes");
  parser->footer(help_end({"help exit-codes", "help exit-codes 4", "help batch"}, {0, 1}));
  parser->add_option("TOPIC", command->topic,
                     std::string("the topic: ") + kTopic + ", or a command");
  parser->add_option("CODE", command->code, "one of the exit codes (default: all)");
  parser->callback([&action, command] {
    if (command->topic.empty()) throw CLI::CallForHelp();
    if (command->topic != kTopic)
      throw UsageError("there is no help on '" + command->topic + "'" +
                       did_you_mean(command->topic, {kTopic}) + " (see cadmorph --help)");
    const std::string text = section(command->code);
    if (text.empty())
      throw UsageError("there is no exit code " + std::to_string(command->code) +
                       " to explain; see cadmorph help exit-codes");
    action.run = [text] {
      print(text);
      return ExitCode::Done;
    };
  });
}

}  // namespace cadmorph
