// cadmorph-bench: compares morphing methods, kernels and solvers on the model families.

#include <CLI/CLI.hpp>
#include <cstdio>

#include "apps/bench/evaluate.h"
#include "apps/blas_restart.h"
#include "apps/exit_code.h"
#include "core/errors.h"
#include "core/parallel.h"

namespace {

using namespace cadmorph;
using namespace cadmorph::bench;

struct CommandLine {
  EvaluateOptions evaluate;
  int threads = 0;
};

void add_selection(CLI::App& app, EvaluateOptions& options) {
  app.add_option("MODELS", options.models, "folder of families, as models/generate.sh makes it")
      ->required();
  app.add_option("-o,--output", options.output, "CSV file; series it holds already are kept")
      ->required();
  app.add_option("--family", options.families, "only these families");
  app.add_option("--mesh", options.meshes, "only these meshes: hex, tet, ...");
}

void add_evaluate(CLI::App& app, CommandLine& line) {
  CLI::App* command = app.add_subcommand(
      "evaluate", "morphs every mesh to steps 1..20 by every method, absolutely and relatively");
  add_selection(*command, line.evaluate);
  command->add_option("--method", line.evaluate.methods, "only these methods, named as in the CSV");
  command->callback([&line] { evaluate(line.evaluate); });
}

}  // namespace

int main(int argc, char** argv) {
  restart_with_fitting_blas(argv);
  CommandLine line;
  line.evaluate.tell = [](const std::string& text) { std::fprintf(stderr, "%s\n", text.c_str()); };
  CLI::App app("cadmorph-bench: compares morphing methods, kernels and solvers on model families.",
               "cadmorph-bench");
  app.require_subcommand(1);
  app.add_option_function<int>(
         "--threads", [](int count) { set_thread_count(count); },
         "number of threads (default: all processors)")
      ->check(CLI::PositiveNumber);
  add_evaluate(app, line);
  try {
    app.parse(argc, argv);
    return 0;
  } catch (const CLI::Success& request) {
    return app.exit(request);
  } catch (const CLI::ParseError& error) {
    app.exit(error);
    return static_cast<int>(ExitCode::Usage);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "cadmorph-bench: error: %s\n", error.what());
    return static_cast<int>(exit_code_of(error));
  }
}
