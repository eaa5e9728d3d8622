#pragma once

#include <string>

#include "api.h"

namespace cadmorph::CADMORPH_V1 {

/// Limits the number of threads that the library, and the process's OpenBLAS, use; 0: all
/// processors available. Results are the same to the last bit whatever the number. Throws
/// InvalidInputError for a negative one.
void set_thread_count(int count);

/// Returns the number of threads in use.
int thread_count();

/// Has OpenBLAS run code for this processor's vector instructions where, by itself, it runs older
/// code (docs/performance.md); the environment's OPENBLAS_CORETYPE goes before. Called by the first
/// Morpher made, as the program does at its start, so that the two have the same last bits. A
/// program whose other threads use OpenBLAS calls it before they do.
void use_fitting_blas_kernel();

/// The library's version: "0.2.0".
std::string version();

}  // namespace cadmorph::CADMORPH_V1
