#include "volume/held_cells.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>

#include "core/finite_volumes.h"
#include "core/jacobian_samples.h"

namespace cadmorph {
namespace {

using Eigen::Vector3d;

// Rounding of coordinates, as a share of lengths, areas and volumes of a cell's own size.
constexpr double kRounding = 1e-9;

// Whether a quadrilateral is plane and not convex.
bool is_dented_plane(const Points& positions, const std::vector<Index>& nodes) {
  const auto corner = [&](std::size_t i) -> Vector3d { return positions.row(nodes[i % 4]); };
  const Vector3d normal = (corner(2) - corner(0)).cross(corner(3) - corner(1));
  const double size = std::max((corner(2) - corner(0)).norm(), (corner(3) - corner(1)).norm());
  const double height = (corner(1) - corner(0)).dot(normal);
  if (std::abs(height) > kRounding * size * normal.norm()) return false;
  for (std::size_t i = 0; i < 4; ++i) {
    if (nodes[i] == nodes[(i + 1) % 4]) return false;  // a triangle
    const Vector3d next = corner(i + 1) - corner(i), last = corner(i + 3) - corner(i);
    if (next.cross(last).dot(normal) <= 0) return true;
  }
  return false;
}

// Whether the fixed nodes alone set the Jacobian at one of the samples, and set it inverted.
bool has_set_inversion(const Mesh& mesh, const Points& positions, const std::vector<char>& is_fixed,
                       Index c, int sign) {
  const JacobianSamples* samples = jacobian_samples(mesh.types[c]);
  if (!samples) return false;
  const auto nodes = mesh.cell(c);
  Eigen::MatrixXd own(nodes.size(), 3);
  for (std::size_t n = 0; n < nodes.size(); ++n)
    own.row(n) = positions.row(nodes[n]) - positions.row(nodes[0]);
  for (int s = 0; s < samples->samples; ++s) {
    const auto slopes = samples->derivatives.middleRows<3>(3 * s);
    bool is_set = true;
    for (std::size_t n = 0; n < nodes.size() && is_set; ++n)
      is_set = is_fixed[nodes[n]] || slopes.col(n).norm() <= kRounding * slopes.norm();
    if (!is_set) continue;
    const Eigen::Matrix3d jacobian = slopes * own;
    if (sign * jacobian.determinant() < -kRounding * jacobian.rowwise().norm().prod()) return true;
  }
  return false;
}

}  // namespace

bool is_held(const Mesh& mesh, const Points& positions, const std::vector<char>& is_fixed,
             const Orientation& orientation, Index c) {
  const auto fixed = [&](Index node) { return is_fixed[node] != 0; };
  if (std::ranges::all_of(mesh.cell(c), fixed)) return true;
  if (dimension(mesh.types[c]) != 3 || mesh.types[c] == CellType::Polyhedron ||
      finite_volume::is_volume(mesh, mesh.types[c]))
    return false;
  const int sign = orientation[static_cast<std::size_t>(mesh.types[c])];
  return has_set_inversion(mesh, positions, is_fixed, c, sign) ||
         std::ranges::any_of(cell_facets(mesh, c), [&](const Facet& facet) {
           return facet.type == CellType::Quad && std::ranges::all_of(facet.nodes, fixed) &&
                  is_dented_plane(positions, facet.nodes);
         });
}

}  // namespace cadmorph
