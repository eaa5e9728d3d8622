#include "core/mesh.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "core/cell_topology.h"
#include "core/errors.h"

namespace cadmorph {
namespace {

using enum CellType;

CellType polygon_type(std::size_t nodes) {
  return nodes == 3 ? Triangle : nodes == 4 ? Quad : Polygon;
}

[[noreturn]] void fail(const std::string& text) {
  throw InvalidInputError("invalid mesh: " + text);
}

void check_node_ids(const Mesh& mesh, std::span<const Index> nodes, Index c) {
  for (Index node : nodes)
    if (node < 0 || node >= mesh.node_count())
      fail(cell_name(mesh, c) + " refers to node " + std::to_string(node) + ", but there are " +
           std::to_string(mesh.node_count()) + " nodes");
}

void check_offsets(const std::vector<Index>& offsets, std::size_t cells, std::size_t total,
                   const char* what) {
  if (offsets.size() != cells + 1 || offsets.front() != 0 ||
      offsets.back() != static_cast<Index>(total) || !std::ranges::is_sorted(offsets))
    fail(std::string("the offsets of the ") + what + " do not ascend from 0 to its size");
}

// `last_cell` is the last polyhedron so far that names each node.
void check_polyhedron(const Mesh& mesh, Index c, std::vector<Index>& last_cell) {
  for (const Index node : mesh.cell(c)) last_cell[node] = c;
  Index at = mesh.polyhedron_offsets[c];
  const Index end = mesh.polyhedron_offsets[c + 1];
  Index faces = 0;
  while (at < end) {
    const Index count = mesh.polyhedron_faces[at];
    if (count < 3 || count > end - at - 1)
      fail("polyhedron " + cell_name(mesh, c) + " has a face of " + std::to_string(count) +
           " nodes");
    const auto face = std::span(mesh.polyhedron_faces).subspan(at + 1, count);
    check_node_ids(mesh, face, c);
    for (const Index node : face)
      if (last_cell[node] != c)
        fail("polyhedron " + cell_name(mesh, c) + " has a face with node " + std::to_string(node) +
             ", which is not among the cell's own nodes");
    at += count + 1;
    ++faces;
  }
  if (faces < 4) fail("polyhedron " + cell_name(mesh, c) + " has fewer than 4 faces");
}

void check_cell(const Mesh& mesh, Index c) {
  const CellInfo& info = info_of(mesh.types[c]);
  const Index nodes = static_cast<Index>(mesh.cell(c).size());
  if (info.dimension < 0)
    fail(cell_name(mesh, c) + " is of VTK type " + std::to_string(static_cast<int>(mesh.types[c])) +
         ", which is not supported; convert it to linear or quadratic cells");
  const Index least = mesh.types[c] == Polygon ? 3 : 1;
  if (info.nodes >= 0 ? nodes != info.nodes : nodes < least)
    fail(cell_name(mesh, c) + " has " + std::to_string(nodes) + " nodes, which its type (VTK " +
         std::to_string(static_cast<int>(mesh.types[c])) + ") can't have");
  check_node_ids(mesh, mesh.cell(c), c);
}

std::string name_of(const char* what, Index i, const Numbering& numbers, const char* in_file) {
  std::string name = what + (" " + std::to_string(i));
  if (!numbers.is_empty())
    name.append(" (")
        .append(in_file)
        .append(" ")
        .append(std::to_string(numbers[i]))
        .append(" of the file)");
  return name;
}

}  // namespace

std::string cell_name(const Mesh& mesh, Index cell) {
  return name_of("cell", cell, mesh.cell_numbers, "element");
}

std::string node_name(const Mesh& mesh, Index node) {
  return name_of("node", node, mesh.node_numbers, "number");
}

int dimension(const Mesh& mesh) {
  int highest = -1;
  for (CellType type : mesh.types) {
    highest = std::max(highest, dimension(type));
    if (highest == 3) break;
  }
  return highest;
}

std::vector<Facet> cell_facets(const Mesh& mesh, Index c) {
  if (dimension(mesh.types[c]) != 3)
    throw InvalidInputError(cell_name(mesh, c) + " is no solid cell");
  std::vector<Facet> facets;
  if (mesh.types[c] == Polyhedron) {
    for_each_polyhedron_face(mesh, c, [&](std::span<const Index> nodes) {
      facets.push_back({polygon_type(nodes.size()), {nodes.begin(), nodes.end()}});
    });
    return facets;
  }
  const auto cell = mesh.cell(c);
  for (const LocalFace& face : local_faces(mesh.types[c])) {
    Facet& facet = facets.emplace_back(face.type, std::vector<Index>{});
    for (int i = 0; i < face.count; ++i) facet.nodes.push_back(cell[face.nodes[i]]);
  }
  return facets;
}

int corner_count(CellType type, Index node_count) {
  const int corners = info_of(type).corners;
  return corners > 0 ? corners : static_cast<int>(node_count);
}

void reserve_cells(Mesh& mesh, Index cells, Index nodes) {
  const auto reserve = [](auto& values, Index more) {
    const std::size_t size = values.size() + std::size_t(more);
    // Twice as much as before, at least: many small blocks would move all values each time.
    if (size > values.capacity()) values.reserve(std::max(size, 2 * values.capacity()));
  };
  reserve(mesh.types, cells);
  reserve(mesh.offsets, cells + 1);
  reserve(mesh.regions, cells);
  reserve(mesh.connectivity, nodes);
}

void add_cell(Mesh& mesh, CellType type, std::span<const Index> nodes) {
  if (mesh.offsets.empty()) mesh.offsets.push_back(0);
  mesh.types.push_back(type);
  mesh.connectivity.insert(mesh.connectivity.end(), nodes.begin(), nodes.end());
  mesh.offsets.push_back(std::ssize(mesh.connectivity));
  if (!mesh.polyhedron_offsets.empty())
    mesh.polyhedron_offsets.push_back(std::ssize(mesh.polyhedron_faces));
}

void add_cells(Mesh& mesh, CellType type, std::vector<Index> nodes) {
  const Index width = cell_node_count(type), count = std::ssize(nodes) / width;
  const Index first = std::ssize(mesh.connectivity);
  reserve_cells(mesh, count, first == 0 ? 0 : std::ssize(nodes));
  if (first == 0)
    mesh.connectivity = std::move(nodes);
  else
    mesh.connectivity.insert(mesh.connectivity.end(), nodes.begin(), nodes.end());
  mesh.types.insert(mesh.types.end(), std::size_t(count), type);
  if (mesh.offsets.empty()) mesh.offsets.push_back(0);
  for (Index c = 1; c <= count; ++c) mesh.offsets.push_back(first + c * width);
  if (!mesh.polyhedron_offsets.empty())
    mesh.polyhedron_offsets.resize(mesh.types.size() + 1, std::ssize(mesh.polyhedron_faces));
}

void append_cells(Mesh& mesh, const Mesh& part) {
  const auto append = [](const auto& more, auto& values) {
    values.insert(values.end(), more.begin(), more.end());
  };
  const auto append_offsets = [](const std::vector<Index>& more, Index first,
                                 std::vector<Index>& offsets) {
    if (offsets.empty()) offsets.push_back(0);
    for (std::size_t c = 1; c < more.size(); ++c) offsets.push_back(first + more[c]);
  };
  const bool has_polyhedra = !part.polyhedron_offsets.empty();
  if (has_polyhedra && mesh.polyhedron_offsets.empty())
    mesh.polyhedron_offsets.assign(mesh.types.size() + 1, 0);
  append_offsets(part.offsets, std::ssize(mesh.connectivity), mesh.offsets);
  if (has_polyhedra)
    append_offsets(part.polyhedron_offsets, std::ssize(mesh.polyhedron_faces),
                   mesh.polyhedron_offsets);
  append(part.types, mesh.types);
  append(part.connectivity, mesh.connectivity);
  append(part.polyhedron_faces, mesh.polyhedron_faces);
  if (!mesh.polyhedron_offsets.empty())
    mesh.polyhedron_offsets.resize(mesh.types.size() + 1, std::ssize(mesh.polyhedron_faces));
}

void add_polyhedron(Mesh& mesh, std::span<const std::vector<Index>> faces) {
  if (mesh.polyhedron_offsets.empty()) mesh.polyhedron_offsets.assign(mesh.types.size() + 1, 0);
  std::vector<Index> nodes;
  for (const std::vector<Index>& face : faces) {
    mesh.polyhedron_faces.push_back(std::ssize(face));
    mesh.polyhedron_faces.insert(mesh.polyhedron_faces.end(), face.begin(), face.end());
    for (const Index node : face)
      if (std::ranges::find(nodes, node) == nodes.end()) nodes.push_back(node);
  }
  add_cell(mesh, Polyhedron, nodes);
}

void tidy_groups(Mesh& mesh) {
  std::vector<bool> is_member;
  for (NodeGroup& group : mesh.groups) {
    if (group.nodes.empty()) continue;
    // Large groups name most nodes many times: a pass over all numbers sorts them sooner.
    const auto end = std::size_t(std::ranges::max(group.nodes)) + 1;
    if (group.nodes.size() < end / 8) {
      std::ranges::sort(group.nodes);
      const auto double_nodes = std::ranges::unique(group.nodes);
      group.nodes.erase(double_nodes.begin(), double_nodes.end());
      continue;
    }
    is_member.assign(end, false);
    for (const Index node : group.nodes) is_member[std::size_t(node)] = true;
    group.nodes.clear();
    for (std::size_t node = 0; node < end; ++node)
      if (is_member[node]) group.nodes.push_back(Index(node));
    group.nodes.shrink_to_fit();
  }
}

void check_mesh(const Mesh& mesh) {
  if (mesh.node_count() == 0) fail("it has no nodes");
  if (mesh.cell_count() == 0) fail("it has no cells");
  for (Index n = 0; n < mesh.node_count(); ++n)
    if (!mesh.points.row(n).allFinite())
      fail("the coordinates of " + node_name(mesh, n) + " are not finite");
  const auto cells = mesh.types.size();
  check_offsets(mesh.offsets, cells, mesh.connectivity.size(), "connectivity");
  const bool has_polyhedra = std::ranges::find(mesh.types, Polyhedron) != mesh.types.end();
  if (has_polyhedra || !mesh.polyhedron_offsets.empty())
    check_offsets(mesh.polyhedron_offsets, cells, mesh.polyhedron_faces.size(), "polyhedron faces");
  if (!mesh.regions.empty() && mesh.regions.size() != cells)
    fail("it has " + std::to_string(mesh.regions.size()) + " region ids for " +
         std::to_string(cells) + " cells");
  std::vector<Index> last_cell(has_polyhedra ? mesh.node_count() : 0, -1);
  for (Index c = 0; c < mesh.cell_count(); ++c) {
    check_cell(mesh, c);
    if (mesh.types[c] == Polyhedron) check_polyhedron(mesh, c, last_cell);
  }
  const auto is_node = [&](Index node) { return node >= 0 && node < mesh.node_count(); };
  for (const Tie& tie : mesh.ties)
    if (!is_node(tie.node) || !std::ranges::all_of(tie.others, is_node))
      fail("it ties nodes that it does not have");
}

}  // namespace cadmorph
