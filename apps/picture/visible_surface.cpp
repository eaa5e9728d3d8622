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
  const std::span<const Index> others(neighbours.neighbour.data() + neighbours.offsets[c],
                                      neighbours.neighbour.data() + neighbours.offsets[c + 1]);
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

std::vector<char> cells_above_middle(const Mesh& mesh, int axis) {
  const auto column = mesh.points.col(axis);
  const double middle = (column.minCoeff() + column.maxCoeff()) / 2;
  std::vector<char> is_above(mesh.cell_count(), 0);
  for (Index c = 0; c < mesh.cell_count(); ++c) {
    double low = std::numeric_limits<double>::max(), high = -low;
    for (const Index node : mesh.cell(c)) {
      low = std::min(low, column[node]);
      high = std::max(high, column[node]);
    }
    is_above[c] = (low + high) / 2 > middle;
  }
  return is_above;
}

}  // namespace cadmorph
