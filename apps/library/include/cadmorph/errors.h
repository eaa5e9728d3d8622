#pragma once

#include <exception>

#include "api.h"
// Error, a std::runtime_error, and InvalidInputError, IoError, CadError, TopologyError,
// AssociationError, SolverError, QualityError: all derived from it.
#include "core/errors.h"

namespace cadmorph {

/// A result can't be written.
class OutputError : public Error {
 public:
  using Error::Error;
};

/// A progress callback asked to stop.
class CancelledError : public Error {
 public:
  using Error::Error;
};

}  // namespace cadmorph

namespace cadmorph::CADMORPH_V1 {

/// The exit code that the program ends with after this error (README.md): 2 an input, 3 the CAD
/// models do not correspond, 4 the mesh does not lie on the base, 5 quality, 6 all else.
int exit_code(const std::exception& error);

}  // namespace cadmorph::CADMORPH_V1
