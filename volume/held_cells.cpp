#include "volume/held_cells.h"

#include <Eigen/Geometry>
#include <algorithm>

namespace cadmorph {
namespace {

using Eigen::Vector3d;

// Rounding of coordinates on a plane, in the facet's size.
constexpr double kPlane = 1e-9;

// Whether a quadrilateral is plane and not convex.
bool is_dented_plane(const Points& positions, const std::vector<Index>& nodes) {
  const auto corner = [&](std::size_t i) -> Vector3d { return positions.row(nodes[i % 4]); };
  const Vector3d normal = (corner(2) - corner(0)).cross(corner(3) - corner(1));
  const double size = std::max((corner(2) - corner(0)).norm(), (corner(3) - corner(1)).norm());
  const double height = (corner(1) - corner(0)).dot(normal);
  if (std::abs(height) > kPlane * size * normal.norm()) return false;
  for (std::size_t i = 0; i < 4; ++i) {
    if (nodes[i] == nodes[(i + 1) % 4]) return false;  // a triangle
    const Vector3d next = corner(i + 1) - corner(i), last = corner(i + 3) - corner(i);
    if (next.cross(last).dot(normal) <= 0) return true;
  }
  return false;
}

}  // namespace

bool is_held(const Mesh& mesh, const Points& positions, const std::vector<char>& is_fixed,
             Index c) {
  const auto fixed = [&](Index node) { return is_fixed[node] != 0; };
  if (std::ranges::all_of(mesh.cell(c), fixed)) return true;
  if (dimension(mesh.types[c]) != 3 || mesh.types[c] == CellType::Polyhedron) return false;
  return std::ranges::any_of(cell_facets(mesh, c), [&](const Facet& facet) {
    return facet.type == CellType::Quad && std::ranges::all_of(facet.nodes, fixed) &&
           is_dented_plane(positions, facet.nodes);
  });
}

}  // namespace cadmorph
