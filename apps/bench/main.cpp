// cadmorph-bench: compares morphing methods, kernels and solvers on the model families.

#include <CLI/CLI.hpp>
#include <cstdio>

#include "apps/bench/demonstrations.h"
#include "apps/bench/evaluate.h"
#include "apps/bench/kernels.h"
#include "apps/bench/solvers.h"
#include "apps/pipeline/exit_code.h"
#include "core/blas.h"
#include "core/errors.h"

namespace {

using namespace cadmorph;
using namespace cadmorph::bench;

struct CommandLine {
  EvaluateOptions options;
  std::filesystem::path demonstrations;
  std::string solver;
};

CLI::App* add_command(CLI::App& app, const std::string& name, const std::string& description,
                      EvaluateOptions& options) {
  CLI::App* command = app.add_subcommand(name, description);
  command->add_option("MODELS", options.models, "folder of families, see models/generate.sh")
      ->required();
  command->add_option("-o,--output", options.output, "CSV file; rows it holds already are kept")
      ->required();
  command->add_option("--family", options.families, "only these families");
  command->add_option("--mesh", options.meshes, "only these meshes: hex, tet, ...");
  return command;
}

void add_commands(CLI::App& app, CommandLine& line) {
  EvaluateOptions& options = line.options;
  CLI::App* methods =
      add_command(app, "evaluate", "every method at all steps, absolute and relative", options);
  methods->add_option("--method", options.methods, "only these methods, named as in the CSV");
  methods->add_option("--surface", options.surfaces, "only these surfaces: RBF-S, harmonic");
  methods->add_option("--mode", options.modes, "only these: absolute, relative");
  methods
      ->add_option("--every", options.stride,
                   "absolute, and the default on relative ways: every N-th step alone")
      ->check(CLI::IsMember({1, 2, 4, 5, 10, 20}));
  methods->add_option("--to", options.last, "the last step; 30 is 150 % of the full change")
      ->check(CLI::Range(1, 99))
      ->capture_default_str();
  methods->callback([&line] { evaluate(line.options); });
  add_command(app, "kernels", "every kernel at the full change, with condition numbers", options)
      ->callback([&line] { evaluate_kernels(line.options); });
  add_command(app, "solvers", "every solver at the full change: seconds and memory", options)
      ->callback([&line] { compare_solvers(line.options, "cadmorph-bench"); });
  CLI::App* one = add_command(app, "run-solver", "one solver, for `solvers`", options)->group("");
  one->add_option("--solver", line.solver)->required();
  one->callback([&line] { run_solver(line.options, line.solver); });
  CLI::App* demonstrations =
      app.add_subcommand("demonstrations", "data of the two-dimensional demonstrations");
  demonstrations->add_option("-o,--output", line.demonstrations, "folder")->required();
  demonstrations->callback([&line] { write_demonstrations(line.demonstrations); });
}

}  // namespace

int main(int argc, char** argv) {
  use_fitting_blas_kernel();
  CommandLine line;
  line.options.tell = [](const std::string& text) { std::fprintf(stderr, "%s\n", text.c_str()); };
  CLI::App app("cadmorph-bench: compares morphing methods, kernels and solvers on model families.",
               "cadmorph-bench");
  app.require_subcommand(1);
  add_commands(app, line);
  try {
    app.parse(argc, argv);
    return 0;
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : static_cast<int>(ExitCode::Usage);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "cadmorph-bench: error: %s\n", error.what());
    return static_cast<int>(exit_code_of(error));
  }
}
