#include "core/cell_topology.h"

#include <algorithm>
#include <numeric>

namespace cadmorph {
namespace {

using enum CellType;

using Edges = std::span<const LocalEdge>;

constexpr LocalEdge kLineEdges[] = {{0, 1}};
constexpr LocalEdge kTriangleEdges[] = {{0, 1}, {1, 2}, {2, 0}};
constexpr LocalEdge kPixelEdges[] = {{0, 1}, {1, 3}, {3, 2}, {2, 0}};
constexpr LocalEdge kQuadEdges[] = {{0, 1}, {1, 2}, {2, 3}, {3, 0}};
constexpr LocalEdge kQuadraticLinearQuadEdges[] = {{0, 1}, {2, 3}, {1, 2}, {3, 0}};
constexpr LocalEdge kTetraEdges[] = {{0, 1}, {1, 2}, {2, 0}, {0, 3}, {1, 3}, {2, 3}};
constexpr LocalEdge kVoxelEdges[] = {{0, 1}, {1, 3}, {3, 2}, {2, 0}, {4, 5}, {5, 7},
                                     {7, 6}, {6, 4}, {0, 4}, {1, 5}, {2, 6}, {3, 7}};
constexpr LocalEdge kHexahedronEdges[] = {{0, 1}, {1, 2}, {2, 3}, {3, 0}, {4, 5}, {5, 6},
                                          {6, 7}, {7, 4}, {0, 4}, {1, 5}, {2, 6}, {3, 7}};
constexpr LocalEdge kWedgeEdges[] = {{0, 1}, {1, 2}, {2, 0}, {3, 4}, {4, 5},
                                     {5, 3}, {0, 3}, {1, 4}, {2, 5}};
constexpr LocalEdge kPyramidEdges[] = {{0, 1}, {1, 2}, {2, 3}, {3, 0},
                                       {0, 4}, {1, 4}, {2, 4}, {3, 4}};

template <std::size_t N>
using Faces = std::array<LocalFace, N>;

constexpr Faces<4> kTetraFaces = {{{Triangle, 3, {0, 1, 3}},
                                   {Triangle, 3, {1, 2, 3}},
                                   {Triangle, 3, {2, 0, 3}},
                                   {Triangle, 3, {0, 2, 1}}}};
constexpr Faces<6> kVoxelFaces = {{{Quad, 4, {0, 4, 6, 2}},
                                   {Quad, 4, {1, 3, 7, 5}},
                                   {Quad, 4, {0, 1, 5, 4}},
                                   {Quad, 4, {2, 6, 7, 3}},
                                   {Quad, 4, {0, 2, 3, 1}},
                                   {Quad, 4, {4, 5, 7, 6}}}};
constexpr Faces<6> kHexahedronFaces = {{{Quad, 4, {0, 4, 7, 3}},
                                        {Quad, 4, {1, 2, 6, 5}},
                                        {Quad, 4, {0, 1, 5, 4}},
                                        {Quad, 4, {3, 7, 6, 2}},
                                        {Quad, 4, {0, 3, 2, 1}},
                                        {Quad, 4, {4, 5, 6, 7}}}};
constexpr Faces<5> kWedgeFaces = {{{Triangle, 3, {0, 1, 2}},
                                   {Triangle, 3, {3, 5, 4}},
                                   {Quad, 4, {0, 3, 4, 1}},
                                   {Quad, 4, {1, 4, 5, 2}},
                                   {Quad, 4, {2, 5, 3, 0}}}};
constexpr Faces<5> kPyramidFaces = {{{Quad, 4, {0, 3, 2, 1}},
                                     {Triangle, 3, {0, 1, 4}},
                                     {Triangle, 3, {1, 2, 4}},
                                     {Triangle, 3, {2, 3, 4}},
                                     {Triangle, 3, {3, 0, 4}}}};

/// The node in the middle of the edge between two corners; -1: it is straight.
constexpr int mid_node(Edges curved, int corners, int a, int b) {
  for (std::size_t e = 0; e < curved.size(); ++e)
    if ((curved[e].a == a && curved[e].b == b) || (curved[e].a == b && curved[e].b == a))
      return corners + static_cast<int>(e);
  return -1;
}

/// The face with the nodes in the middle of its edges, and its centre if that is one (>= 0). The
/// curved edges of a QuadraticLinearQuad are its first and third.
constexpr LocalFace curved_face(LocalFace face, Edges curved, int corners, int centre) {
  const int count = face.count;
  const auto mid = [&](int i) {
    return mid_node(curved, corners, face.nodes[std::size_t(i)],
                    face.nodes[std::size_t((i + 1) % count)]);
  };
  const auto add = [&](int node) {
    if (node >= 0) face.nodes[std::size_t(face.count++)] = static_cast<std::uint8_t>(node);
  };
  if (mid(0) < 0)
    std::rotate(face.nodes.begin(), face.nodes.begin() + 1, face.nodes.begin() + count);
  for (int i = 0; i < count; ++i) add(mid(i));
  face.type = count == 3               ? QuadraticTriangle
              : face.count < 2 * count ? QuadraticLinearQuad
              : centre < 0             ? QuadraticQuad
                                       : BiquadraticQuad;
  add(centre);
  return face;
}

/// Faces of a cell with nodes in the middle of these edges and of the faces from `first_centred`
/// on, as many as `centred`.
template <std::size_t N>
constexpr Faces<N> curved_faces(Faces<N> faces, Edges curved, int corners,
                                std::size_t first_centred = 0, std::size_t centred = 0) {
  for (std::size_t f = 0; f < N; ++f) {
    const bool has_centre = f >= first_centred && f < first_centred + centred;
    const int centre = corners + static_cast<int>(curved.size() + f - first_centred);
    faces[f] = curved_face(faces[f], curved, corners, has_centre ? centre : -1);
  }
  return faces;
}

constexpr auto kQuadraticTetraFaces = curved_faces(kTetraFaces, kTetraEdges, 4);
constexpr auto kQuadraticHexahedronFaces = curved_faces(kHexahedronFaces, kHexahedronEdges, 8);
constexpr auto kBiquadraticHexahedronFaces =
    curved_faces(kHexahedronFaces, kHexahedronEdges, 8, 0, 4);
constexpr auto kTriquadraticHexahedronFaces =
    curved_faces(kHexahedronFaces, kHexahedronEdges, 8, 0, 6);
constexpr auto kQuadraticWedgeFaces = curved_faces(kWedgeFaces, kWedgeEdges, 6);
constexpr auto kQuadraticLinearWedgeFaces =
    curved_faces(kWedgeFaces, Edges(kWedgeEdges).first(6), 6);
constexpr auto kBiquadraticWedgeFaces = curved_faces(kWedgeFaces, kWedgeEdges, 6, 2, 3);
constexpr auto kQuadraticPyramidFaces = curved_faces(kPyramidFaces, kPyramidEdges, 5);
constexpr auto kBiquadraticPyramidFaces = curved_faces(kPyramidFaces, kPyramidEdges, 5, 0, 1);

constexpr std::size_t kTypes = static_cast<std::size_t>(Polyhedron) + 1;

constexpr std::array<CellInfo, kTypes> make_table() {
  std::array<CellInfo, kTypes> table;
  const auto row = [&](CellType type) -> CellInfo& {
    return table[static_cast<std::size_t>(type)];
  };
  row(Vertex) = {0, 1};
  row(PolyVertex) = {0, -1};
  row(PolyLine) = {1, -1};
  row(Polygon) = {2, -1};
  row(Polyhedron) = {3, -1};

  row(Line) = {1, 2, Shape::None, 2, kLineEdges};
  row(Triangle) = {2, 3, Shape::Triangle, 3, kTriangleEdges};
  row(Pixel) = {2, 4, Shape::Quad, 4, kPixelEdges};
  row(Quad) = {2, 4, Shape::Quad, 4, kQuadEdges};
  row(Tetra) = {3, 4, Shape::Simplex, 4, kTetraEdges, 0, kTetraFaces};
  row(Voxel) = {3, 8, Shape::Cube, 8, kVoxelEdges, 0, kVoxelFaces};
  row(Hexahedron) = {3, 8, Shape::Cube, 8, kHexahedronEdges, 0, kHexahedronFaces};
  row(Wedge) = {3, 6, Shape::Prism, 6, kWedgeEdges, 0, kWedgeFaces};
  row(Pyramid) = {3, 5, Shape::Pyramid, 5, kPyramidEdges, 0, kPyramidFaces};

  const auto curved = [&](CellType type, CellType linear, int nodes, int mid_nodes,
                          std::span<const LocalFace> faces = {}) {
    row(type) = row(linear);
    row(type).nodes = nodes;
    row(type).mid_nodes = mid_nodes;
    row(type).faces = faces;
  };
  curved(QuadraticEdge, Line, 3, 1);
  curved(QuadraticTriangle, Triangle, 6, 3);
  curved(BiquadraticTriangle, Triangle, 7, 3);
  curved(QuadraticQuad, Quad, 8, 4);
  curved(BiquadraticQuad, Quad, 9, 4);
  curved(QuadraticLinearQuad, Quad, 6, 2);
  row(QuadraticLinearQuad).edges = kQuadraticLinearQuadEdges;
  curved(QuadraticTetra, Tetra, 10, 6, kQuadraticTetraFaces);
  curved(QuadraticHexahedron, Hexahedron, 20, 12, kQuadraticHexahedronFaces);
  curved(BiquadraticQuadraticHexahedron, Hexahedron, 24, 12, kBiquadraticHexahedronFaces);
  curved(TriquadraticHexahedron, Hexahedron, 27, 12, kTriquadraticHexahedronFaces);
  curved(QuadraticWedge, Wedge, 15, 9, kQuadraticWedgeFaces);
  curved(QuadraticLinearWedge, Wedge, 12, 6, kQuadraticLinearWedgeFaces);
  curved(BiquadraticQuadraticWedge, Wedge, 18, 9, kBiquadraticWedgeFaces);
  curved(QuadraticPyramid, Pyramid, 13, 8, kQuadraticPyramidFaces);
  curved(BiquadraticQuadraticPyramid, Pyramid, 14, 8, kBiquadraticPyramidFaces);
  return table;
}

constexpr std::array<CellInfo, kTypes> kTable = make_table();

}  // namespace

const CellInfo& info_of(CellType type) {
  const auto number = static_cast<std::size_t>(type);
  return kTable[number < kTypes ? number : 0];
}

std::vector<LocalMidNode> mid_nodes_of(CellType type) {
  const CellInfo& info = info_of(type);
  std::vector<LocalMidNode> result;
  int next = info.corners;
  for (const LocalEdge& edge : info.edges.first(std::size_t(info.mid_nodes)))
    result.push_back({next++, {edge.a, edge.b}});
  for (const LocalFace& face : info.faces) {
    const CellInfo& of_face = info_of(face.type);
    if (face.count == of_face.corners + of_face.mid_nodes) continue;
    result.push_back({face.nodes[std::size_t(face.count - 1)],
                      {face.nodes.begin(), face.nodes.begin() + of_face.corners}});
    ++next;
  }
  if (info.corners > 0 && next < info.nodes) {  // in the middle of all
    result.push_back({next, std::vector<int>(std::size_t(info.corners))});
    std::iota(result.back().corners.begin(), result.back().corners.end(), 0);
  }
  return result;
}

int dimension(CellType type) { return info_of(type).dimension; }

CellType linear_type(CellType type) {
  using enum CellType;
  if (info_of(type).mid_nodes == 0) return type;
  switch (info_of(type).shape) {
    case Shape::Simplex:
      return Tetra;
    case Shape::Cube:
      return Hexahedron;
    case Shape::Prism:
      return Wedge;
    case Shape::Pyramid:
      return CellType::Pyramid;
    case Shape::Triangle:
      return CellType::Triangle;
    case Shape::Quad:
      return CellType::Quad;
    case Shape::None:
      break;
  }
  return Line;
}

bool has_second_order(const Mesh& mesh) {
  return std::ranges::any_of(mesh.types, [](CellType type) { return info_of(type).mid_nodes > 0; });
}

void keep_corners(std::vector<CellType>& types, std::vector<Index>& offsets,
                  std::vector<Index>& connectivity,
                  const std::function<bool(Index cell)>& is_straight) {
  Index begin = 0, kept = 0;  // of the old cells, of the new ones
  for (std::size_t c = 0; c < types.size(); ++c) {
    const CellInfo& info = info_of(types[c]);
    const bool is_curved = info.mid_nodes > 0 && (!is_straight || is_straight(Index(c)));
    const Index end = offsets[c + 1];
    const Index count = is_curved ? info.corners : end - begin;
    if (is_curved) types[c] = linear_type(types[c]);
    std::copy_n(connectivity.begin() + begin, count, connectivity.begin() + kept);
    offsets[c + 1] = kept += count;
    begin = end;
  }
  connectivity.resize(std::size_t(kept));
}

std::optional<Mesh> as_vtk_has_it(const Mesh& mesh) {
  if (std::ranges::find(mesh.types, BiquadraticQuadraticPyramid) == mesh.types.end()) return {};
  Mesh result = mesh;
  result.connectivity.clear();
  for (Index c = 0; c < mesh.cell_count(); ++c) {
    auto nodes = mesh.cell(c);
    if (mesh.types[c] == BiquadraticQuadraticPyramid) {
      result.types[c] = QuadraticPyramid;
      nodes = nodes.first(std::size_t(cell_node_count(QuadraticPyramid)));
    }
    result.connectivity.insert(result.connectivity.end(), nodes.begin(), nodes.end());
    result.offsets[c + 1] = std::ssize(result.connectivity);
  }
  return result;
}

Mesh corners_alone(const Mesh& mesh) {
  Mesh result = mesh;
  keep_corners(result.types, result.offsets, result.connectivity);
  return result;
}

}  // namespace cadmorph
