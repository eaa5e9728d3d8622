#include "core/jacobian_samples.h"

#include <Eigen/LU>
#include <array>
#include <cmath>
#include <functional>
#include <map>
#include <mutex>

namespace cadmorph {
namespace {

using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

enum class Shape { Cube, Prism, Simplex };

// Polynomial degrees by direction; a prism has its triangle's in [0], a simplex its own in [0].
using Degrees = std::array<int, 3>;

double power(double x, int n) { return n == 0 ? 1.0 : x * power(x, n - 1); }

double factorial(int n) { return n <= 1 ? 1.0 : n * factorial(n - 1); }

double choose(int n, int k) { return factorial(n) / (factorial(k) * factorial(n - k)); }

double line_bernstein(int n, int i, double t) {
  return choose(n, i) * power(t, i) * power(1 - t, n - i);
}

double fraction_of(int i, int n) { return n == 0 ? 0.0 : static_cast<double>(i) / n; }

// Multi-indices of the Bernstein polynomials, those of a triangle or simplex with their sum <= n.
std::vector<std::array<int, 3>> indices(Shape shape, const Degrees& n) {
  std::vector<std::array<int, 3>> result;
  const bool is_cube = shape == Shape::Cube;
  const int last = shape == Shape::Simplex ? n[0] : n[2];
  for (int k = 0; k <= last; ++k) {
    const int rest = shape == Shape::Simplex ? n[0] - k : n[0];
    for (int j = 0; j <= (is_cube ? n[1] : rest); ++j)
      for (int i = 0; i <= (is_cube ? n[0] : rest - j); ++i) result.push_back({i, j, k});
  }
  return result;
}

double bernstein(Shape shape, const Degrees& n, const std::array<int, 3>& m, const Vector3d& p) {
  const auto& [i, j, k] = m;
  if (shape == Shape::Cube)
    return line_bernstein(n[0], i, p[0]) * line_bernstein(n[1], j, p[1]) *
           line_bernstein(n[2], k, p[2]);
  if (shape == Shape::Prism) {
    const int l = n[0] - i - j;
    return factorial(n[0]) / (factorial(i) * factorial(j) * factorial(l)) * power(p[0], i) *
           power(p[1], j) * power(1 - p[0] - p[1], l) * line_bernstein(n[2], k, p[2]);
  }
  const int l = n[0] - i - j - k;
  return factorial(n[0]) / (factorial(i) * factorial(j) * factorial(k) * factorial(l)) *
         power(p[0], i) * power(p[1], j) * power(p[2], k) * power(1 - p.sum(), l);
}

Vector3d grid_point(Shape shape, const Degrees& n, const std::array<int, 3>& m) {
  if (shape == Shape::Cube)
    return {fraction_of(m[0], n[0]), fraction_of(m[1], n[1]), fraction_of(m[2], n[2])};
  const int third = shape == Shape::Prism ? n[2] : n[0];
  return {fraction_of(m[0], n[0]), fraction_of(m[1], n[0]), fraction_of(m[2], third)};
}

std::vector<Vector3d> grid(Shape shape, const Degrees& n) {
  std::vector<Vector3d> points;
  for (const auto& m : indices(shape, n)) points.push_back(grid_point(shape, n, m));
  return points;
}

MatrixXd bernstein_matrix(Shape shape, const Degrees& n, const std::vector<Vector3d>& points) {
  const auto all = indices(shape, n);
  MatrixXd result(points.size(), all.size());
  for (std::size_t p = 0; p < points.size(); ++p)
    for (std::size_t m = 0; m < all.size(); ++m)
      result(p, m) = bernstein(shape, n, all[m], points[p]);
  return result;
}

struct Affine {
  Eigen::Matrix3d linear;
  Vector3d origin;
};

Affine simplex_map(const Vector3d& a, const Vector3d& b, const Vector3d& c, const Vector3d& d) {
  Affine map;
  map.linear << b - a, c - a, d - a;
  map.origin = a;
  return map;
}

std::vector<Affine> cube_parts() {
  std::vector<Affine> parts;
  for (int k = 0; k < 8; ++k)
    parts.push_back({Eigen::Matrix3d::Identity() / 2, Vector3d(k & 1, k >> 1 & 1, k >> 2) / 2});
  return parts;
}

std::vector<Affine> prism_parts() {
  std::vector<Affine> parts;
  for (const double z : {0.0, 0.5}) {
    for (const Vector3d& corner : {Vector3d(0, 0, z), Vector3d(0.5, 0, z), Vector3d(0, 0.5, z)})
      parts.push_back({Eigen::Matrix3d::Identity() / 2, corner});
    const Vector3d centre(0.5, 0.5, z);
    parts.push_back({Vector3d(-0.5, -0.5, 0.5).asDiagonal(), centre});
  }
  return parts;
}

std::vector<Affine> simplex_parts() {
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

std::vector<Affine> parts_of(Shape shape) {
  if (shape == Shape::Cube) return cube_parts();
  return shape == Shape::Prism ? prism_parts() : simplex_parts();
}

std::vector<Vector3d> corners_of(Shape shape) {
  if (shape == Shape::Cube) return grid(Shape::Cube, {1, 1, 1});
  return shape == Shape::Prism ? grid(Shape::Prism, {1, 0, 1}) : grid(Shape::Simplex, {1, 0, 0});
}

// The functions a cell's map is made of, at most quadratic in each coordinate, and its nodes.
struct CellMap {
  Shape shape;
  Degrees determinant;  ///< degrees of det J
  int collapsed = 0;    ///< power of (1 - t) that divides det J
  std::function<VectorXd(const Vector3d&)> functions;
  std::vector<Vector3d> nodes;
};

// Central differences with half a unit are exact for quadratics.
MatrixXd derivative_matrix(const CellMap& map, const std::vector<Vector3d>& points) {
  const int n = static_cast<int>(map.nodes.size());
  MatrixXd at_nodes(n, n);
  for (int i = 0; i < n; ++i) at_nodes.row(i) = map.functions(map.nodes[i]).transpose();
  MatrixXd slopes(3 * points.size(), n);
  for (std::size_t s = 0; s < points.size(); ++s)
    for (int d = 0; d < 3; ++d) {
      const Vector3d half = Vector3d::Unit(d) / 2;
      slopes.row(3 * s + d) =
          (map.functions(points[s] + half) - map.functions(points[s] - half)).transpose();
    }
  return slopes * at_nodes.inverse();
}

// Bernstein coefficients of p with (1 - t)^c p given, from those of the product.
MatrixXd divide_collapse(const MatrixXd& product, const Degrees& n, int c) {
  const Index layer = static_cast<Index>(n[0] + 1) * (n[1] + 1);
  const int last = n[2] - c;
  MatrixXd result = product.topRows(layer * (last + 1));
  for (int k = 0; k <= last; ++k)
    result.middleRows(layer * k, layer) *= choose(n[2], k) / choose(last, k);
  return result;
}

JacobianSamples make_samples(const CellMap& map) {
  const auto points = grid(map.shape, map.determinant);
  JacobianSamples result;
  result.nodes = static_cast<int>(map.nodes.size());
  result.samples = static_cast<int>(points.size());
  result.derivatives = derivative_matrix(map, points);
  result.to_bernstein = bernstein_matrix(map.shape, map.determinant, points).inverse();
  Degrees n = map.determinant;
  if (map.collapsed > 0) {
    result.to_bernstein = divide_collapse(result.to_bernstein, n, map.collapsed);
    n[2] -= map.collapsed;
  }
  const auto own = grid(map.shape, n);
  const MatrixXd to_own = bernstein_matrix(map.shape, n, own).inverse();
  for (const Affine& part : parts_of(map.shape)) {
    std::vector<Vector3d> images;
    for (const Vector3d& p : own) images.push_back(part.linear * p + part.origin);
    result.children.push_back(to_own * bernstein_matrix(map.shape, n, images));
  }
  const MatrixXd at_corners = bernstein_matrix(map.shape, n, corners_of(map.shape));
  for (Index corner = 0; corner < at_corners.rows(); ++corner) {
    Index coefficient;
    at_corners.row(corner).maxCoeff(&coefficient);
    result.corners.push_back(static_cast<int>(coefficient));
  }
  return result;
}

// Monomials r^i s^j t^k with exponents up to 2, as many as `is_in` admits.
std::function<VectorXd(const Vector3d&)> monomials(
    const std::function<bool(int, int, int)>& is_in) {
  std::vector<std::array<int, 3>> exponents;
  for (int k = 0; k <= 2; ++k)
    for (int j = 0; j <= 2; ++j)
      for (int i = 0; i <= 2; ++i)
        if (is_in(i, j, k)) exponents.push_back({i, j, k});
  return [exponents](const Vector3d& p) {
    VectorXd values(exponents.size());
    for (std::size_t m = 0; m < exponents.size(); ++m)
      values[m] = power(p[0], exponents[m][0]) * power(p[1], exponents[m][1]) *
                  power(p[2], exponents[m][2]);
    return values;
  };
}

using Ids = std::vector<int>;

// Appends the centroid of each group of nodes.
std::vector<Vector3d> with_centres(std::vector<Vector3d> nodes, const std::vector<Ids>& groups) {
  for (const Ids& group : groups) {
    Vector3d sum = Vector3d::Zero();
    for (const int i : group) sum += nodes[i];
    nodes.push_back(sum / static_cast<double>(group.size()));
  }
  return nodes;
}

const std::vector<Ids> kHexEdges = {{0, 1}, {1, 2}, {2, 3}, {3, 0}, {4, 5}, {5, 6},
                                    {6, 7}, {7, 4}, {0, 4}, {1, 5}, {2, 6}, {3, 7}};
const std::vector<Ids> kWedgeEdges = {{0, 1}, {1, 2}, {2, 0}, {3, 4}, {4, 5},
                                      {5, 3}, {0, 3}, {1, 4}, {2, 5}};
const std::vector<Ids> kPyramidEdges = {{0, 1}, {1, 2}, {2, 3}, {3, 0},
                                        {0, 4}, {1, 4}, {2, 4}, {3, 4}};
const std::vector<Ids> kTetraEdges = {{0, 1}, {1, 2}, {2, 0}, {0, 3}, {1, 3}, {2, 3}};

std::vector<Vector3d> hexahedron_nodes() {
  return {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}};
}

// VTK's wedge has the normal of (0, 1, 2) point away from (3, 4, 5).
std::vector<Vector3d> wedge_nodes() {
  return {{0, 0, 0}, {0, 1, 0}, {1, 0, 0}, {0, 0, 1}, {0, 1, 1}, {1, 0, 1}};
}

std::vector<Vector3d> tetra_nodes() { return {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}}; }

// The lower square of the cube; its upper side is the apex, told apart by no coordinate there.
std::vector<Vector3d> pyramid_nodes() {
  return {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0.5, 0.5, 1}};
}

std::vector<Vector3d> quadratic_pyramid_nodes() {
  auto nodes = pyramid_nodes();
  for (int e = 0; e < 4; ++e)
    nodes.push_back((nodes[kPyramidEdges[e][0]] + nodes[kPyramidEdges[e][1]]) / 2);
  for (int e = 0; e < 4; ++e) nodes.push_back(nodes[e] + Vector3d(0, 0, 0.5));
  return nodes;
}

// Complete polynomials in the collapsed coordinates x = (1 - t)(2r - 1), y = (1 - t)(2s - 1), t,
// and x y / (1 - t) (Bedrosian 1992).
VectorXd pyramid_functions(const Vector3d& p) {
  const double x = (1 - p[2]) * (2 * p[0] - 1), y = (1 - p[2]) * (2 * p[1] - 1);
  VectorXd values(5);
  values << 1, x, y, p[2], x * (2 * p[1] - 1);
  return values;
}

VectorXd quadratic_pyramid_functions(const Vector3d& p) {
  const double r = 2 * p[0] - 1, s = 2 * p[1] - 1, t = p[2];
  const double x = (1 - t) * r, y = (1 - t) * s;
  VectorXd values(13);
  values << 1, x, y, t, x * x, y * y, t * t, x * y, x * t, y * t, x * s, x * x * s, y * y * r;
  return values;
}

int squares(int i, int j, int k) { return (i == 2) + (j == 2) + (k == 2); }

CellMap tetra_map() {
  return {Shape::Simplex,
          {0, 0, 0},
          0,
          monomials([](int i, int j, int k) { return i + j + k <= 1; }),
          tetra_nodes()};
}

CellMap quadratic_tetra_map() {
  return {Shape::Simplex,
          {3, 0, 0},
          0,
          monomials([](int i, int j, int k) { return i + j + k <= 2; }),
          with_centres(tetra_nodes(), kTetraEdges)};
}

CellMap hexahedron_map() {
  return {Shape::Cube,
          {2, 2, 2},
          0,
          monomials([](int i, int j, int k) { return squares(i, j, k) == 0; }),
          hexahedron_nodes()};
}

CellMap voxel_map() {
  CellMap map = hexahedron_map();
  std::swap(map.nodes[2], map.nodes[3]);
  std::swap(map.nodes[6], map.nodes[7]);
  return map;
}

CellMap quadratic_hexahedron_map() {
  // Serendipity: at most one factor of a term is squared.
  return {Shape::Cube,
          {5, 5, 5},
          0,
          monomials([](int i, int j, int k) { return squares(i, j, k) <= 1; }),
          with_centres(hexahedron_nodes(), kHexEdges)};
}

CellMap biquadratic_hexahedron_map() {
  const auto is_in = [](int i, int j, int k) {
    return squares(i, j, k) <= 1 || (k == 2 && squares(i, j, k) == 2);
  };
  return {Shape::Cube,
          {5, 5, 5},
          0,
          monomials(is_in),
          with_centres(with_centres(hexahedron_nodes(), kHexEdges),
                       {{0, 3, 4, 7}, {1, 2, 5, 6}, {0, 1, 4, 5}, {2, 3, 6, 7}})};
}

CellMap triquadratic_hexahedron_map() {
  return {Shape::Cube,
          {5, 5, 5},
          0,
          monomials([](int, int, int) { return true; }),
          with_centres(with_centres(hexahedron_nodes(), kHexEdges), {{0, 3, 4, 7},
                                                                     {1, 2, 5, 6},
                                                                     {0, 1, 4, 5},
                                                                     {2, 3, 6, 7},
                                                                     {0, 1, 2, 3},
                                                                     {4, 5, 6, 7},
                                                                     {0, 1, 2, 3, 4, 5, 6, 7}})};
}

CellMap wedge_map() {
  return {Shape::Prism,
          {1, 0, 2},
          0,
          monomials([](int i, int j, int k) { return i + j <= 1 && k <= 1; }),
          wedge_nodes()};
}

CellMap quadratic_linear_wedge_map() {
  const std::vector<Ids> edges(kWedgeEdges.begin(), kWedgeEdges.begin() + 6);
  return {Shape::Prism,
          {4, 0, 2},
          0,
          monomials([](int i, int j, int k) { return i + j <= 2 && k <= 1; }),
          with_centres(wedge_nodes(), edges)};
}

CellMap quadratic_wedge_map() {
  return {Shape::Prism,
          {4, 0, 5},
          0,
          monomials([](int i, int j, int k) { return i + j <= (k == 2 ? 1 : 2); }),
          with_centres(wedge_nodes(), kWedgeEdges)};
}

CellMap biquadratic_wedge_map() {
  return {Shape::Prism,
          {4, 0, 5},
          0,
          monomials([](int i, int j, int) { return i + j <= 2; }),
          with_centres(with_centres(wedge_nodes(), kWedgeEdges),
                       {{0, 1, 3, 4}, {1, 2, 4, 5}, {2, 0, 5, 3}})};
}

CellMap pyramid_map() { return {Shape::Cube, {2, 2, 2}, 2, pyramid_functions, pyramid_nodes()}; }

CellMap quadratic_pyramid_map() {
  return {Shape::Cube, {5, 5, 5}, 2, quadratic_pyramid_functions, quadratic_pyramid_nodes()};
}

JacobianSamples build(CellType type) {
  switch (type) {
    case CellType::Tetra:
      return make_samples(tetra_map());
    case CellType::Voxel:
      return make_samples(voxel_map());
    case CellType::Hexahedron:
      return make_samples(hexahedron_map());
    case CellType::Wedge:
      return make_samples(wedge_map());
    case CellType::Pyramid:
      return make_samples(pyramid_map());
    case CellType::QuadraticTetra:
      return make_samples(quadratic_tetra_map());
    case CellType::QuadraticHexahedron:
      return make_samples(quadratic_hexahedron_map());
    case CellType::QuadraticWedge:
      return make_samples(quadratic_wedge_map());
    case CellType::QuadraticPyramid:
      return make_samples(quadratic_pyramid_map());
    case CellType::TriquadraticHexahedron:
      return make_samples(triquadratic_hexahedron_map());
    case CellType::QuadraticLinearWedge:
      return make_samples(quadratic_linear_wedge_map());
    case CellType::BiquadraticQuadraticWedge:
      return make_samples(biquadratic_wedge_map());
    case CellType::BiquadraticQuadraticHexahedron:
      return make_samples(biquadratic_hexahedron_map());
    default:
      return {};
  }
}

}  // namespace

const JacobianSamples* jacobian_samples(CellType type) {
  if (dimension(type) != 3 || type == CellType::Polyhedron) return nullptr;
  static std::mutex mutex;
  static std::map<CellType, JacobianSamples> cache;
  const std::lock_guard lock(mutex);
  const auto [entry, is_new] = cache.try_emplace(type);
  if (is_new) entry->second = build(type);
  return &entry->second;
}

}  // namespace cadmorph
