#include "core/orient3d.h"

#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <random>

namespace cadmorph {
namespace {

__extension__ using Wide = __int128;
using Integers = std::array<std::int64_t, 3>;

// Exact sign for coordinates below 2^38.
int integer_sign(const Integers& a, const Integers& b, const Integers& c, const Integers& d) {
  Wide u[3], v[3], w[3];
  for (int i = 0; i < 3; ++i) {
    u[i] = b[i] - a[i];
    v[i] = c[i] - a[i];
    w[i] = d[i] - a[i];
  }
  const Wide det = u[0] * (v[1] * w[2] - v[2] * w[1]) + u[1] * (v[2] * w[0] - v[0] * w[2]) +
                   u[2] * (v[0] * w[1] - v[1] * w[0]);
  return det > 0 ? 1 : det < 0 ? -1 : 0;
}

Eigen::Vector3d to_vector(const Integers& a) {
  return {static_cast<double>(a[0]), static_cast<double>(a[1]), static_cast<double>(a[2])};
}

}  // namespace

TEST_CASE("The orientation of nearly flat tetrahedra is exact", "[core][orient3d]") {
  std::mt19937_64 random(1);
  std::uniform_int_distribution<std::int64_t> wide(-(1LL << 36), 1LL << 36), tiny(-1, 1);
  std::array<int, 3> seen{};
  for (int i = 0; i < 20000; ++i) {
    Integers a, b, c, d;
    for (int k = 0; k < 3; ++k) {
      a[k] = wide(random);
      b[k] = wide(random);
      c[k] = wide(random);
      // In the plane of the others, or next to it.
      d[k] = a[k] + (b[k] - a[k]) / 4 * 2 - (c[k] - a[k]) / 4 + tiny(random);
    }
    const int expected = integer_sign(a, b, c, d);
    const int found = orient3d(to_vector(a), to_vector(b), to_vector(c), to_vector(d));
    REQUIRE(found == expected);
    REQUIRE(orient3d(to_vector(b), to_vector(a), to_vector(c), to_vector(d)) == -expected);
    ++seen[expected + 1];
  }
  CHECK(seen[0] > 100);
  CHECK(seen[2] > 100);
}

TEST_CASE("Four points of a plane have no orientation, one unit off they have",
          "[core][orient3d]") {
  const Eigen::Vector3d a(0.1, 0.2, 0.3), b(1.1, 0.2, 0.3), c(0.1, 1.7, 0.3);
  Eigen::Vector3d d(0.7, 0.9, 0.3);
  CHECK(orient3d(a, b, c, d) == 0);
  d[2] = std::nextafter(0.3, 1.0);
  CHECK(orient3d(a, b, c, d) == 1);
  d[2] = std::nextafter(0.3, 0.0);
  CHECK(orient3d(a, b, c, d) == -1);
}

}  // namespace cadmorph
