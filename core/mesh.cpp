#include "core/mesh.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "core/cell_topology.h"
#include "core/errors.h"

namespace cadmorph {
namespace {

using enum CellType;

constexpr LocalFace kTetra[] = {{Triangle, 3, {0, 1, 3}},
                                {Triangle, 3, {1, 2, 3}},
                                {Triangle, 3, {2, 0, 3}},
                                {Triangle, 3, {0, 2, 1}}};
constexpr LocalFace kVoxel[] = {{Quad, 4, {0, 4, 6, 2}}, {Quad, 4, {1, 3, 7, 5}},
                                {Quad, 4, {0, 1, 5, 4}}, {Quad, 4, {2, 6, 7, 3}},
                                {Quad, 4, {0, 2, 3, 1}}, {Quad, 4, {4, 5, 7, 6}}};
constexpr LocalFace kHexahedron[] = {{Quad, 4, {0, 4, 7, 3}}, {Quad, 4, {1, 2, 6, 5}},
                                     {Quad, 4, {0, 1, 5, 4}}, {Quad, 4, {3, 7, 6, 2}},
                                     {Quad, 4, {0, 3, 2, 1}}, {Quad, 4, {4, 5, 6, 7}}};
constexpr LocalFace kWedge[] = {{Triangle, 3, {0, 1, 2}},
                                {Triangle, 3, {3, 5, 4}},
                                {Quad, 4, {0, 3, 4, 1}},
                                {Quad, 4, {1, 4, 5, 2}},
                                {Quad, 4, {2, 5, 3, 0}}};
constexpr LocalFace kPyramid[] = {{Quad, 4, {0, 3, 2, 1}},
                                  {Triangle, 3, {0, 1, 4}},
                                  {Triangle, 3, {1, 2, 4}},
                                  {Triangle, 3, {2, 3, 4}},
                                  {Triangle, 3, {3, 0, 4}}};
constexpr LocalFace kQuadraticTetra[] = {{QuadraticTriangle, 6, {0, 1, 3, 4, 8, 7}},
                                         {QuadraticTriangle, 6, {1, 2, 3, 5, 9, 8}},
                                         {QuadraticTriangle, 6, {2, 0, 3, 6, 7, 9}},
                                         {QuadraticTriangle, 6, {0, 2, 1, 6, 5, 4}}};
constexpr LocalFace kQuadraticHexahedron[] = {{QuadraticQuad, 8, {0, 4, 7, 3, 16, 15, 19, 11}},
                                              {QuadraticQuad, 8, {1, 2, 6, 5, 9, 18, 13, 17}},
                                              {QuadraticQuad, 8, {0, 1, 5, 4, 8, 17, 12, 16}},
                                              {QuadraticQuad, 8, {3, 7, 6, 2, 19, 14, 18, 10}},
                                              {QuadraticQuad, 8, {0, 3, 2, 1, 11, 10, 9, 8}},
                                              {QuadraticQuad, 8, {4, 5, 6, 7, 12, 13, 14, 15}}};
constexpr LocalFace kTriquadraticHexahedron[] = {
    {BiquadraticQuad, 9, {0, 4, 7, 3, 16, 15, 19, 11, 20}},
    {BiquadraticQuad, 9, {1, 2, 6, 5, 9, 18, 13, 17, 21}},
    {BiquadraticQuad, 9, {0, 1, 5, 4, 8, 17, 12, 16, 22}},
    {BiquadraticQuad, 9, {3, 7, 6, 2, 19, 14, 18, 10, 23}},
    {BiquadraticQuad, 9, {0, 3, 2, 1, 11, 10, 9, 8, 24}},
    {BiquadraticQuad, 9, {4, 5, 6, 7, 12, 13, 14, 15, 25}}};
constexpr LocalFace kBiquadraticQuadraticHexahedron[] = {
    {BiquadraticQuad, 9, {0, 4, 7, 3, 16, 15, 19, 11, 20}},
    {BiquadraticQuad, 9, {1, 2, 6, 5, 9, 18, 13, 17, 21}},
    {BiquadraticQuad, 9, {0, 1, 5, 4, 8, 17, 12, 16, 22}},
    {BiquadraticQuad, 9, {3, 7, 6, 2, 19, 14, 18, 10, 23}},
    {QuadraticQuad, 8, {0, 3, 2, 1, 11, 10, 9, 8}},
    {QuadraticQuad, 8, {4, 5, 6, 7, 12, 13, 14, 15}}};
constexpr LocalFace kQuadraticWedge[] = {{QuadraticTriangle, 6, {0, 1, 2, 6, 7, 8}},
                                         {QuadraticTriangle, 6, {3, 5, 4, 11, 10, 9}},
                                         {QuadraticQuad, 8, {0, 3, 4, 1, 12, 9, 13, 6}},
                                         {QuadraticQuad, 8, {1, 4, 5, 2, 13, 10, 14, 7}},
                                         {QuadraticQuad, 8, {2, 5, 3, 0, 14, 11, 12, 8}}};
// The curved edges of a QuadraticLinearQuad are its first and third.
constexpr LocalFace kQuadraticLinearWedge[] = {{QuadraticTriangle, 6, {0, 1, 2, 6, 7, 8}},
                                               {QuadraticTriangle, 6, {3, 5, 4, 11, 10, 9}},
                                               {QuadraticLinearQuad, 6, {3, 4, 1, 0, 9, 6}},
                                               {QuadraticLinearQuad, 6, {4, 5, 2, 1, 10, 7}},
                                               {QuadraticLinearQuad, 6, {5, 3, 0, 2, 11, 8}}};
constexpr LocalFace kBiquadraticQuadraticWedge[] = {
    {QuadraticTriangle, 6, {0, 1, 2, 6, 7, 8}},
    {QuadraticTriangle, 6, {3, 5, 4, 11, 10, 9}},
    {BiquadraticQuad, 9, {0, 3, 4, 1, 12, 9, 13, 6, 15}},
    {BiquadraticQuad, 9, {1, 4, 5, 2, 13, 10, 14, 7, 16}},
    {BiquadraticQuad, 9, {2, 5, 3, 0, 14, 11, 12, 8, 17}}};
constexpr LocalFace kQuadraticPyramid[] = {{QuadraticQuad, 8, {0, 3, 2, 1, 8, 7, 6, 5}},
                                           {QuadraticTriangle, 6, {0, 1, 4, 5, 10, 9}},
                                           {QuadraticTriangle, 6, {1, 2, 4, 6, 11, 10}},
                                           {QuadraticTriangle, 6, {2, 3, 4, 7, 12, 11}},
                                           {QuadraticTriangle, 6, {3, 0, 4, 8, 9, 12}}};

struct TypeInfo {
  int dimension = -1;
  int nodes = 0;
  std::span<const LocalFace> faces;
};

TypeInfo type_info(CellType type) {
  switch (type) {
    case Vertex:
      return {0, 1, {}};
    case PolyVertex:
      return {0, -1, {}};
    case Line:
      return {1, 2, {}};
    case PolyLine:
      return {1, -1, {}};
    case QuadraticEdge:
      return {1, 3, {}};
    case Triangle:
      return {2, 3, {}};
    case Polygon:
      return {2, -1, {}};
    case Pixel:
    case Quad:
      return {2, 4, {}};
    case QuadraticTriangle:
      return {2, 6, {}};
    case BiquadraticTriangle:
      return {2, 7, {}};
    case QuadraticLinearQuad:
      return {2, 6, {}};
    case QuadraticQuad:
      return {2, 8, {}};
    case BiquadraticQuad:
      return {2, 9, {}};
    case Tetra:
      return {3, 4, kTetra};
    case Voxel:
      return {3, 8, kVoxel};
    case Hexahedron:
      return {3, 8, kHexahedron};
    case Wedge:
      return {3, 6, kWedge};
    case Pyramid:
      return {3, 5, kPyramid};
    case QuadraticTetra:
      return {3, 10, kQuadraticTetra};
    case QuadraticHexahedron:
      return {3, 20, kQuadraticHexahedron};
    case TriquadraticHexahedron:
      return {3, 27, kTriquadraticHexahedron};
    case BiquadraticQuadraticHexahedron:
      return {3, 24, kBiquadraticQuadraticHexahedron};
    case QuadraticWedge:
      return {3, 15, kQuadraticWedge};
    case QuadraticLinearWedge:
      return {3, 12, kQuadraticLinearWedge};
    case BiquadraticQuadraticWedge:
      return {3, 18, kBiquadraticQuadraticWedge};
    case QuadraticPyramid:
      return {3, 13, kQuadraticPyramid};
    case Polyhedron:
      return {3, -1, {}};
  }
  return {};
}

CellType polygon_type(std::size_t nodes) {
  return nodes == 3 ? Triangle : nodes == 4 ? Quad : Polygon;
}

[[noreturn]] void fail(const std::string& text) {
  throw InvalidInputError("invalid mesh: " + text);
}

std::string cell_name(Index c) { return "cell " + std::to_string(c); }

void check_node_ids(std::span<const Index> nodes, Index node_count, Index c) {
  for (Index node : nodes)
    if (node < 0 || node >= node_count)
      fail(cell_name(c) + " refers to node " + std::to_string(node) + ", but there are " +
           std::to_string(node_count) + " nodes");
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
      fail("polyhedron " + cell_name(c) + " has a face of " + std::to_string(count) + " nodes");
    const auto face = std::span(mesh.polyhedron_faces).subspan(at + 1, count);
    check_node_ids(face, mesh.node_count(), c);
    for (const Index node : face)
      if (last_cell[node] != c)
        fail("polyhedron " + cell_name(c) + " has a face with node " + std::to_string(node) +
             ", which is not among the cell's own nodes");
    at += count + 1;
    ++faces;
  }
  if (faces < 4) fail("polyhedron " + cell_name(c) + " has fewer than 4 faces");
}

void check_cell(const Mesh& mesh, Index c) {
  const TypeInfo info = type_info(mesh.types[c]);
  const Index nodes = static_cast<Index>(mesh.cell(c).size());
  if (info.dimension < 0)
    fail(cell_name(c) + " is of VTK type " + std::to_string(static_cast<int>(mesh.types[c])) +
         ", which is not supported; convert it to linear or quadratic cells");
  const Index least = mesh.types[c] == Polygon ? 3 : 1;
  if (info.nodes >= 0 ? nodes != info.nodes : nodes < least)
    fail(cell_name(c) + " has " + std::to_string(nodes) + " nodes, which its type (VTK " +
         std::to_string(static_cast<int>(mesh.types[c])) + ") can't have");
  check_node_ids(mesh.cell(c), mesh.node_count(), c);
}

}  // namespace

int cell_node_count(CellType type) { return type_info(type).nodes; }

std::span<const LocalFace> local_faces(CellType type) { return type_info(type).faces; }

int dimension(CellType type) { return type_info(type).dimension; }

int dimension(const Mesh& mesh) {
  int highest = -1;
  for (CellType type : mesh.types) {
    highest = std::max(highest, dimension(type));
    if (highest == 3) break;
  }
  return highest;
}

std::vector<Facet> cell_facets(const Mesh& mesh, Index c) {
  if (dimension(mesh.types[c]) != 3) throw InvalidInputError(cell_name(c) + " is no solid cell");
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
  switch (type) {
    case Triangle:
    case QuadraticTriangle:
    case BiquadraticTriangle:
      return 3;
    case Quad:
    case Pixel:
    case QuadraticQuad:
    case BiquadraticQuad:
    case QuadraticLinearQuad:
      return 4;
    default:
      return static_cast<int>(node_count);
  }
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
      fail("the coordinates of node " + std::to_string(n) + " are not finite");
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
}

}  // namespace cadmorph
