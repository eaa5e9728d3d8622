#pragma once

namespace cadmorph {

/// Starts this program anew, once, with OPENBLAS_CORETYPE set where OpenBLAS did not know the
/// processor and runs old code (see blas_info). Returns when nothing is to be mended, the user has
/// set the variable, or the restart is not possible.
void restart_with_fitting_blas(char** argv);

}  // namespace cadmorph
