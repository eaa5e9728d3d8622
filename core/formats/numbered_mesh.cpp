#include "core/formats/numbered_mesh.h"

#include <algorithm>
#include <limits>

namespace cadmorph {
namespace {

/// The node of each row: rows of one number are one node.
std::vector<Index> nodes_of_rows(const NumberedMesh& part, const NumberTable& table,
                                 Index first_node, const DeckSources& sources) {
  const auto place_of = [&](Index row) {
    for (const NodeRecords& block : part.records) {
      const auto found = std::ranges::lower_bound(block.nodes, row);
      if (found != block.nodes.end() && *found == row)
        return DeckPlace{block.file, block.places[std::size_t(found - block.nodes.begin())].place};
    }
    return DeckPlace{};
  };
  std::vector<Index> nodes(part.node_numbers.size());
  Index next = first_node;
  for (std::size_t row = 0; row < nodes.size(); ++row) {
    const auto first = std::size_t(table.find(part.node_numbers[row]));
    if (first == row) {
      nodes[row] = next++;
      continue;
    }
    nodes[row] = nodes[first];
    for (std::size_t c = 0; c < 3; ++c)
      if (part.coordinates[3 * row + c] != part.coordinates[3 * first + c])
        sources.fail(place_of(Index(row)),
                     "node " + std::to_string(part.node_numbers[row]) +
                         " is defined before, at another place: leave one of the "
                         "two definitions out");
  }
  return nodes;
}

void append_points(const NumberedMesh& part, const std::vector<NodeFrame>& frames,
                   const std::vector<Index>& nodes, std::vector<double>& points) {
  Index next = std::ssize(points) / 3;
  for (std::size_t row = 0; row < nodes.size(); ++row) {
    if (nodes[row] != next) continue;
    Eigen::RowVector3d point = Eigen::RowVector3d::Map(part.coordinates.data() + 3 * row);
    for (const NodeFrame& frame : frames) point = frame.to_mesh(point);
    points.insert(points.end(), point.data(), point.data() + 3);
    ++next;
  }
}

void append_cells(const NumberedMesh& part, const NumberTable& table,
                  const std::vector<Index>& nodes, const DeckSources& sources, Mesh& mesh) {
  if (mesh.offsets.empty()) mesh.offsets.push_back(0);
  const Index shift = std::ssize(mesh.connectivity);
  reserve_cells(mesh, std::ssize(part.types), std::ssize(part.connectivity));
  mesh.types.insert(mesh.types.end(), part.types.begin(), part.types.end());
  mesh.regions.insert(mesh.regions.end(), part.regions.begin(), part.regions.end());
  for (std::size_t e = 0; e < part.types.size(); ++e) {
    for (Index i = part.offsets[e]; i < part.offsets[e + 1]; ++i) {
      const Index row = table.find(part.connectivity[std::size_t(i)]);
      if (row < 0)
        sources.fail(part.places[e], "element " + std::to_string(part.element_numbers[e]) +
                                         " uses node " +
                                         std::to_string(part.connectivity[std::size_t(i)]) +
                                         ", which is not defined");
      mesh.connectivity.push_back(nodes[std::size_t(row)]);
    }
    mesh.offsets.push_back(shift + part.offsets[e + 1]);
  }
}

/// Numbers that nothing has are left out, as the solvers do.
void append_sets(const NumberedMesh& part, const MeshAssembly::Placed& placed, Mesh& mesh) {
  const bool has_elements =
      std::ranges::any_of(part.sets, [](const NumberedSet& set) { return set.is_of_elements; });
  const NumberTable elements = has_elements ? NumberTable(part.element_numbers) : NumberTable();
  GroupNodes nodes(placed.nodes.empty() ? 0 : std::ranges::max(placed.nodes) + 1);
  for (const NumberedSet& set : part.sets) {
    const auto add_row = [&](Index row) {
      if (row < 0) return;
      if (set.is_of_elements)
        nodes.add(mesh.cell(placed.first_cell + row));
      else
        nodes.add(placed.nodes[std::size_t(row)]);
    };
    for (const Index number : set.numbers)
      add_row(set.is_of_elements ? elements.find(number) : placed.rows.find(number));
    for (const Index row : set.rows) add_row(row);
    NodeGroup group{.name = set.name, .kind = set.kind, .nodes = nodes.take()};
    if (!group.nodes.empty()) mesh.groups.push_back(std::move(group));
  }
}

}  // namespace

void NumberedMesh::add_node(Index number, const Eigen::RowVector3d& point) {
  node_numbers.push_back(number);
  coordinates.insert(coordinates.end(), point.data(), point.data() + 3);
}

void NumberedMesh::add_element(Index number, CellType type, std::span<const Index> nodes,
                               int region, DeckPlace place) {
  element_numbers.push_back(number);
  types.push_back(type);
  connectivity.insert(connectivity.end(), nodes.begin(), nodes.end());
  offsets.push_back(std::ssize(connectivity));
  regions.push_back(region);
  places.push_back(place);
}

MeshAssembly::Placed MeshAssembly::add(const NumberedMesh& part,
                                       const std::vector<NodeFrame>& frames) {
  Placed placed{
      .rows = NumberTable(part.node_numbers), .nodes = {}, .first_cell = mesh_.cell_count()};
  placed.nodes = nodes_of_rows(part, placed.rows, std::ssize(points_) / 3, sources_);
  append_points(part, frames, placed.nodes, points_);
  append_cells(part, placed.rows, placed.nodes, sources_, mesh_);
  append_sets(part, placed, mesh_);
  for (NodeRecords block : part.records) {
    for (Index& node : block.nodes) node = placed.nodes[std::size_t(node)];
    block.frames.insert(block.frames.end(), frames.begin(), frames.end());
    records_.push_back(std::move(block));
  }
  return placed;
}

ReadMesh MeshAssembly::finish(DeckSources sources, const std::string& region_array) {
  if (points_.empty()) sources.fail({}, "there are no nodes in it");
  ReadMesh result;
  mesh_.points = Eigen::Map<const Points>(points_.data(), std::ssize(points_) / 3, 3);
  const auto is_first = [&](int region) { return region == mesh_.regions[0]; };
  if (mesh_.regions.empty() || std::ranges::all_of(mesh_.regions, is_first))
    mesh_.regions.clear();
  else
    mesh_.region_array = region_array;
  tidy_groups(mesh_);
  if (sources.has_repeats())
    for (NodeRecords& block : records_) block.is_shared = true;
  result.mesh = std::move(mesh_);
  result.copier = make_deck_copier(std::move(sources).take_files(), std::move(records_));
  return result;
}

}  // namespace cadmorph
