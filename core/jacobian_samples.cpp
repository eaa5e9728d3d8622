#include "core/jacobian_samples.h"

#include <Eigen/LU>
#include <algorithm>
#include <map>
#include <mutex>

#include "core/bernstein.h"
#include "core/cell_topology.h"
#include "core/reference_cell.h"

namespace cadmorph {
namespace {

using Eigen::MatrixXd;
using Eigen::Vector3d;

// A cell's map as a polynomial on a domain of Bernstein polynomials.
struct CellMap {
  CellType type;
  ReferenceShape shape;
  Degrees determinant;  ///< degrees of det J
  int collapsed = 0;    ///< power of (1 - t) that divides det J
};

// Each product of the determinant has one factor that is derived by a coordinate and two that are
// not; of a simplex's or triangle's coordinates together, one more degree is lost for each.
CellMap map_of(CellType type) {
  int a = 0, b = 0, c = 0, in_plane = 0, total = 0;
  for (const ShapePolynomial& polynomial : shape_space(type))
    for (const auto& [i, j, k, below] : polynomial) {
      a = std::max(a, i);
      b = std::max(b, j);
      c = std::max(c, k);
      in_plane = std::max(in_plane, i + j);
      total = std::max(total, i + j + k - below);
    }
  switch (info_of(type).shape) {
    case Shape::Simplex:
      return {type, ReferenceShape::Simplex, {3 * (total - 1), 0, 0}};
    case Shape::Prism:
      return {type, ReferenceShape::Prism, {3 * in_plane - 2, 0, 3 * c - 1}};
    case Shape::Pyramid:  // the cube with its upper side in one point, the apex
      return {type, ReferenceShape::Cube, {3 * a - 1, 3 * b - 1, 3 * total - 1}, 2};
    default:
      return {type, ReferenceShape::Cube, {3 * a - 1, 3 * b - 1, 3 * c - 1}};
  }
}

Eigen::RowVectorXd values(const std::vector<ShapePolynomial>& space, const Vector3d& x) {
  Eigen::RowVectorXd result(std::ssize(space));
  for (Index i = 0; i < result.size(); ++i) result[i] = value(space[i], x);
  return result;
}

// Central differences with half a unit are exact for quadratics.
MatrixXd derivative_matrix(const CellMap& map, const std::vector<Vector3d>& points) {
  const std::vector<ShapePolynomial> space = shape_space(map.type);
  const std::vector<Vector3d> nodes = reference_nodes(map.type);
  const Index n = std::ssize(nodes);
  MatrixXd at_nodes(n, n);
  for (Index i = 0; i < n; ++i) at_nodes.row(i) = values(space, nodes[i]);
  const auto at = [&](const Vector3d& p) {
    if (map.collapsed == 0) return values(space, p);
    return values(space, {(1 - p[2]) * (2 * p[0] - 1), (1 - p[2]) * (2 * p[1] - 1), p[2]});
  };
  MatrixXd slopes(3 * std::ssize(points), n);
  for (Index s = 0; s < std::ssize(points); ++s)
    for (Index d = 0; d < 3; ++d) {
      const Vector3d half = Vector3d::Unit(d) / 2;
      slopes.row(3 * s + d) = at(points[s] + half) - at(points[s] - half);
    }
  return slopes * at_nodes.inverse();
}

JacobianSamples make_samples(const CellMap& map) {
  const auto points = bernstein_grid(map.shape, map.determinant);
  JacobianSamples result;
  result.nodes = cell_node_count(map.type);
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

}  // namespace

const JacobianSamples* jacobian_samples(CellType type) {
  if (dimension(type) != 3 || type == CellType::Polyhedron) return nullptr;
  static std::mutex mutex;
  static std::map<CellType, JacobianSamples> cache;
  const std::lock_guard lock(mutex);
  const auto [entry, is_new] = cache.try_emplace(type);
  if (is_new) entry->second = make_samples(map_of(type));
  return &entry->second;
}

}  // namespace cadmorph
