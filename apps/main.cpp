// cadmorph: the command line.

#include <csignal>
#include <cstdio>
#include <new>
#include <optional>

#include "apps/blas_restart.h"
#include "apps/commands.h"
#include "apps/json_report.h"

namespace {

using namespace cadmorph;

int fail(const std::string& message, ExitCode code, const std::string& json) {
  std::fprintf(stderr, "cadmorph: error: %s\n", message.c_str());
  const int number = static_cast<int>(code);
  if (json == "-") std::fputs(error_json(message, number).c_str(), stdout);
  return number;
}

// Starting anew costs a twentieth of a second: worth it for large dense systems alone.
bool needs_fast_blas(const CommandLine& line) {
  const VolumeMorphOptions& volume = line.pipeline.volume;
  const bool is_iterative = volume.rbf.solver == SolverKind::Fast ||
                            (volume.rbf.solver == SolverKind::Auto && volume.kernel.order == 3 &&
                             volume.kernel.kind == KernelKind::Polyharmonic);
  return line.command == Command::Morph && !is_iterative;
}

}  // namespace

int main(int argc, char** argv) {
  // A full disk or a file size limit is an error to report, not a signal to die from.
  std::signal(SIGXFSZ, SIG_IGN);
  std::string json;
  try {
    const std::optional<CommandLine> line = parse_command_line(argc, argv);
    if (!line) return 0;
    json = line->json;
    if (needs_fast_blas(*line)) restart_with_fitting_blas(argv);
    return static_cast<int>(run_command(*line));
  } catch (const std::bad_alloc&) {
    return fail("out of memory; free some, or use a smaller mesh", ExitCode::Resources, json);
  } catch (const std::exception& error) {
    return fail(error.what(), exit_code_of(error), json);
  }
}
