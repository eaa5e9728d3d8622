#include "apps/commands/command.h"

#include <algorithm>
#include <cstdio>

#include "apps/pipeline/output_file.h"
#include "cad/step_reader.h"
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

// Letters to insert, delete, replace or swap with the next (optimal string alignment).
std::size_t edit_distance(const std::string& a, const std::string& b) {
  std::vector<std::vector<std::size_t>> d(a.size() + 1, std::vector<std::size_t>(b.size() + 1));
  for (std::size_t i = 0; i <= a.size(); ++i)
    for (std::size_t j = 0; j <= b.size(); ++j) {
      if (i == 0 || j == 0) {
        d[i][j] = i + j;
        continue;
      }
      const std::size_t replaced = d[i - 1][j - 1] + (a[i - 1] == b[j - 1] ? 0 : 1);
      d[i][j] = std::min({d[i - 1][j] + 1, d[i][j - 1] + 1, replaced});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1])
        d[i][j] = std::min(d[i][j], d[i - 2][j - 2] + 1);
    }
  return d[a.size()][b.size()];
}

}  // namespace

std::string did_you_mean(const std::string& word, const std::vector<std::string>& candidates) {
  constexpr std::size_t kMostSlips = 2;  // with three, short words are alike
  std::size_t least = kMostSlips + 1;
  std::string best;
  for (const std::string& candidate : candidates) {
    const std::size_t distance = edit_distance(word, candidate);
    if (distance >= least || distance >= candidate.size()) continue;
    least = distance;
    best = candidate;
  }
  return best.empty() ? "" : ", did you mean '" + best + "'?";
}

std::string troubleshooting_line(ExitCode code) {
  return "cadmorph: what to do about it: cadmorph help exit-codes " +
         std::to_string(static_cast<int>(code)) + "\n";
}

void print(const std::string& text) {
  if (std::fwrite(text.data(), 1, text.size(), stdout) != text.size() || std::fflush(stdout) != 0)
    throw OutputError("can't write to the standard output");
}

void warn(const std::vector<std::string>& warnings) {
  for (const std::string& warning : warnings)
    std::fprintf(stderr, "cadmorph: warning: %s\n", warning.c_str());
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

bool order_inputs(std::vector<fs::path>& files, std::size_t mesh_place) {
  const auto is_other = [](const fs::path& file) {
    std::error_code error;
    return fs::exists(file, error) && !is_step_file(file);
  };
  const auto mesh = std::ranges::find_if(files, is_other);
  const auto is_step = [](const fs::path& file) { return is_step_file(file); };
  if (mesh == files.end() || mesh == files.begin() + std::ptrdiff_t(mesh_place) ||
      std::ranges::count_if(files, is_step) + 1 != std::ssize(files))
    return false;
  const fs::path moved = *mesh;
  files.erase(mesh);
  files.insert(files.begin() + std::ptrdiff_t(mesh_place), moved);
  return true;
}

void check_extension(const char* option, const fs::path& file,
                     std::initializer_list<const char*> extensions) {
  if (file.empty() || file.extension().empty()) return;
  std::string known;
  for (const char* extension : extensions) {
    if (file.extension() == extension) return;
    known += (known.empty() ? "" : " or ") + std::string(extension);
  }
  throw UsageError(std::string(option) + " writes " + known + ", not " + file.extension().string() +
                   ": name the file " + file.stem().string() + *extensions.begin());
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
