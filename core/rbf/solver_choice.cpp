#include "core/rbf/solver_choice.h"

#include "core/errors.h"

namespace cadmorph {
namespace {

// Number of centres from which on the fast solver beats Cholesky (docs/fast-solver.md).
constexpr Index kFastCentres = 2000;

// The fast solver needs enough centres for its stencils of 64.
constexpr Index kFewCentres = 100;

SolverChoice choose_automatically(const Kernel& kernel, bool is_triharmonic, Index centres) {
  if (kernel.cpd_order() > 2)
    return {SolverKind::Ldlt, "the kernel needs more than linear polynomials"};
  if (is_triharmonic && centres >= kFastCentres)
    return {SolverKind::Adaptive, "triharmonic in space, many centres"};
  return {SolverKind::Cholesky, is_triharmonic ? "few centres" : "positive definite kernel"};
}

}  // namespace

bool is_triharmonic_3d(const Kernel& kernel, Index dimension) {
  return dimension == 3 && kernel.kind == KernelKind::Polyharmonic && kernel.dimension % 2 == 1 &&
         2 * kernel.order - kernel.dimension == 3;
}

SolverChoice choose_solver(SolverKind asked, const Kernel& kernel, Index dimension, Index centres) {
  const bool is_triharmonic = is_triharmonic_3d(kernel, dimension);
  if (asked == SolverKind::Auto) return choose_automatically(kernel, is_triharmonic, centres);
  if (asked == SolverKind::Cholesky && kernel.cpd_order() > 2)
    throw InvalidInputError(
        "the Cholesky solver needs a kernel that is positive definite beside linear polynomials, "
        "which this one is not; use LDL^T or LU");
  const bool is_adaptive = asked == SolverKind::Adaptive;
  if (asked != SolverKind::Fast && !is_adaptive) return {asked, "as asked"};
  const std::string name = is_adaptive ? "the adaptive solver" : "the fast solver";
  if (!is_triharmonic) throw InvalidInputError(name + " serves the triharmonic kernel in 3D only");
  if (centres < kFewCentres) return {SolverKind::Cholesky, "too few centres for " + name};
  return {asked, "as asked"};
}

}  // namespace cadmorph
