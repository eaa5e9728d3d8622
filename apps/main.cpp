// cadmorph: the command line.

#include <CLI/CLI.hpp>
#include <algorithm>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <iostream>
#include <new>
#include <string>
#include <vector>

#include "apps/commands/command.h"
#include "apps/commands/help_format.h"
#include "apps/heap.h"
#include "apps/pipeline/output_file.h"
#include "apps/summary/json_report.h"
#include "apps/version.h"
#include "core/blas.h"
#include "core/interrupt.h"
#include "core/remedies.h"

namespace {

using namespace cadmorph;

constexpr const char* kDescription =
    "cadmorph: moves a simulation mesh from one CAD model onto a changed version of it.\n"
    "\n"
    "  cadmorph BASE.step VARIANT.step MESH [-o OUT] [options]\n"
    "  cadmorph quality MESH [options]\n"
    "  cadmorph match BASE.step VARIANT.step [options]\n"
    "  cadmorph batch BASE.step MESH VARIANT.step... -o DIR [options]\n"
    "  cadmorph field BASE.step VARIANT.step MESH -o FIELD.cmf [options]\n"
    "  cadmorph apply FIELD.cmf MESH [-o OUT] [options]\n"
    "  cadmorph velocity BASE.step PLUS.step MINUS.step MESH --step H -o OUT.vtu [options]\n"
    "  cadmorph gradient BASE.step MESH PARAMETERS.csv --sensitivity FILE [options]\n"
    "  cadmorph compare REFERENCE MESH [options]\n"
    "  cadmorph help exit-codes [CODE] | formats | choosing | limits | COMMAND\n"
    "\n"
    "Both STEP files must have the same topology; MESH is the mesh of the first, in the format it\n"
    "has (VTK, SU2, OpenFOAM, gmsh, CalculiX, CGNS, ...: cadmorph help formats), and so is OUT.\n"
    "The result has the same elements, each surface node on the new CAD.";

void name_remedies() {
  set_remedy_words(
      {{Remedy::MeshUnit, "--mesh-unit"},
       {Remedy::AssociationTolerance, "--association-tolerance"},
       {Remedy::Snap, "--snap"},
       {Remedy::Unmatched, "--unmatched"},
       {Remedy::KeepUnmatched, "--unmatched auto or fix"},
       {Remedy::SlideUnmatched, "--slide NAME or --unmatched slide"},
       {Remedy::ExpectUnmatched, "--unmatched fix or slide, or --slide, --hold, --follow NAME"},
       {Remedy::Method, "another --method"},
       {Remedy::RbfMethod, "--method rbf"},
       {Remedy::ListPairs, "'cadmorph match'"},
       {Remedy::FaceMap, "--map"},
       {Remedy::Via, "--via"},
       {Remedy::Improve, "--improve"},
       {Remedy::MoreSteps, "--steps 4"},
       {Remedy::KeepLayers, "--keep-layers"},
       {Remedy::InvertedInput, "--accept-inverted-input"},
       {Remedy::AutomaticUntangling, "--untangle auto"},
       {Remedy::AutomaticSteps, "--steps auto"},
       {Remedy::Cache, "--cache"},
       {Remedy::AllFigures, "--json"}});
}

// An older report would tell of success. What is none may be an input, and stays; where the outputs
// are what is wrong, none is made.
void replace_report(const std::string& file, ExitCode code, const std::string& report) {
  try {
    std::error_code error;
    const bool is_there = std::filesystem::exists(file, error);
    const bool is_of_outputs = code == ExitCode::Usage || code == ExitCode::Resources;
    if (is_there ? !is_json_report(read_bytes(file)) : is_of_outputs) return;
    write_text(file, report);
  } catch (const std::exception&) {  // it may be the reason
  }
}

// Ends at once: without memory a thread of OpenBLAS asks for its buffer for ever, and exit waits
// for it.
[[noreturn]] void fail(const std::string& message, ExitCode code, const std::string& json) {
  std::fprintf(stderr, "cadmorph: error: %s\n", message.c_str());
  if (code != ExitCode::Usage) std::fputs(troubleshooting_line(code).c_str(), stderr);
  const int number = static_cast<int>(code);
  if (json == "-")
    std::fputs(error_json(message, number).c_str(), stdout);
  else if (!json.empty())
    replace_report(json, code, error_json(message, number));
  std::cout.flush();
  std::fflush(nullptr);
  std::_Exit(number);
}

// For the first option that is none: one that is spelled nearly so.
std::string suggestion(const CLI::App& app, int argc, char** argv) {
  const auto chosen = app.get_subcommands();
  const CLI::App& parser = chosen.empty() ? app : *chosen.front();
  std::vector<std::string> known;
  for (const CLI::Option* option : parser.get_options())
    for (const std::string& name : option->get_lnames()) known.push_back("--" + name);
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    const std::string name = word.substr(0, word.find('='));
    if (name.starts_with("--") && std::ranges::find(known, name) == known.end())
      return did_you_mean(name, known);
  }
  return {};
}

// The words after the program's name, the last one first. "help COMMAND" is "COMMAND --help".
std::vector<std::string> reversed_words(const CLI::App& app, int argc, char** argv) {
  std::vector<std::string> words(argv + 1, argv + argc);
  const auto is_named = [&](const CLI::App* command) { return command->get_name() == words[1]; };
  if (words.size() == 2 && words[0] == "help" &&
      std::ranges::any_of(app.get_subcommands({}), is_named))
    words = {words[1], "--help"};
  std::ranges::reverse(words);
  return words;
}

// Fills `action`; leaves it empty when help or the version was asked for, which are then printed.
void parse(int argc, char** argv, Action& action) {
  CLI::App app(kDescription, "cadmorph");
  app.set_version_flag("--version", std::string("cadmorph ") + kVersion);
  app.formatter(help_formatter());
  app.footer(help_end(
      {"wing.step wing_thick.step wing.vtu -o wing_thick.vtu",
       "part.step part_b.step part.vtu --mesh-unit m --report part_b.html",
       "part.step part_b.step part.vtu --min-scaled-jacobian 0.1 --improve 0.2", "batch --help"},
      {0, 1, 2, 3, 4, 5, 6}));
  add_morph_command(app, action);
  add_quality_command(app, action);
  add_match_command(app, action);
  add_batch_command(app, action);
  add_field_command(app, action);
  add_apply_command(app, action);
  add_velocity_command(app, action);
  add_gradient_command(app, action);
  add_compare_command(app, action);
  add_help_command(app, action);
  try {
    app.parse(reversed_words(app, argc, argv));
  } catch (const CLI::Success& request) {
    app.exit(request);
    if (!std::cout.flush()) throw OutputError("can't write to the standard output");
  } catch (const CLI::ExtrasError& error) {
    throw UsageError(std::string(error.what()) + suggestion(app, argc, argv) +
                     " (see cadmorph --help)");
  } catch (const CLI::ParseError& error) {
    throw UsageError(std::string(error.what()) + " (see cadmorph --help)");
  }
}

// OpenCASCADE's own exceptions and threads that can't start come to this.
[[noreturn]] void end_unexpectedly() {
  std::fputs(
      "cadmorph: error: it ended unexpectedly; mostly a limit of the system (ulimit -a) leaves it "
      "no memory or no threads\n",
      stderr);
  std::_Exit(static_cast<int>(ExitCode::Resources));
}

}  // namespace

int main(int argc, char** argv) {
  std::set_terminate(end_unexpectedly);
  use_fitting_blas_kernel();
  set_up_heap();
  name_remedies();
  // A full disk or a file size limit is an error to report, not a signal to die from.
  std::signal(SIGXFSZ, SIG_IGN);
  remove_temporaries_at_interrupt();
  Action action;
  try {
    parse(argc, argv, action);
    if (!action.run) return 0;
    return static_cast<int>(action.run());
  } catch (const std::bad_alloc&) {
    fail("out of memory; free some, or use a smaller mesh", ExitCode::Resources, action.json);
  } catch (const std::exception& error) {
    fail(error.what(), exit_code_of(error), action.json);
  }
}
