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
  std::string json;  ///< file for the report, "-" for stdout, empty for none
};

// Each adds its command to the program; parsing then fills `action`, or throws UsageError.
void add_morph_command(CLI::App& app, Action& action);
void add_quality_command(CLI::App& app, Action& action);
void add_match_command(CLI::App& app, Action& action);
void add_batch_command(CLI::App& app, Action& action);
void add_field_command(CLI::App& app, Action& action);
void add_apply_command(CLI::App& app, Action& action);
void add_velocity_command(CLI::App& app, Action& action);
void add_gradient_command(CLI::App& app, Action& action);
void add_compare_command(CLI::App& app, Action& action);
void add_help_command(CLI::App& app, Action& action);

/// Which command says more about an exit code, as a line for stderr.
std::string troubleshooting_line(ExitCode code);

/// Writes to stdout. Throws OutputError.
void print(const std::string& text);

/// Prints warnings to stderr.
void warn(const std::vector<std::string>& warnings);

/// Prints the summary, unless quiet, or writes the report where `json` says.
void hand_over(const std::string& json, bool is_quiet, const std::string& summary,
               const std::string& report);

/// A file that a command is to write.
struct Output {
  const char* option;          ///< that names it
  std::filesystem::path file;  ///< empty: not asked for
  bool is_needed = true;       ///< the command fails where it can't be written
};

/// The report that `json` asks for.
Output json_output(const std::string& json);

/// Puts the files that the user named into their order: base CAD, variants, mesh. Where just one of
/// them is no STEP file, that is the mesh, wherever it stands. `files` are in the order of the
/// command's usage; returns whether the mesh stood elsewhere than at `mesh_place`.
bool order_inputs(std::vector<std::filesystem::path>& files, std::size_t mesh_place);

/// ", did you mean 'quality'?" for the candidate that differs from `word` by a slip or two; else
/// empty.
std::string did_you_mean(const std::string& word, const std::vector<std::string>& candidates);

/// Refuses a name whose extension says another kind of file than the one that an option writes.
/// Throws UsageError.
void check_extension(const char* option, const std::filesystem::path& file,
                     std::initializer_list<const char*> extensions);

/// Refuses, before any work, outputs that would take the place of an input or of each other
/// (UsageError), and needed ones that can't be written (OutputError). Empty inputs are left out.
void check_outputs(const std::vector<Output>& outputs,
                   const std::vector<std::filesystem::path>& inputs);

/// What the user should know of a mesh file (see MeshFile::remarks), the file named.
std::vector<std::string> mesh_remarks(const std::filesystem::path& mesh,
                                      const std::vector<std::string>& remarks);

/// Refuses a name for a moved mesh that is not of the mesh's format. Throws UsageError.
void check_format(const std::filesystem::path& output, const std::filesystem::path& mesh);

}  // namespace cadmorph
