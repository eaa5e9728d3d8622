#pragma once

#include <gmsh.h>

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

}  // namespace cadmorph::models
