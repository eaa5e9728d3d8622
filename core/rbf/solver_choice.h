#pragma once

#include <string>

#include "core/rbf/rbf_system.h"

namespace cadmorph {

struct SolverChoice {
  SolverKind solver;
  std::string reason;
};

/// Whether the kernel is r^3 in space, which the fast solver serves.
bool is_triharmonic_3d(const Kernel& kernel, Index dimension);

/// Returns the solver for so many centres, and why. Throws InvalidInputError where the one asked
/// for does not serve the kernel.
SolverChoice choose_solver(SolverKind asked, const Kernel& kernel, Index dimension, Index centres);

}  // namespace cadmorph
