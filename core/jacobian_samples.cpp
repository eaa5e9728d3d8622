#include "core/jacobian_samples.h"

#include <Eigen/LU>
#include <array>
#include <cmath>
#include <functional>
#include <map>
#include <mutex>

#include "core/bernstein.h"

namespace cadmorph {
namespace {

using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

// The functions a cell's map is made of, at most quadratic in each coordinate, and its nodes.
struct CellMap {
  ReferenceShape shape;
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

JacobianSamples make_samples(const CellMap& map) {
  const auto points = bernstein_grid(map.shape, map.determinant);
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
  const auto own = bernstein_grid(map.shape, n);
  const MatrixXd to_own = bernstein_matrix(map.shape, n, own).inverse();
  for (const AffineMap& part : parts_of(map.shape)) {
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
      values[m] = integer_power(p[0], exponents[m][0]) * integer_power(p[1], exponents[m][1]) *
                  integer_power(p[2], exponents[m][2]);
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
  return {ReferenceShape::Simplex,
          {0, 0, 0},
          0,
          monomials([](int i, int j, int k) { return i + j + k <= 1; }),
          tetra_nodes()};
}

CellMap quadratic_tetra_map() {
  return {ReferenceShape::Simplex,
          {3, 0, 0},
          0,
          monomials([](int i, int j, int k) { return i + j + k <= 2; }),
          with_centres(tetra_nodes(), kTetraEdges)};
}

CellMap hexahedron_map() {
  return {ReferenceShape::Cube,
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
  return {ReferenceShape::Cube,
          {5, 5, 5},
          0,
          monomials([](int i, int j, int k) { return squares(i, j, k) <= 1; }),
          with_centres(hexahedron_nodes(), kHexEdges)};
}

CellMap biquadratic_hexahedron_map() {
  const auto is_in = [](int i, int j, int k) {
    return squares(i, j, k) <= 1 || (k == 2 && squares(i, j, k) == 2);
  };
  return {ReferenceShape::Cube,
          {5, 5, 5},
          0,
          monomials(is_in),
          with_centres(with_centres(hexahedron_nodes(), kHexEdges),
                       {{0, 3, 4, 7}, {1, 2, 5, 6}, {0, 1, 4, 5}, {2, 3, 6, 7}})};
}

CellMap triquadratic_hexahedron_map() {
  return {ReferenceShape::Cube,
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
  return {ReferenceShape::Prism,
          {1, 0, 2},
          0,
          monomials([](int i, int j, int k) { return i + j <= 1 && k <= 1; }),
          wedge_nodes()};
}

CellMap quadratic_linear_wedge_map() {
  const std::vector<Ids> edges(kWedgeEdges.begin(), kWedgeEdges.begin() + 6);
  return {ReferenceShape::Prism,
          {4, 0, 2},
          0,
          monomials([](int i, int j, int k) { return i + j <= 2 && k <= 1; }),
          with_centres(wedge_nodes(), edges)};
}

CellMap quadratic_wedge_map() {
  return {ReferenceShape::Prism,
          {4, 0, 5},
          0,
          monomials([](int i, int j, int k) { return i + j <= (k == 2 ? 1 : 2); }),
          with_centres(wedge_nodes(), kWedgeEdges)};
}

CellMap biquadratic_wedge_map() {
  return {ReferenceShape::Prism,
          {4, 0, 5},
          0,
          monomials([](int i, int j, int) { return i + j <= 2; }),
          with_centres(with_centres(wedge_nodes(), kWedgeEdges),
                       {{0, 1, 3, 4}, {1, 2, 4, 5}, {2, 0, 5, 3}})};
}

CellMap pyramid_map() {
  return {ReferenceShape::Cube, {2, 2, 2}, 2, pyramid_functions, pyramid_nodes()};
}

CellMap quadratic_pyramid_map() {
  return {
      ReferenceShape::Cube, {5, 5, 5}, 2, quadratic_pyramid_functions, quadratic_pyramid_nodes()};
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
