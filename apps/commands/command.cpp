#include "apps/commands/command.h"

#include <cstdio>

#include "apps/pipeline/output_file.h"
#include "core/formats/mesh_format.h"

namespace cadmorph {
namespace {

namespace fs = std::filesystem;

void check_clashes(const std::vector<Output>& outputs, const std::vector<fs::path>& inputs) {
  for (auto output = outputs.begin(); output != outputs.end(); ++output) {
    if (output->file.empty()) continue;
    for (const fs::path& input : inputs)
      if (!input.empty() && is_same_file(output->file, input))
        throw UsageError("the output " + output->file.string() +
                         " is one of the inputs; name another file with " + output->option);
    for (auto other = outputs.begin(); other != output; ++other)
      if (!other->file.empty() && is_same_file(output->file, other->file))
        throw UsageError("two outputs (" + std::string(other->option) + ", " + output->option +
                         ") can't both go to " + output->file.string());
  }
}

}  // namespace

std::string troubleshooting_line(ExitCode code) {
  return "cadmorph: more under \"Exit code " + std::to_string(static_cast<int>(code)) +
         "\" in troubleshooting.md of the documentation\n";
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

Output json_output(const std::string& json) {
  return {.option = "--json", .file = json == "-" ? fs::path() : fs::path(json)};
}

void check_outputs(const std::vector<Output>& outputs, const std::vector<fs::path>& inputs) {
  check_clashes(outputs, inputs);
  for (const Output& output : outputs)
    if (output.is_needed && !output.file.empty()) check_output(output.file, {});
}

std::vector<std::string> mesh_remarks(const fs::path& mesh,
                                      const std::vector<std::string>& remarks) {
  std::vector<std::string> lines;
  for (const std::string& remark : remarks) lines.push_back(mesh.string() + ": " + remark);
  return lines;
}

void check_format(const fs::path& output, const fs::path& mesh) {
  try {
    check_copy_name(mesh, output);
  } catch (const InvalidInputError& error) {
    throw UsageError(error.what());
  }
}

}  // namespace cadmorph
