#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "core/mesh.h"

namespace cadmorph {

/// Reference cells.
enum class Shape { None, Simplex, Cube, Prism, Pyramid, Triangle, Quad };

/// An edge between two corners, in the cell's local node numbers.
struct LocalEdge {
  std::uint8_t a, b;
};

/// A face of a solid cell type, in the cell's local node numbers.
struct LocalFace {
  CellType type;
  int count;                          ///< nodes in use
  std::array<std::uint8_t, 9> nodes;  ///< corners first, normal outwards
};

/// A corner with three of its edges, whose determinant is positive in a sound cell.
using LocalCorner = std::array<std::uint8_t, 4>;  ///< the corner, the edges' other ends

inline constexpr LocalCorner kHexahedronCorners[] = {{0, 1, 3, 4}, {4, 7, 5, 0}, {1, 2, 0, 5},
                                                     {5, 4, 6, 1}, {2, 3, 1, 6}, {6, 5, 7, 2},
                                                     {3, 0, 2, 7}, {7, 6, 4, 3}};
// VTK's wedge has the normal of (0, 1, 2) point away from (3, 4, 5).
inline constexpr LocalCorner kWedgeCorners[] = {{0, 2, 1, 3}, {3, 4, 5, 0}, {1, 0, 2, 4},
                                                {4, 5, 3, 1}, {2, 1, 0, 5}, {5, 3, 4, 2}};
inline constexpr LocalCorner kPyramidCorners[] = {{0, 1, 3, 4}, {4, 0, 3, 2}, {1, 2, 0, 4},
                                                  {4, 1, 0, 3}, {2, 3, 1, 4}, {4, 2, 1, 0},
                                                  {3, 0, 2, 4}, {4, 3, 2, 1}};

/// The nodes of a hexahedron in those of a voxel.
inline constexpr std::array<int, 8> kVoxelOrder = {0, 1, 3, 2, 4, 5, 7, 6};

/// What is known of a cell type: all else about types follows from this.
struct CellInfo {
  int dimension = -1;  ///< -1: no type of CellType
  int nodes = 0;       ///< -1: it varies
  Shape shape = Shape::None;
  int corners = 0;  ///< the first nodes
  /// Those with a node in their middle first; these nodes follow the corners, in this order.
  std::span<const LocalEdge> edges = {};
  int mid_nodes = 0;
  /// Of a solid. Nodes in the middle of faces follow those of the edges, in this order.
  std::span<const LocalFace> faces = {};
};

const CellInfo& info_of(CellType type);

/// A node that is no corner, and the corners in whose middle it lies: those of its edge, its face
/// or the cell.
struct LocalMidNode {
  int node;
  std::vector<int> corners;
};

/// Those of a type whose number of nodes does not vary.
std::vector<LocalMidNode> mid_nodes_of(CellType type);

/// Puts straight cells at the corners of second-order ones, of all or of those that `is_straight`
/// tells. Cells as in Mesh.
void keep_corners(std::vector<CellType>& types, std::vector<Index>& offsets,
                  std::vector<Index>& connectivity,
                  const std::function<bool(Index cell)>& is_straight = {});

/// The mesh with pyramids of 13 nodes in place of those of 14, which VTK does not know: the node in
/// the middle of the base is in no cell then. Empty where the mesh has none.
std::optional<Mesh> as_vtk_has_it(const Mesh& mesh);

/// The linear type of the same corners; a type that has no nodes amid edges itself.
CellType linear_type(CellType type);

/// Whether any cell has nodes amid edges.
bool has_second_order(const Mesh& mesh);

/// The mesh with straight edges: of second-order cells the corners alone. Nodes keep their ids.
Mesh corners_alone(const Mesh& mesh);

/// Number of nodes of a cell type; -1 when it varies (polygon, polyhedron, polyline, polyvertex), 0
/// for a number that is no type of CellType.
inline int cell_node_count(CellType type) { return info_of(type).nodes; }

/// Faces of a solid cell type for VTK's node order. Empty for polyhedra and for all that is no
/// solid.
inline std::span<const LocalFace> local_faces(CellType type) { return info_of(type).faces; }

/// Calls visit(face_nodes) for each face of polyhedron `c`, in the file's order.
template <class Visit>
void for_each_polyhedron_face(const Mesh& mesh, Index c, Visit&& visit) {
  Index at = mesh.polyhedron_offsets[c];
  while (at < mesh.polyhedron_offsets[c + 1]) {
    const Index count = mesh.polyhedron_faces[at];
    visit(std::span<const Index>(mesh.polyhedron_faces.data() + at + 1, count));
    at += count + 1;
  }
}

}  // namespace cadmorph
