#include "core/rbf/kernel.h"

#include <cmath>

namespace cadmorph {
namespace {

int exponent(const Kernel& kernel) { return 2 * kernel.order - kernel.dimension; }

double polyharmonic(const Kernel& kernel, double r) {
  if (r == 0) return 0;
  const double power = std::pow(r, exponent(kernel));
  return kernel.dimension % 2 == 0 ? power * std::log(r) : power;
}

double wendland_c2(double t) { return t < 1 ? std::pow(1 - t, 4) * (4 * t + 1) : 0; }

double wendland_c4(double t) {
  return t < 1 ? std::pow(1 - t, 6) * (35 * t * t + 18 * t + 3) / 3 : 0;
}

}  // namespace

double Kernel::operator()(double r) const {
  const double scaled = shape * r;
  switch (kind) {
    case KernelKind::Gaussian:
      return std::exp(-scaled * scaled);
    case KernelKind::Multiquadric:
      return std::sqrt(1 + scaled * scaled);
    case KernelKind::InverseMultiquadric:
      return 1 / std::sqrt(1 + scaled * scaled);
    case KernelKind::WendlandC2:
      return wendland_c2(scaled);
    case KernelKind::WendlandC4:
      return wendland_c4(scaled);
    case KernelKind::Polyharmonic:
      break;
  }
  return polyharmonic(*this, r);
}

int Kernel::cpd_order() const {
  if (kind == KernelKind::Multiquadric) return 1;
  if (kind != KernelKind::Polyharmonic) return 0;
  return exponent(*this) / 2 + 1;  // r^(2q-1): q; r^(2q) log r: q + 1
}

int Kernel::cpd_sign() const { return cpd_order() % 2 == 0 ? 1 : -1; }

}  // namespace cadmorph
