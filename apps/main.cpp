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

}  // namespace

int main(int argc, char** argv) {
  // A full disk or a file size limit is an error to report, not a signal to die from.
  std::signal(SIGXFSZ, SIG_IGN);
  std::string json;
  try {
    const std::optional<CommandLine> line = parse_command_line(argc, argv);
    if (!line) return 0;
    json = line->json;
    if (line->command == Command::Morph) restart_with_fitting_blas(argv);
    return static_cast<int>(run_command(*line));
  } catch (const std::bad_alloc&) {
    return fail("out of memory; free some, or use a smaller mesh", ExitCode::Resources, json);
  } catch (const std::exception& error) {
    return fail(error.what(), exit_code_of(error), json);
  }
}
