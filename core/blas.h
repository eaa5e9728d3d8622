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

/// Name of the code that the BLAS runs, such as "SkylakeX" (OpenBLAS's core name); empty for
/// another BLAS than OpenBLAS.
std::string blas_kernel();

/// Has OpenBLAS run code for this processor's vector instructions where, by itself, it runs older
/// code: it falls back to "Prescott" on processors newer than itself. Last bits depend on that
/// code, so a program calls this first of all, whatever it is to compute. A choice of the user's,
/// OPENBLAS_CORETYPE, stays; nothing happens where the BLAS has no such choice. No other thread may
/// be in the BLAS, or in the environment, meanwhile.
void use_fitting_blas_kernel();

}  // namespace cadmorph
