#include <mutex>

#include "apps/library/impl.h"
#include "apps/version.h"
#include "core/blas.h"
#include "core/parallel.h"

namespace cadmorph::v1 {

void set_thread_count(int count) {
  if (count < 0)
    throw InvalidInputError("the number of threads is " + std::to_string(count) +
                            "; give 0 (all processors) or how many");
  cadmorph::set_thread_count(count);
}

int thread_count() { return cadmorph::thread_count(); }

void use_fitting_blas_kernel() {
  static std::once_flag once;
  std::call_once(once, cadmorph::use_fitting_blas_kernel);
}

std::string version() { return kVersion; }

}  // namespace cadmorph::v1
