#pragma once

#include <string>

namespace cadmorph {

/// Sets the number of threads of the BLAS where the library has a call for it (OpenBLAS).
void set_blas_threads(int count);

/// Keeps the BLAS to one thread while alive: its results then don't depend on the number of
/// threads, and parallel callers don't oversubscribe the processor. May nest, on any threads.
class SerialBlas {
 public:
  SerialBlas();
  ~SerialBlas();
  SerialBlas(const SerialBlas&) = delete;
  SerialBlas& operator=(const SerialBlas&) = delete;
};

/// What the loaded BLAS says of itself.
struct BlasInfo {
  std::string kernel;  ///< OpenBLAS core name, such as "SkylakeX"; empty for another BLAS
  std::string
      suggested;  ///< core type this processor could run when `kernel` is slower; else empty
};

/// Returns the BLAS's kernel and, where OpenBLAS did not know this processor and fell back to an
/// old one (it knows none newer than itself), the value of OPENBLAS_CORETYPE that mends it. It
/// must be in the environment before the library loads, so the program starts itself anew.
BlasInfo blas_info();

}  // namespace cadmorph
