#pragma once

#include <gmsh.h>

#include <string>

#include "core/errors.h"

namespace cadmorph::models {

/// gmsh, silent and on one thread, from construction to destruction; one at a time.
class GmshScope {
 public:
  GmshScope() {
    gmsh::initialize();
    gmsh::option::setNumber("General.Terminal", 0);
    gmsh::option::setNumber("General.NumThreads", 1);
  }
  ~GmshScope() { gmsh::finalize(); }
  GmshScope(const GmshScope&) = delete;
  GmshScope& operator=(const GmshScope&) = delete;
};

/// Returns what `work` returns, done with gmsh. Throws InvalidInputError, naming `what` was to be
/// meshed, when it fails.
template <class Work>
auto with_gmsh(const std::string& what, const Work& work) {
  const GmshScope scope;
  const auto text = [&](const std::string& error) {
    return "gmsh can't mesh " + what + ": " + error;
  };
  try {
    return work();
  } catch (const std::string& error) {  // gmsh's own
    throw InvalidInputError(text(error));
  } catch (const std::exception& error) {
    throw InvalidInputError(text(error.what()));
  }
}

}  // namespace cadmorph::models
