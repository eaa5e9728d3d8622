#include "models/star_cells.h"

#include <Eigen/Dense>
#include <algorithm>
#include <set>
#include <vector>

#include "core/boundary.h"

namespace cadmorph::models {
namespace {

// A pyramid of this share of the mean one is too flat to be counted on.
constexpr double flattest = 0.1;

struct Star {
  Index centre;
  std::vector<Facet> faces;  ///< outward
};

// Cells at each node.
std::vector<std::vector<Index>> cells_of_nodes(const Mesh& mesh) {
  std::vector<std::vector<Index>> cells(mesh.node_count());
  for (Index c = 0; c < mesh.cell_count(); ++c)
    for (const Index node : mesh.cell(c)) cells[node].push_back(c);
  return cells;
}

Star make_star(const Mesh& mesh, Index centre, const std::vector<Index>& cells) {
  Star star{centre, {}};
  for (const Index c : cells)
    for (Facet& facet : cell_facets(mesh, c))
      if (std::ranges::find(facet.nodes, centre) == facet.nodes.end())
        star.faces.push_back(std::move(facet));
  return star;
}

std::set<Index> nodes_of(const Star& star) {
  std::set<Index> nodes;
  for (const Facet& face : star.faces) nodes.insert(face.nodes.begin(), face.nodes.end());
  return nodes;
}

// Whether every face is seen from the mean of the nodes, and none under too flat a pyramid.
bool is_seen_from_mean(const Mesh& mesh, const Star& star) {
  const std::set<Index> nodes = nodes_of(star);
  Eigen::RowVector3d mean = Eigen::RowVector3d::Zero();
  for (const Index node : nodes) mean += mesh.points.row(node) / static_cast<double>(nodes.size());
  double smallest = INFINITY, sum = 0;
  for (const Facet& face : star.faces) {
    Eigen::Matrix3d edges;
    for (int i = 0; i < 3; ++i) edges.row(i) = mesh.points.row(face.nodes[i]) - mean;
    const double volume = edges.determinant();
    smallest = std::min(smallest, volume);
    sum += volume;
  }
  return smallest > flattest * sum / static_cast<double>(star.faces.size());
}

// Stars that share no cell, by ascending centre.
std::vector<Star> find_stars(const Mesh& mesh, std::vector<char>& is_taken) {
  const auto cells = cells_of_nodes(mesh);
  std::vector<char> is_inner(mesh.node_count(), 1);
  for (const Index node : extract_boundary(mesh).nodes) is_inner[node] = 0;
  std::vector<Star> stars;
  for (Index node = 0; node < mesh.node_count(); ++node) {
    const bool is_free = std::ranges::all_of(
        cells[node], [&](Index c) { return mesh.types[c] == CellType::Tetra && !is_taken[c]; });
    if (!is_inner[node] || cells[node].empty() || !is_free) continue;
    Star star = make_star(mesh, node, cells[node]);
    if (!is_seen_from_mean(mesh, star)) continue;
    for (const Index c : cells[node]) is_taken[c] = 1;
    stars.push_back(std::move(star));
  }
  return stars;
}

// New number of each node; -1 for centres.
std::vector<Index> number_nodes(const Mesh& mesh, const std::vector<Star>& stars, Mesh& result) {
  std::vector<Index> numbers(mesh.node_count(), 0);
  for (const Star& star : stars) numbers[star.centre] = -1;
  Index count = 0;
  for (Index& number : numbers)
    if (number == 0) number = count++;
  result.points.resize(count, 3);
  for (Index node = 0; node < mesh.node_count(); ++node)
    if (numbers[node] >= 0) result.points.row(numbers[node]) = mesh.points.row(node);
  return numbers;
}

void add_cell(Mesh& mesh, CellType type) {
  mesh.types.push_back(type);
  mesh.offsets.push_back(std::ssize(mesh.connectivity));
  mesh.polyhedron_offsets.push_back(std::ssize(mesh.polyhedron_faces));
}

}  // namespace

Mesh join_stars(const Mesh& mesh) {
  std::vector<char> is_taken(mesh.cell_count(), 0);
  const std::vector<Star> stars = find_stars(mesh, is_taken);
  Mesh result;
  result.offsets = result.polyhedron_offsets = {0};
  const std::vector<Index> numbers = number_nodes(mesh, stars, result);
  for (Index c = 0; c < mesh.cell_count(); ++c) {
    if (is_taken[c]) continue;
    for (const Index node : mesh.cell(c)) result.connectivity.push_back(numbers[node]);
    add_cell(result, mesh.types[c]);
  }
  for (const Star& star : stars) {
    for (const Index node : nodes_of(star)) result.connectivity.push_back(numbers[node]);
    for (const Facet& face : star.faces) {
      result.polyhedron_faces.push_back(std::ssize(face.nodes));
      for (const Index node : face.nodes) result.polyhedron_faces.push_back(numbers[node]);
    }
    add_cell(result, CellType::Polyhedron);
  }
  return result;
}

}  // namespace cadmorph::models
