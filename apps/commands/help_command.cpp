#include <CLI/CLI.hpp>
#include <algorithm>
#include <memory>
#include <string>
#include <vector>

#include "apps/commands/command.h"
#include "apps/commands/help_format.h"
#include "apps/help_text.h"

namespace cadmorph {
namespace {

struct HelpCommand {
  std::string topic;
  int code = 0;  ///< 0: all
};

// What the page says of one exit code.
std::string section(const std::string& page, int code) {
  const auto begin = page.find("## Exit code " + std::to_string(code) + ":");
  if (begin == std::string::npos)
    throw UsageError("there is no exit code " + std::to_string(code) +
                     " to explain; see cadmorph help " + std::string(kHelpTopics.front().name));
  return page.substr(begin, page.find("\n## ", begin) - begin) + "\n";
}

std::vector<std::string> topic_names() {
  std::vector<std::string> names;
  for (const HelpTopic& topic : kHelpTopics) names.emplace_back(topic.name);
  return names;
}

std::string listed(const std::vector<std::string>& names) {
  std::string text;
  for (const std::string& name : names) text += name + ", ";
  return text;
}

std::string text_of(const HelpCommand& command) {
  const auto* const topic = std::ranges::find(kHelpTopics, command.topic, &HelpTopic::name);
  if (topic == kHelpTopics.end())
    throw UsageError("there is no help on '" + command.topic + "'" +
                     did_you_mean(command.topic, topic_names()) + " (see cadmorph help --help)");
  const std::string text(topic->text);
  if (command.code == 0) return text;
  if (topic != kHelpTopics.begin())
    throw UsageError("cadmorph help " + command.topic + " takes no number");
  return section(text, command.code);
}

}  // namespace

void add_help_command(CLI::App& app, Action& action) {
  const auto command = std::make_shared<HelpCommand>();
  CLI::App* parser =
      app.add_subcommand("help", "tell of exit codes, formats, choices, limits, or a command");
  parser->footer(help_end(
      {"help exit-codes", "help exit-codes 4", "help formats", "help choosing", "help batch"},
      {0, 1}));
  parser->add_option("TOPIC", command->topic,
                     "the topic: " + listed(topic_names()) + "or a command");
  parser->add_option("CODE", command->code, "one of the exit codes (default: all)");
  parser->callback([&action, command] {
    if (command->topic.empty()) throw CLI::CallForHelp();
    action.run = [text = text_of(*command)] {
      print(text);
      return ExitCode::Done;
    };
  });
}

}  // namespace cadmorph
