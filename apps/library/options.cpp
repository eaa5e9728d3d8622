#include <cmath>

#include "apps/library/impl.h"

namespace cadmorph::v1 {
namespace {

void check_positive(double value, const char* name) {
  if (!(value > 0) || !std::isfinite(value))
    throw InvalidInputError("the option " + std::string(name) + " is " + std::to_string(value) +
                            "; give a number above 0");
}

void check_range(const std::optional<double>& value, double low, const char* name) {
  if (value && !(*value >= low && *value <= 1))
    throw InvalidInputError("the option " + std::string(name) + " is " + std::to_string(*value) +
                            "; a scaled Jacobian lies in [" + std::to_string(int(low)) + ", 1]");
}

void check(const MorphOptions& options) {
  if (options.mesh_unit_mm) check_positive(*options.mesh_unit_mm, "mesh_unit_mm");
  check_positive(options.association_tolerance, "association_tolerance");
  if (options.kernel_shape) check_positive(*options.kernel_shape, "kernel_shape");
  check_positive(options.solver_tolerance, "solver_tolerance");
  check_positive(options.memory_limit_bytes, "memory_limit_bytes");
  check_range(options.improve_below, 0, "improve_below");
  check_range(options.min_scaled_jacobian, -1, "min_scaled_jacobian");
  if (options.steps < 0)
    throw InvalidInputError("the option steps is " + std::to_string(options.steps) +
                            "; give 0 (as many as it takes) or a number of steps");
  if (options.max_steps < 1)
    throw InvalidInputError("the option max_steps is " + std::to_string(options.max_steps) +
                            "; give at least 1");
}

UnmatchedPolicy inner(Unmatched unmatched) {
  switch (unmatched) {
    case Unmatched::Auto:
      return UnmatchedPolicy::Auto;
    case Unmatched::Error:
      return UnmatchedPolicy::Error;
    case Unmatched::Fix:
      return UnmatchedPolicy::Fix;
    case Unmatched::Slide:
      return UnmatchedPolicy::Slide;
  }
  throw InvalidInputError("the option unmatched has no such choice");
}

MorphMethod inner(Method method) {
  switch (method) {
    case Method::Rbf:
      return MorphMethod::Rbf;
    case Method::Femwarp:
      return MorphMethod::Femwarp;
    case Method::Lbwarp:
      return MorphMethod::Lbwarp;
    case Method::SimplexLinear:
      return MorphMethod::SimplexLinear;
  }
  throw InvalidInputError("the option method has no such choice");
}

cadmorph::Kernel kernel_of(Kernel kernel) {
  switch (kernel) {
    case Kernel::Triharmonic:
      return cadmorph::Kernel::triharmonic_3d();
    case Kernel::Biharmonic:
      return cadmorph::Kernel::biharmonic_3d();
    case Kernel::Quadharmonic:
      return cadmorph::Kernel::quadharmonic_3d();
    case Kernel::Gaussian:
      return {.kind = KernelKind::Gaussian};
    case Kernel::Multiquadric:
      return {.kind = KernelKind::Multiquadric};
    case Kernel::InverseMultiquadric:
      return {.kind = KernelKind::InverseMultiquadric};
    case Kernel::WendlandC2:
      return {.kind = KernelKind::WendlandC2};
    case Kernel::WendlandC4:
      return {.kind = KernelKind::WendlandC4};
  }
  throw InvalidInputError("the option kernel has no such choice");
}

cadmorph::Kernel inner(Kernel kernel, const std::optional<double>& shape) {
  cadmorph::Kernel result = kernel_of(kernel);
  if (result.has_shape() && !shape)
    throw InvalidInputError(
        "this kernel needs the option kernel_shape, the inverse of a length in the mesh's unit");
  if (!result.has_shape() && shape)
    throw InvalidInputError("the option kernel_shape has no meaning for a polyharmonic kernel");
  result.shape = shape.value_or(result.shape);
  return result;
}

SolverKind inner(Solver solver) {
  switch (solver) {
    case Solver::Auto:
      return SolverKind::Auto;
    case Solver::Adaptive:
      return SolverKind::Adaptive;
    case Solver::Lu:
      return SolverKind::Lu;
    case Solver::Ldlt:
      return SolverKind::Ldlt;
    case Solver::Cholesky:
      return SolverKind::Cholesky;
    case Solver::Iqr:
      return SolverKind::Iqr;
    case Solver::Fast:
      return SolverKind::Fast;
  }
  throw InvalidInputError("the option solver has no such choice");
}

UntangleMode inner(Untangle untangle) {
  switch (untangle) {
    case Untangle::Auto:
      return UntangleMode::Auto;
    case Untangle::Never:
      return UntangleMode::Never;
    case Untangle::Always:
      return UntangleMode::Always;
  }
  throw InvalidInputError("the option untangle has no such choice");
}

QualityMode inner(Quality quality) {
  switch (quality) {
    case Quality::Best:
      return QualityMode::Best;
    case Quality::Fast:
      return QualityMode::Fast;
  }
  throw InvalidInputError("the option quality has no such choice");
}

MeshUse inner(SolverFamily family) {
  switch (family) {
    case SolverFamily::OfFormat:
      return MeshUse::OfFormat;
    case SolverFamily::FiniteElements:
      return MeshUse::FiniteElements;
    case SolverFamily::FiniteVolumes:
      return MeshUse::FiniteVolumes;
  }
  throw InvalidInputError("the option solver_family has no such choice");
}

}  // namespace

PipelineOptions inner_options(const MorphOptions& options) {
  check(options);
  PipelineOptions result;
  result.surface.association.tolerance = options.association_tolerance;
  result.surface.association.mesh_unit_mm = options.mesh_unit_mm.value_or(0);
  result.surface.snap = options.snap;
  result.surface.unmatched = inner(options.unmatched);
  result.surface.groups = {.held = options.hold,
                           .rigid = options.rigid,
                           .sliding = options.slide,
                           .following = options.follow,
                           .periodic = options.periodic};
  result.volume.method = inner(options.method);
  result.volume.kernel = inner(options.kernel, options.kernel_shape);
  result.volume.rbf.solver = inner(options.solver);
  result.volume.rbf.tolerance = options.solver_tolerance;
  result.volume.rbf.memory_limit = options.memory_limit_bytes;
  result.stepping.steps = options.steps;
  result.stepping.max_steps = options.max_steps;
  result.untangle = inner(options.untangle);
  result.quality = inner(options.quality);
  result.mesh_use = inner(options.solver_family);
  result.improve_below = options.improve_below;
  result.min_scaled_jacobian = options.min_scaled_jacobian;
  result.keep_layers = options.keep_layers;
  result.accept_inverted_input = options.accept_inverted_input;
  result.face_map = options.face_map;
  return result;
}

}  // namespace cadmorph::v1
