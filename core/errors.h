#pragma once

#include <stdexcept>
#include <string>

namespace cadmorph {

/// Root of everything the library throws on purpose. The text says what went wrong, where (file,
/// node, face, value), likely why, and what to do next; the programs turn each type into its own
/// exit code.
class Error : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// An argument or an input violates its contract: sizes, finiteness, duplicates, empty sets.
class InvalidInputError : public Error {
 public:
  using Error::Error;
};

/// A file can't be read or written.
class IoError : public Error {
 public:
  using Error::Error;
};

/// CAD geometry can't be read or evaluated.
class CadError : public Error {
 public:
  using Error::Error;
};

/// Two CAD models do not correspond entity by entity.
class TopologyError : public Error {
 public:
  using Error::Error;
};

/// The mesh does not lie on the base CAD.
class AssociationError : public Error {
 public:
  using Error::Error;
};

/// A linear system can't be solved to the asked accuracy, or resources ran out.
class SolverError : public Error {
 public:
  using Error::Error;
};

/// The morphed mesh is not fit for use: inverted elements, or quality below what was asked.
class QualityError : public Error {
 public:
  using Error::Error;
};

}  // namespace cadmorph
