#include "core/plane_mesh.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <tuple>
#include <utility>
#include <vector>

#include "core/boundary.h"
#include "core/cell_faces.h"

namespace cadmorph {
namespace {

constexpr double kFlat = 1e-12;  // of the mesh's size: rounding of coordinates

// Corners of a shell cell in their order round it.
std::vector<Index> loop(const Mesh& mesh, Index cell) {
  const auto nodes = mesh.cell(cell);
  const Index count = corner_count(mesh.types[cell], std::ssize(nodes));
  std::vector<Index> result(nodes.begin(), nodes.begin() + count);
  if (mesh.types[cell] == CellType::Pixel) std::swap(result[2], result[3]);
  return result;
}

double doubled_area(const std::vector<Index>& nodes, const Points& points, int flat_axis) {
  const int u = (flat_axis + 1) % 3, v = (flat_axis + 2) % 3;
  double sum = 0;
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    const Index a = nodes[i], b = nodes[(i + 1) % nodes.size()];
    sum += (points(a, u) - points(nodes[0], u)) * (points(b, v) - points(nodes[0], v)) -
           (points(b, u) - points(nodes[0], u)) * (points(a, v) - points(nodes[0], v));
  }
  return sum;
}

// Lets a shell cell go round the other way.
void turn_round(Mesh& mesh, Index cell) {
  const auto first = mesh.connectivity.begin() + mesh.offsets[cell];
  const Index count = corner_count(mesh.types[cell], mesh.offsets[cell + 1] - mesh.offsets[cell]);
  if (mesh.types[cell] == CellType::Pixel) return std::swap(first[1], first[2]);
  if (mesh.types[cell] == CellType::QuadraticLinearQuad) {  // nodes amid the first and third edge
    std::swap(first[0], first[1]);
    return std::swap(first[2], first[3]);
  }
  std::reverse(first + 1, first + count);
  // Edge k, from corner k on, becomes the k-th from the end.
  if (mesh.offsets[cell + 1] - mesh.offsets[cell] >= 2 * count)
    std::reverse(first + count, first + 2 * count);
}

// For each cell the first one of its patch: shell cells that share an edge belong together where
// they go along it in opposite senses.
std::vector<Index> patches_of_one_sense(const Mesh& mesh) {
  struct Side {
    Index low, high, cell;
    bool is_upward;
  };
  std::vector<Side> sides;
  for (Index c = 0; c < mesh.cell_count(); ++c) {
    if (dimension(mesh.types[c]) != 2) continue;
    const std::vector<Index> nodes = loop(mesh, c);
    for (std::size_t i = 0; i < nodes.size(); ++i) {
      const Index a = nodes[i], b = nodes[(i + 1) % nodes.size()];
      sides.push_back({std::min(a, b), std::max(a, b), c, a < b});
    }
  }
  std::ranges::sort(sides, {}, [](const Side& s) { return std::tuple(s.low, s.high, s.cell); });
  std::vector<Index> first(mesh.cell_count());
  std::iota(first.begin(), first.end(), Index{0});
  const auto patch = [&](Index c) {
    while (first[c] != c) c = first[c] = first[first[c]];
    return c;
  };
  for (std::size_t i = 1; i < sides.size(); ++i) {
    const Side &a = sides[i - 1], &b = sides[i];
    if (a.low != b.low || a.high != b.high || a.is_upward == b.is_upward) continue;
    const Index one = patch(a.cell), other = patch(b.cell);
    first[std::max(one, other)] = std::min(one, other);
  }
  for (Index c = 0; c < mesh.cell_count(); ++c) first[c] = patch(c);
  return first;
}

// The face and its copy `off` nodes on, and a quad along each side.
std::vector<std::vector<Index>> prism_faces(const std::vector<Index>& nodes, Index off) {
  std::vector<std::vector<Index>> faces{{nodes.rbegin(), nodes.rend()}, nodes};
  for (Index& node : faces[1]) node += off;
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    const Index a = nodes[i], b = nodes[(i + 1) % nodes.size()];
    faces.push_back({a, b, b + off, a + off});
  }
  return faces;
}

double doubled_area(const Mesh& mesh, const Points& points, int flat_axis) {
  double area = 0;
  for (Index c = 0; c < mesh.cell_count(); ++c)
    if (dimension(mesh.types[c]) == 2) area += doubled_area(loop(mesh, c), points, flat_axis);
  return area;
}

}  // namespace

int flat_axis(const Mesh& mesh, const Points& points) {
  if (dimension(mesh) != 2) return -1;
  const Eigen::RowVector3d extent = points.colwise().maxCoeff() - points.colwise().minCoeff();
  int axis = 0;
  return extent.minCoeff(&axis) <= kFlat * extent.maxCoeff() ? axis : -1;
}

Eigen::Vector3d plane_normal(const Mesh& mesh, const Points& points) {
  const int axis = flat_axis(mesh, points);
  if (axis < 0) return Eigen::Vector3d::Zero();
  return (doubled_area(mesh, points, axis) < 0 ? -1 : 1) * Eigen::Vector3d::Unit(axis);
}

Eigen::Vector3d plane_normal(const Mesh& mesh, const Points& before, const Points& after) {
  const Eigen::Vector3d normal = plane_normal(mesh, before);
  return normal == plane_normal(mesh, after) ? normal : Eigen::Vector3d::Zero();
}

std::vector<Index> turned_cells(const Mesh& mesh, const Points& points) {
  const int axis = flat_axis(mesh, points);
  std::vector<Index> with, against;
  double area_with = 0, area_against = 0;
  for (Index c = 0; c < mesh.cell_count() && axis >= 0; ++c) {
    if (dimension(mesh.types[c]) != 2) continue;
    const double area = doubled_area(loop(mesh, c), points, axis);
    (area < 0 ? against : with).push_back(c);
    (area < 0 ? area_against : area_with) += std::abs(area);
  }
  return area_against > area_with ? with : against;
}

std::optional<Mesh> in_one_sense(const Mesh& mesh) {
  const int axis = flat_axis(mesh, mesh.points);
  if (axis < 0 || turned_cells(mesh, mesh.points).empty()) return std::nullopt;
  std::vector<Index> patch = patches_of_one_sense(mesh);
  std::vector<double> areas(mesh.cell_count(), 0);
  for (Index c = 0; c < mesh.cell_count(); ++c)
    if (dimension(mesh.types[c]) == 2)
      areas[patch[c]] += doubled_area(loop(mesh, c), mesh.points, axis);
  const double sense = doubled_area(mesh, mesh.points, axis) < 0 ? -1 : 1;
  std::optional<Mesh> result;
  for (Index c = 0; c < mesh.cell_count(); ++c) {
    if (dimension(mesh.types[c]) != 2 || sense * areas[patch[c]] >= 0) continue;
    if (!result) result = mesh;
    turn_round(*result, c);
  }
  return result;
}

Mesh one_layer(const Mesh& mesh, const Points& points) {
  const Index n = mesh.node_count();
  Mesh layer;
  layer.points.resize(2 * n, 3);
  layer.points << points, points;
  layer.points.bottomRows(n).rowwise() += plane_normal(mesh, points).transpose();
  for (Index c = 0; c < mesh.cell_count(); ++c) {
    if (dimension(mesh.types[c]) != 2) {
      add_cell(layer, mesh.types[c], mesh.cell(c));
      continue;
    }
    std::vector<Index> nodes = loop(mesh, c);
    if (nodes.size() > 4) {
      add_polyhedron(layer, prism_faces(nodes, n));
      continue;
    }
    const bool is_triangle = nodes.size() == 3;
    if (is_triangle) std::swap(nodes[1], nodes[2]);  // a wedge's first face looks inwards
    for (std::size_t i = 0, corners = nodes.size(); i < corners; ++i) nodes.push_back(nodes[i] + n);
    add_cell(layer, is_triangle ? CellType::Wedge : CellType::Hexahedron, nodes);
  }
  return layer;
}

std::vector<char> border_nodes(const Mesh& mesh, const Points& points) {
  const Index n = mesh.node_count();
  std::vector<char> result(std::size_t(n), 0);
  const auto mark = [&](std::span<const Index> nodes) {
    for (const Index node : nodes) result[std::size_t(node % n)] = 1;
  };
  const auto region = [&](Index c) { return mesh.regions.empty() ? 0 : mesh.regions[c]; };
  const Mesh layer = one_layer(mesh, points);
  const CellNeighbours neighbours = find_cell_neighbours(layer);
  for (Index c = 0; c < mesh.cell_count(); ++c) {
    if (dimension(mesh.types[c]) < 2) mark(mesh.cell(c));
    if (dimension(layer.types[c]) < 3) continue;
    const std::vector<Facet> facets = cell_facets(layer, c);
    for (std::size_t f = 0; f < facets.size(); ++f) {
      const Index other = neighbours.neighbour[neighbours.offsets[c] + Index(f)];
      const auto [low, high] = std::ranges::minmax(facets[f].nodes);
      if (low < n && high >= n && (other < 0 || region(other) != region(c))) mark(facets[f].nodes);
    }
  }
  return result;
}

}  // namespace cadmorph
