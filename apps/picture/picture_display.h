#pragma once

#include <sys/types.h>

namespace cadmorph {

/// A display to render on. VTK aborts the process when it finds no X server, even off-screen, and a
/// DISPLAY that is set may lead nowhere; so this starts an Xvfb of its own and points DISPLAY to
/// it. Where Xvfb is not installed or does not start, the DISPLAY of the environment is used as it
/// is. The server ends with this object, or with the process. Throws SolverError when there is
/// neither.
class PrivateDisplay {
 public:
  PrivateDisplay();
  ~PrivateDisplay();
  PrivateDisplay(const PrivateDisplay&) = delete;
  PrivateDisplay& operator=(const PrivateDisplay&) = delete;

 private:
  pid_t server_ = -1;
};

}  // namespace cadmorph
