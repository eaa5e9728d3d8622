#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "core/mesh.h"

namespace cadmorph {

/// A face of a solid cell type, in the cell's local node numbers.
struct LocalFace {
  CellType type;
  int count;                          ///< nodes in use
  std::array<std::uint8_t, 9> nodes;  ///< corners first, normal outwards
};

/// Number of nodes of a cell type; -1 when it varies (polygon, polyhedron, polyline, polyvertex), 0
/// for a number that is no type of CellType.
int cell_node_count(CellType type);

/// Faces of a solid cell type for VTK's node order. Empty for polyhedra and for all that is no
/// solid.
std::span<const LocalFace> local_faces(CellType type);

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
