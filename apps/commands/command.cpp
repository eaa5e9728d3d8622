#include "apps/commands/command.h"

#include <cstdio>

#include "apps/pipeline/output_file.h"

namespace cadmorph {

std::string troubleshooting_line(ExitCode code) {
  return "cadmorph: more under \"Exit code " + std::to_string(static_cast<int>(code)) +
         "\" in docs/troubleshooting.md\n";
}

void print(const std::string& text) {
  if (std::fwrite(text.data(), 1, text.size(), stdout) != text.size() || std::fflush(stdout) != 0)
    throw OutputError("can't write to the standard output");
}

void hand_over(const std::string& json, bool is_quiet, const std::string& summary,
               const std::string& report) {
  if (!json.empty() && json != "-") write_text(json, report);
  if (json == "-")
    print(report);
  else if (!is_quiet)
    print(summary);
}

void check_json_output(const std::string& json, const std::vector<std::filesystem::path>& inputs) {
  if (json.empty() || json == "-") return;
  check_output(json, inputs);
}

}  // namespace cadmorph
