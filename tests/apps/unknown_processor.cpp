// Preloaded, with OPENBLAS_CORETYPE set: OpenBLAS has taken its kernel by then, and the program
// does not see the variable. That is the state on a processor that OpenBLAS does not know.

#include <cstdlib>

__attribute__((constructor)) static void hide_variable() { unsetenv("OPENBLAS_CORETYPE"); }
