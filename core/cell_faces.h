#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/mesh.h"

namespace cadmorph {

/// The cell on the other side of each face of each solid cell. Depends on the connectivity alone.
struct CellNeighbours {
  std::vector<Index> offsets;  ///< cells + 1 positions in `neighbour`; no faces for other cells
  /// By local face as cell_facets orders them: -1 on the outside, the cell itself where a face has
  /// fewer than three corners.
  std::vector<std::int32_t> neighbour;
  /// Cells that share one face, where more than two do: those of the face that comes first by cell
  /// and local number, ascending. Empty in a sound mesh, and not stored.
  std::vector<Index> overlapping;
  Index overlapping_face = -1;  ///< number of that face in the first of them

  std::span<const std::int32_t> of(Index cell) const {
    return std::span(neighbour).subspan(
        static_cast<std::size_t>(offsets[cell]),
        static_cast<std::size_t>(offsets[cell + 1] - offsets[cell]));
  }

  template <class Archive>
  void serialize(Archive& archive) {
    archive(offsets, neighbour);
  }
};

/// Pairs the faces of the solid cells by their corner nodes; where cells overlap, the first two of
/// them. A corner named twice counts once, so that collapsed cells match others. The mesh must pass
/// check_mesh. Parallel, the same for any number of threads; O(F log F) time and 16 F bytes beside
/// the result for F cell faces. Throws InvalidInputError when a polyhedron has more than a million
/// faces, or the mesh 2^31 cells.
CellNeighbours find_cell_neighbours(const Mesh& mesh);

}  // namespace cadmorph
