#pragma once

#include "core/rbf/centre_frame.h"
#include "core/rbf/kernel_sum.h"
#include "core/rbf/rbf_system.h"
#include "core/rbf/unit_targets.h"

namespace cadmorph {

struct RbfField::Impl {
  CentreFrame frame;
  Kernel kernel;
  KernelSum sum;
  UnitField field;
  RbfReport report;
};

struct RbfTargets::Impl {
  UnitTargets targets;
};

/// Returns the same function of distances in units of `unit`.
Kernel in_units(Kernel kernel, double unit);

/// What KernelSum adds to the logarithm in units of `unit`. r^2 log r needs no shift for the unit:
/// the change is a polynomial that the weights annihilate. Higher even polyharmonics with linear
/// polynomials alone do.
double log_scale(const Kernel& kernel, double unit);

/// Returns the targets in units of the frame. Throws InvalidInputError on their dimension.
UnitTargets unit_targets(const CentreFrame& frame, const KernelSum& sum, const RowMatrix& targets,
                         const H2Matrix* far_field);

}  // namespace cadmorph
