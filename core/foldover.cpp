#include "core/foldover.h"

#include <algorithm>
#include <cmath>

namespace cadmorph {
namespace {

// Share of the worst sample's energy that a smaller regularisation takes away at least. The paper's
// tenth takes three times the minimisations to the same end.
constexpr double kLeastDrop = 0.3;

}  // namespace

Regularised::Regularised(double d, double epsilon) {
  const double root = std::sqrt(d * d + epsilon * epsilon);
  chi = d > 0 ? (d + root) / 2 : epsilon * epsilon / (2 * (root - d));
  rate = chi / root;
  bend = epsilon * epsilon / (2 * root * root * root);
}

double next_epsilon(double epsilon, double least, double energy_before, double energy) {
  const double drop = std::max(1 - energy / energy_before, kLeastDrop);
  const double mu = (1 - drop) * Regularised(least, epsilon).chi;
  return least < mu ? std::max(2 * std::sqrt(mu * (mu - least)), kLeastEpsilon) : kLeastEpsilon;
}

}  // namespace cadmorph
