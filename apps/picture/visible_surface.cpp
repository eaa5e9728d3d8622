#include "apps/picture/visible_surface.h"

#include <algorithm>

namespace cadmorph {
namespace {

void add_facet(VisibleSurface& surface, CellType type, std::span<const Index> nodes, Index cell) {
  Mesh& mesh = surface.mesh;
  mesh.types.push_back(type);
  mesh.connectivity.insert(mesh.connectivity.end(), nodes.begin(), nodes.end());
  mesh.offsets.push_back(static_cast<Index>(mesh.connectivity.size()));
  surface.cells.push_back(cell);
}

void add_solid_cell(VisibleSurface& surface, const Mesh& mesh, const CellNeighbours& neighbours,
                    const std::vector<char>& is_shown, Index c) {
  const auto others = neighbours.of(c);
  const auto is_open = [&](Index other) { return other < 0 || !is_shown[other]; };
  if (std::ranges::none_of(others, is_open)) return;
  const std::vector<Facet> facets = cell_facets(mesh, c);
  for (std::size_t f = 0; f < facets.size(); ++f)
    if (is_open(others[f])) add_facet(surface, facets[f].type, facets[f].nodes, c);
}

// Numbers the nodes in use anew.
void compact(VisibleSurface& surface, const Points& points) {
  std::vector<Index> number(points.rows(), -1);
  for (const Index node : surface.mesh.connectivity) number[node] = 0;
  for (Index node = 0; node < points.rows(); ++node)
    if (number[node] == 0) {
      number[node] = static_cast<Index>(surface.nodes.size());
      surface.nodes.push_back(node);
    }
  for (Index& node : surface.mesh.connectivity) node = number[node];
  surface.mesh.points = points(surface.nodes, Eigen::all);
}

}  // namespace

VisibleSurface visible_surface(const Mesh& mesh, const CellNeighbours& neighbours,
                               const std::vector<char>& is_shown) {
  VisibleSurface surface;
  surface.mesh.offsets.push_back(0);
  const bool has_solids = dimension(mesh) == 3;
  for (Index c = 0; c < mesh.cell_count(); ++c) {
    if (!is_shown[c]) continue;
    if (has_solids && dimension(mesh.types[c]) == 3)
      add_solid_cell(surface, mesh, neighbours, is_shown, c);
    else if (!has_solids && dimension(mesh.types[c]) == 2)
      add_facet(surface, mesh.types[c], mesh.cell(c), c);
  }
  compact(surface, mesh.points);
  return surface;
}

VisibleSurface facets_in_box(const VisibleSurface& whole, const Eigen::AlignedBox3d& box) {
  VisibleSurface surface;
  surface.mesh.offsets.push_back(0);
  const std::vector<char> is_inside = cells_in_box(whole.mesh, box);
  for (Index f = 0; f < whole.mesh.cell_count(); ++f)
    if (is_inside[f]) add_facet(surface, whole.mesh.types[f], whole.mesh.cell(f), whole.cells[f]);
  compact(surface, whole.mesh.points);
  for (Index& node : surface.nodes) node = whole.nodes[node];
  return surface;
}

std::vector<char> cells_above_middle(const Mesh& mesh, const Eigen::AlignedBox3d& box, int axis) {
  constexpr double kRounding = 1e-9;  // of the box: cells that end in the middle don't reach above
  const double middle = box.center()[axis] + kRounding * box.sizes()[axis];
  std::vector<char> is_above(mesh.cell_count(), 0);
  for (Index c = 0; c < mesh.cell_count(); ++c)
    is_above[c] = std::ranges::any_of(mesh.cell(c),
                                      [&](Index node) { return mesh.points(node, axis) > middle; });
  return is_above;
}

Eigen::AlignedBox3d box_of(const Mesh& mesh) {
  return {mesh.points.colwise().minCoeff().transpose(),
          mesh.points.colwise().maxCoeff().transpose()};
}

std::vector<char> cells_in_box(const Mesh& mesh, const Eigen::AlignedBox3d& box) {
  std::vector<char> is_inside(mesh.cell_count(), 0);
  for (Index c = 0; c < mesh.cell_count(); ++c) {
    Eigen::AlignedBox3d around;
    for (const Index node : mesh.cell(c)) around.extend(mesh.points.row(node).transpose());
    is_inside[c] = box.contains(around.center());
  }
  return is_inside;
}

}  // namespace cadmorph
