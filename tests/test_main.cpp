#define CATCH_CONFIG_RUNNER
#include <catch2/catch.hpp>

#include "core/blas.h"

// As the programs do, so that what a test computes is what they compute.
int main(int argc, char** argv) {
  cadmorph::use_fitting_blas_kernel();
  return Catch::Session().run(argc, argv);
}
