#pragma once

#include "apps/options.h"

namespace cadmorph {

/// Exit codes of the program.
enum class ExitCode {
  Done = 0,
  Usage = 1,
  Input = 2,
  Topology = 3,
  Association = 4,
  Quality = 5,
  Resources = 6,
};

/// Carry out a parsed command line; print to stdout and stderr. Throw what the library throws.
ExitCode run_command(const CommandLine& line);

/// The code of an exception in flight.
ExitCode exit_code_of(const std::exception& error);

}  // namespace cadmorph
