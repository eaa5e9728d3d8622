#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "apps/pipeline/exit_code.h"

namespace CLI {
class App;
}

namespace cadmorph {

/// What the command line asked for.
struct Action {
  std::function<ExitCode()> run;
  std::string json;              ///< file for the report, "-" for stdout, empty for none
  bool needs_fast_blas = false;  ///< large dense systems
};

// Each adds its command to the program; parsing then fills `action`, or throws UsageError.
void add_morph_command(CLI::App& app, Action& action);
void add_quality_command(CLI::App& app, Action& action);
void add_match_command(CLI::App& app, Action& action);
void add_batch_command(CLI::App& app, Action& action);
void add_field_command(CLI::App& app, Action& action);
void add_apply_command(CLI::App& app, Action& action);
void add_compare_command(CLI::App& app, Action& action);

/// Where the docs say more about an exit code, as a line for stderr.
std::string troubleshooting_line(ExitCode code);

/// Writes to stdout. Throws OutputError.
void print(const std::string& text);

/// Prints the summary, unless quiet, or writes the report where `json` says.
void hand_over(const std::string& json, bool is_quiet, const std::string& summary,
               const std::string& report);

/// Refuses a report that can't be written or would replace an input. Throws what check_output does.
void check_json_output(const std::string& json, const std::vector<std::filesystem::path>& inputs);

}  // namespace cadmorph
