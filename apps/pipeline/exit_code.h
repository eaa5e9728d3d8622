#pragma once

#include "core/errors.h"

namespace cadmorph {

/// The command line asks for something that does not exist or makes no sense.
class UsageError : public Error {
 public:
  using Error::Error;
};

/// Exit codes of the program.
enum class ExitCode {
  Done = 0,
  Usage = 1,
  Input = 2,
  Topology = 3,
  Association = 4,
  Quality = 5,
  Resources = 6,
  Different = 7,       ///< `compare`: the meshes differ
  PartialFailure = 8,  ///< `batch`: some variants failed
};

/// The code of what the library throws.
ExitCode exit_code_of(const std::exception& error);

}  // namespace cadmorph
