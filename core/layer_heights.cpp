#include "core/layer_heights.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "core/cell_topology.h"
#include "core/plane_mesh.h"

namespace cadmorph {
namespace {

using Eigen::Vector3d;

constexpr double kKept = 0.01;
// Of its floor's shortest edge: a cell that is higher is none of a layer.
constexpr double kFlat = 1.5;

std::vector<Index> corners(const Facet& facet) {
  const Index count = corner_count(facet.type, std::ssize(facet.nodes));
  return {facet.nodes.begin(), facet.nodes.begin() + count};
}

Vector3d middle(const std::vector<Index>& nodes, const Points& points) {
  return points(nodes, Eigen::all).colwise().mean();
}

Vector3d normal(const std::vector<Index>& nodes, const Points& points) {
  Vector3d area = Vector3d::Zero();
  const Vector3d first = points.row(nodes[0]);
  for (std::size_t i = 1; i + 1 < nodes.size(); ++i)
    area +=
        (Vector3d(points.row(nodes[i])) - first).cross(Vector3d(points.row(nodes[i + 1])) - first);
  return area.normalized();
}

// A cell between a face and the one opposite to it.
struct Storey {
  std::vector<Index> floor, ceiling;
  Index above = -1;  // the cell beyond the ceiling

  double height(const Points& points) const {
    return std::abs((middle(ceiling, points) - middle(floor, points)).dot(normal(floor, points)));
  }
};

bool can_stand(CellType type) {
  const Shape shape = info_of(type).shape;
  return shape == Shape::Cube || shape == Shape::Prism;
}

Storey storey(const CellNeighbours& neighbours, Index cell, const std::vector<Facet>& facets,
              std::size_t floor) {
  Storey result{.floor = corners(facets[floor]), .ceiling = {}, .above = -1};
  for (std::size_t f = 0; f < facets.size(); ++f) {
    std::vector<Index> nodes = corners(facets[f]);
    const bool is_apart = std::ranges::none_of(
        nodes, [&](Index n) { return std::ranges::find(result.floor, n) != result.floor.end(); });
    if (!is_apart || nodes.size() != result.floor.size()) continue;
    result.ceiling = std::move(nodes);
    result.above = neighbours.neighbour[neighbours.offsets[cell] + static_cast<Index>(f)];
  }
  return result;
}

// The cell that stands on a storey, if it is one of these.
Storey next(const Mesh& mesh, const CellNeighbours& neighbours, Index below, const Storey& under) {
  const Index cell = under.above;
  if (cell < 0 || !can_stand(mesh.types[cell])) return {};
  const std::vector<Facet> facets = cell_facets(mesh, cell);
  for (std::size_t f = 0; f < facets.size(); ++f)
    if (neighbours.neighbour[neighbours.offsets[cell] + static_cast<Index>(f)] == below)
      return storey(neighbours, cell, facets, f);
  return {};
}

// Whether a cell is a layer's: less high than its floor is wide. On a symmetry plane that layers
// end at, cells stand as high as they are apart along the body.
bool is_flat(const Storey& one, const Points& points) {
  const double height = one.height(points);
  for (std::size_t i = 0; i < one.floor.size(); ++i) {
    const Index next = one.floor[(i + 1) % one.floor.size()];
    if (height > kFlat * (points.row(next) - points.row(one.floor[i])).norm()) return false;
  }
  return true;
}

bool moves(const Storey& one, const Points& before, const Points& after) {
  return std::ranges::any_of(one.floor, [&](Index n) { return before.row(n) != after.row(n); });
}

// The storey between the cell's one face on the part of the surface that moves and the cell that
// stands on it, if any.
Storey first_storey(const Mesh& mesh, const CellNeighbours& neighbours, Index cell,
                    const std::vector<char>& is_surface, const Points& before,
                    const Points& after) {
  const auto own = std::span(neighbours.neighbour)
                       .subspan(static_cast<std::size_t>(neighbours.offsets[cell]),
                                static_cast<std::size_t>(neighbours.offsets[cell + 1] -
                                                         neighbours.offsets[cell]));
  if (std::ranges::find(own, -1) == own.end()) return {};
  const std::vector<Facet> facets = cell_facets(mesh, cell);
  Storey found;
  for (std::size_t f = 0; f < facets.size(); ++f) {
    if (own[f] != -1) continue;
    Storey one = storey(neighbours, cell, facets, f);
    if (one.above < 0 || std::ranges::any_of(one.floor, [&](Index n) { return !is_surface[n]; }) ||
        !moves(one, before, after) || !is_flat(one, before))
      continue;
    if (!found.floor.empty()) return {};
    found = std::move(one);
  }
  return found;
}

LayerFigures measure_solid_layers(const Mesh& mesh, const CellNeighbours& neighbours,
                                  const std::vector<char>& is_surface, const Points& before,
                                  const Points& after) {
  LayerFigures result;
  Index kept = 0, stacked = 0;
  for (Index cell = 0; cell < mesh.cell_count(); ++cell) {
    if (!can_stand(mesh.types[cell])) continue;
    const Storey first = first_storey(mesh, neighbours, cell, is_surface, before, after);
    if (first.floor.empty()) continue;
    const double height = first.height(before), ratio = first.height(after) / height;
    if (!std::isfinite(ratio)) continue;
    result.least = result.cells == 0 ? ratio : std::min(result.least, ratio);
    result.most = result.cells == 0 ? ratio : std::max(result.most, ratio);
    ++result.cells;
    kept += std::abs(ratio - 1) <= kKept;
    const Storey second = next(mesh, neighbours, cell, first);
    if (second.ceiling.empty() || first.height(after) == 0) continue;
    ++stacked;
    result.growth_before += second.height(before) / height;
    result.growth_after += second.height(after) / first.height(after);
  }
  if (result.cells > 0)
    result.share_kept = static_cast<double>(kept) / static_cast<double>(result.cells);
  if (stacked > 0) {
    result.growth_before /= static_cast<double>(stacked);
    result.growth_after /= static_cast<double>(stacked);
  }
  return result;
}

}  // namespace

LayerFigures measure_layers(const Mesh& mesh, const CellNeighbours& neighbours,
                            const std::vector<char>& is_surface, const Points& before,
                            const Points& after) {
  if (!neighbours.neighbour.empty())
    return measure_solid_layers(mesh, neighbours, is_surface, before, after);
  const int axis = flat_axis(mesh, before);
  if (axis < 0) return {};
  const Mesh layer = one_layer(mesh, before);
  Points moved = layer.points;
  moved.topRows(after.rows()) = after;
  moved.bottomRows(after.rows()) += after - before;
  std::vector<char> is_on = is_surface;
  is_on.insert(is_on.end(), is_surface.begin(), is_surface.end());
  return measure_solid_layers(layer, find_cell_neighbours(layer), is_on, layer.points, moved);
}

}  // namespace cadmorph
