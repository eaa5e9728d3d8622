#include "core/orient3d.h"

#include <array>
#include <cmath>
#include <limits>
#include <vector>

namespace cadmorph {
namespace {

using Eigen::Vector3d;

// A sum of doubles kept exactly: components of growing size that do not overlap.
class Expansion {
 public:
  void add(double term) {
    for (double& component : components_) {
      const double sum = term + component;
      const double virtual_term = sum - component;
      const double error = (component - (sum - virtual_term)) + (term - virtual_term);
      component = error;
      term = sum;
    }
    components_.push_back(term);
  }

  void add_product(double a, double b, double c) {
    const double high = a * b, low = std::fma(a, b, -high);
    add_product(high, c);
    add_product(low, c);
  }

  int sign() const {
    for (auto component = components_.rbegin(); component != components_.rend(); ++component)
      if (*component != 0) return *component > 0 ? 1 : -1;
    return 0;
  }

 private:
  void add_product(double a, double b) {
    const double high = a * b;
    add(std::fma(a, b, -high));
    add(high);
  }

  std::vector<double> components_;
};

void add_determinant(Expansion& sum, double sign, const Vector3d& a, const Vector3d& b,
                     const Vector3d& c) {
  constexpr int kNext[] = {1, 2, 0};
  for (int i = 0; i < 3; ++i) {
    const int j = kNext[i], k = kNext[j];
    sum.add_product(sign * a[i], b[j], c[k]);
    sum.add_product(-sign * a[i], b[k], c[j]);
  }
}

int exact_sign(const Vector3d& a, const Vector3d& b, const Vector3d& c, const Vector3d& d) {
  // det[b-a, c-a, d-a] = det[b,c,d] - det[a,c,d] + det[a,b,d] - det[a,b,c]
  Expansion sum;
  add_determinant(sum, 1, b, c, d);
  add_determinant(sum, -1, a, c, d);
  add_determinant(sum, 1, a, b, d);
  add_determinant(sum, -1, a, b, c);
  return sum.sign();
}

}  // namespace

int orient3d(const Vector3d& a, const Vector3d& b, const Vector3d& c, const Vector3d& d) {
  const Vector3d u = b - a, v = c - a, w = d - a;
  const double determinant = u.dot(v.cross(w));
  // Sum of the terms' magnitudes times 8 eps: above Shewchuk's bound (7 + 56 eps) eps.
  const Vector3d au = u.cwiseAbs(), av = v.cwiseAbs(), aw = w.cwiseAbs();
  const double permanent = au[0] * (av[1] * aw[2] + av[2] * aw[1]) +
                           au[1] * (av[2] * aw[0] + av[0] * aw[2]) +
                           au[2] * (av[0] * aw[1] + av[1] * aw[0]);
  const double bound = 8 * std::numeric_limits<double>::epsilon() * permanent;
  if (determinant > bound) return 1;
  if (determinant < -bound) return -1;
  return exact_sign(a, b, c, d);
}

}  // namespace cadmorph
