#include "core/bernstein.h"

namespace cadmorph {
namespace {

using Eigen::MatrixXd;
using Eigen::Vector3d;

double factorial(int n) { return n <= 1 ? 1.0 : n * factorial(n - 1); }

double choose(int n, int k) { return factorial(n) / (factorial(k) * factorial(n - k)); }

double line_bernstein(int n, int i, double t) {
  return choose(n, i) * integer_power(t, i) * integer_power(1 - t, n - i);
}

double fraction_of(int i, int n) { return n == 0 ? 0.0 : static_cast<double>(i) / n; }

// Multi-indices of the Bernstein polynomials, those of a triangle or simplex with their sum <= n.
std::vector<std::array<int, 3>> indices(ReferenceShape shape, const Degrees& n) {
  std::vector<std::array<int, 3>> result;
  const bool is_cube = shape == ReferenceShape::Cube;
  const int last = shape == ReferenceShape::Simplex ? n[0] : n[2];
  for (int k = 0; k <= last; ++k) {
    const int rest = shape == ReferenceShape::Simplex ? n[0] - k : n[0];
    for (int j = 0; j <= (is_cube ? n[1] : rest); ++j)
      for (int i = 0; i <= (is_cube ? n[0] : rest - j); ++i) result.push_back({i, j, k});
  }
  return result;
}

double bernstein(ReferenceShape shape, const Degrees& n, const std::array<int, 3>& m,
                 const Vector3d& p) {
  const auto& [i, j, k] = m;
  if (shape == ReferenceShape::Cube)
    return line_bernstein(n[0], i, p[0]) * line_bernstein(n[1], j, p[1]) *
           line_bernstein(n[2], k, p[2]);
  if (shape == ReferenceShape::Prism) {
    const int l = n[0] - i - j;
    return factorial(n[0]) / (factorial(i) * factorial(j) * factorial(l)) * integer_power(p[0], i) *
           integer_power(p[1], j) * integer_power(1 - p[0] - p[1], l) *
           line_bernstein(n[2], k, p[2]);
  }
  const int l = n[0] - i - j - k;
  return factorial(n[0]) / (factorial(i) * factorial(j) * factorial(k) * factorial(l)) *
         integer_power(p[0], i) * integer_power(p[1], j) * integer_power(p[2], k) *
         integer_power(1 - p.sum(), l);
}

Vector3d grid_point(ReferenceShape shape, const Degrees& n, const std::array<int, 3>& m) {
  if (shape == ReferenceShape::Cube)
    return {fraction_of(m[0], n[0]), fraction_of(m[1], n[1]), fraction_of(m[2], n[2])};
  const int third = shape == ReferenceShape::Prism ? n[2] : n[0];
  return {fraction_of(m[0], n[0]), fraction_of(m[1], n[0]), fraction_of(m[2], third)};
}

AffineMap simplex_map(const Vector3d& a, const Vector3d& b, const Vector3d& c, const Vector3d& d) {
  AffineMap map;
  map.linear << b - a, c - a, d - a;
  map.origin = a;
  return map;
}

std::vector<AffineMap> cube_parts() {
  std::vector<AffineMap> parts;
  for (int k = 0; k < 8; ++k)
    parts.push_back({Eigen::Matrix3d::Identity() / 2, Vector3d(k & 1, k >> 1 & 1, k >> 2) / 2});
  return parts;
}

std::vector<AffineMap> prism_parts() {
  std::vector<AffineMap> parts;
  for (const double z : {0.0, 0.5}) {
    for (const Vector3d& corner : {Vector3d(0, 0, z), Vector3d(0.5, 0, z), Vector3d(0, 0.5, z)})
      parts.push_back({Eigen::Matrix3d::Identity() / 2, corner});
    const Vector3d centre(0.5, 0.5, z);
    parts.push_back({Vector3d(-0.5, -0.5, 0.5).asDiagonal(), centre});
  }
  return parts;
}

std::vector<AffineMap> simplex_parts() {
  const std::array<Vector3d, 4> v = {Vector3d::Zero(), Vector3d::UnitX(), Vector3d::UnitY(),
                                     Vector3d::UnitZ()};
  const auto mid = [&](int a, int b) -> Vector3d { return (v[a] + v[b]) / 2; };
  return {simplex_map(v[0], mid(0, 1), mid(0, 2), mid(0, 3)),
          simplex_map(mid(0, 1), v[1], mid(1, 2), mid(1, 3)),
          simplex_map(mid(0, 2), mid(1, 2), v[2], mid(2, 3)),
          simplex_map(mid(0, 3), mid(1, 3), mid(2, 3), v[3]),
          simplex_map(mid(0, 1), mid(0, 2), mid(0, 3), mid(1, 3)),
          simplex_map(mid(0, 1), mid(0, 2), mid(1, 2), mid(1, 3)),
          simplex_map(mid(0, 2), mid(0, 3), mid(1, 3), mid(2, 3)),
          simplex_map(mid(0, 2), mid(1, 2), mid(1, 3), mid(2, 3))};
}

}  // namespace

double integer_power(double x, int n) { return n == 0 ? 1.0 : x * integer_power(x, n - 1); }

std::vector<Vector3d> bernstein_grid(ReferenceShape shape, const Degrees& n) {
  std::vector<Vector3d> points;
  for (const auto& m : indices(shape, n)) points.push_back(grid_point(shape, n, m));
  return points;
}

MatrixXd bernstein_matrix(ReferenceShape shape, const Degrees& n,
                          const std::vector<Vector3d>& points) {
  const auto all = indices(shape, n);
  MatrixXd result(points.size(), all.size());
  for (std::size_t p = 0; p < points.size(); ++p)
    for (std::size_t m = 0; m < all.size(); ++m)
      result(p, m) = bernstein(shape, n, all[m], points[p]);
  return result;
}

std::vector<AffineMap> parts_of(ReferenceShape shape) {
  if (shape == ReferenceShape::Cube) return cube_parts();
  return shape == ReferenceShape::Prism ? prism_parts() : simplex_parts();
}

std::vector<Vector3d> corners_of(ReferenceShape shape) {
  if (shape == ReferenceShape::Cube) return bernstein_grid(ReferenceShape::Cube, {1, 1, 1});
  return shape == ReferenceShape::Prism ? bernstein_grid(ReferenceShape::Prism, {1, 0, 1})
                                        : bernstein_grid(ReferenceShape::Simplex, {1, 0, 0});
}

MatrixXd divide_collapse(const MatrixXd& product, const Degrees& n, int c) {
  const Index layer = static_cast<Index>(n[0] + 1) * (n[1] + 1);
  const int last = n[2] - c;
  MatrixXd result = product.topRows(layer * (last + 1));
  for (int k = 0; k <= last; ++k)
    result.middleRows(layer * k, layer) *= choose(n[2], k) / choose(last, k);
  return result;
}

}  // namespace cadmorph
