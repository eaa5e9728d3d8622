#include "apps/blas_restart.h"

#include <unistd.h>

#include <cstdlib>

#include "core/blas.h"

namespace cadmorph {

void restart_with_fitting_blas(char** argv) {
  constexpr const char* kCoreType = "OPENBLAS_CORETYPE";
  constexpr const char* kGuard = "CADMORPH_BLAS_CHOSEN";
  if (std::getenv(kGuard) || std::getenv(kCoreType)) return;
  const BlasInfo info = blas_info();
  if (info.suggested.empty()) return;
  setenv(kCoreType, info.suggested.c_str(), 1);
  setenv(kGuard, "1", 1);
  execv("/proc/self/exe", argv);
  // Not possible here: go on with the slow code.
  unsetenv(kCoreType);
}

}  // namespace cadmorph
