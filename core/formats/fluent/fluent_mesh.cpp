#include "core/formats/fluent/fluent_mesh.h"

#include <algorithm>
#include <map>
#include <utility>

#include "core/formats/mesh_format.h"

namespace fs = std::filesystem;

namespace cadmorph {
namespace {

// Types of zones, as Fluent numbers them.
constexpr Index kInterior = 2, kParentFaces = 31, kParentCells = 32;

/// Fluent's word for a type of zones.
std::string word_of(Index type) {
  switch (type) {
    case 2:
      return "interior";
    case 3:
      return "wall";
    case 4:
      return "pressure-inlet";
    case 5:
      return "pressure-outlet";
    case 7:
      return "symmetry";
    case 8:
      return "periodic-shadow";
    case 9:
      return "pressure-far-field";
    case 10:
      return "velocity-inlet";
    case 12:
      return "periodic";
    case 14:
      return "fan";
    case 20:
      return "mass-flow-inlet";
    case 24:
      return "interface";
    case 36:
      return "outflow";
    case 37:
      return "axis";
    default:
      return {};
  }
}

/// Adds a group, or finds that of the zone's other sections.
NodeGroup& group_of(const FluentZone& zone, const std::string& kind,
                    std::map<Index, std::size_t>& groups, Mesh& mesh) {
  const auto [at, is_new] = groups.emplace(zone.id, mesh.groups.size());
  if (!is_new) return mesh.groups[at->second];
  NodeGroup& group = mesh.groups.emplace_back();
  group.name = zone.name.empty() ? "zone " + std::to_string(zone.id) : zone.name;
  group.kind = zone.word.empty() ? kind : kind + " (" + zone.word + ")";
  return group;
}

/// Numbers the cells anew without those that are divided. Returns the number of those left.
Index drop_parents(FluentMesh& fluent, const fs::path& path) {
  FaceList& faces = fluent.faces;
  for (const FluentZone& zone : fluent.face_zones) {
    if (zone.type != kParentFaces) continue;
    std::fill(faces.owner.begin() + zone.first, faces.owner.begin() + zone.end, -1);
    std::fill(faces.neighbour.begin() + zone.first, faces.neighbour.begin() + zone.end, -1);
  }
  Index count = 0;
  for (const FluentZone& zone : fluent.cell_zones) count = std::max(count, zone.end);
  std::vector<Index> numbers(std::size_t(count), -1);
  for (const FluentZone& zone : fluent.cell_zones)
    if (zone.type != kParentCells)
      std::fill(numbers.begin() + zone.first, numbers.begin() + zone.end, 0);
  Index left = 0;
  for (Index& number : numbers)
    if (number == 0) number = left++;
  const auto renumber = [&](Index& cell, Index f) {
    if (cell < 0) return;
    if (cell >= count)
      fail_reading(path, "face " + std::to_string(f + 1) + " is of cell " +
                             std::to_string(cell + 1) + ", but there are only " +
                             std::to_string(count) + " cells");
    cell = numbers[cell];
  };
  for (Index f = 0; f < faces.count(); ++f) {
    renumber(faces.owner[f], f);
    renumber(faces.neighbour[f], f);
    if (faces.owner[f] >= 0 || faces.neighbour[f] < 0) continue;
    std::swap(faces.owner[f], faces.neighbour[f]);
    std::reverse(faces.nodes.begin() + faces.offsets[f],
                 faces.nodes.begin() + faces.offsets[f + 1]);
  }
  for (FluentZone& zone : fluent.cell_zones) {
    const auto is_left = [](Index number) { return number >= 0; };
    const Index size =
        std::count_if(numbers.begin() + zone.first, numbers.begin() + zone.end, is_left);
    const Index before = std::count_if(numbers.begin(), numbers.begin() + zone.first, is_left);
    zone.first = before;
    zone.end = before + size;
  }
  std::erase_if(fluent.cell_zones, [](const FluentZone& zone) { return zone.first == zone.end; });
  return left;
}

/// A mesh of a surface alone, whose cells are the faces.
void add_shells(const FluentMesh& fluent, Mesh& mesh) {
  for (Index f = 0; f < fluent.faces.count(); ++f) {
    const auto face = fluent.faces.face(f);
    add_cell(mesh,
             face.size() == 2   ? CellType::Line
             : face.size() == 3 ? CellType::Triangle
             : face.size() == 4 ? CellType::Quad
                                : CellType::Polygon,
             face);
  }
}

void add_cell_zones(const FluentMesh& fluent, Mesh& mesh) {
  const auto is_same = [&](const FluentZone& zone) { return zone.id == fluent.cell_zones[0].id; };
  if (std::ranges::all_of(fluent.cell_zones, is_same)) return;
  std::map<Index, std::size_t> groups;
  mesh.region_array = "cell zone";
  mesh.regions.assign(mesh.types.size(), 0);
  for (const FluentZone& zone : fluent.cell_zones) {
    NodeGroup& group = group_of(zone, "cell zone", groups, mesh);
    for (Index c = zone.first; c < zone.end; ++c) {
      mesh.regions[c] = int(zone.id);
      const auto cell = mesh.cell(c);
      group.nodes.insert(group.nodes.end(), cell.begin(), cell.end());
    }
  }
}

}  // namespace

void FluentMesh::add_face(std::span<const Index> nodes, Index c0, Index c1) {
  // The normal points into c0; in the plane c0 is at the right of an edge.
  faces.add_face(nodes);
  if (c0 > 0)
    std::reverse(faces.nodes.end() - std::ssize(nodes), faces.nodes.end());
  else
    std::swap(c0, c1);
  faces.owner.push_back(c0 - 1);
  faces.neighbour.push_back(c1 - 1);
}

Mesh to_mesh(FluentMesh&& fluent, const fs::path& path) {
  const Index nodes = fluent.points.rows();
  for (Index f = 0; f < fluent.faces.count(); ++f)
    for (const Index node : fluent.faces.face(f))
      if (node < 0 || node >= nodes)
        fail_reading(path, "face " + std::to_string(f + 1) + " has node " +
                               std::to_string(node + 1) + ", but there are " +
                               std::to_string(nodes) + " nodes");
  Mesh mesh;
  mesh.points = std::move(fluent.points);
  const Index cells = drop_parents(fluent, path);
  if (cells == 0)
    add_shells(fluent, mesh);
  else if (fluent.dimension == 3)
    add_solid_cells(mesh, fluent.faces, cells, path);
  else
    add_plane_cells(mesh, fluent.faces, cells, path);
  std::map<Index, std::size_t> groups;
  for (FluentZone& zone : fluent.face_zones) {
    if (zone.word.empty()) zone.word = word_of(zone.type);
    if (zone.type == kInterior || zone.type == kParentFaces) continue;
    NodeGroup& group = group_of(zone, "face zone", groups, mesh);
    const auto first = fluent.faces.nodes.begin();
    group.nodes.insert(group.nodes.end(), first + fluent.faces.offsets[zone.first],
                       first + fluent.faces.offsets[zone.end]);
  }
  for (const auto& [zone, shadow] : fluent.periodic_zones) {
    const auto one = groups.find(zone), other = groups.find(shadow);
    if (one != groups.end() && other != groups.end())
      mesh.groups[one->second].partner = mesh.groups[other->second].name;
  }
  add_cell_zones(fluent, mesh);
  tidy_groups(mesh);
  return mesh;
}

}  // namespace cadmorph
