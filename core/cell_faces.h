#pragma once

#include <functional>

#include "core/mesh.h"

namespace cadmorph {

/// A face of a cell: cell id and number of the face in it (see cell_facets), in one integer that
/// sorts by both.
class CellFace {
 public:
  CellFace() = default;
  CellFace(Index cell, Index local) : id_(cell << kBits | local) {}
  Index cell() const { return id_ >> kBits; }
  Index local() const { return id_ & (kLimit - 1); }
  auto operator<=>(const CellFace&) const = default;

  static constexpr int kBits = 20;
  static constexpr Index kLimit = Index{1} << kBits;

 private:
  Index id_ = 0;
};

/// Calls visit(faces) for each set of faces of solid cells that have the same corners: one face on
/// the outside of the mesh, two inside, more only where cells overlap. A corner named twice counts
/// once, so that collapsed cells match others; faces with fewer than three corners are left out.
/// From all threads at once, the sets in no order. The mesh must pass check_mesh. Throws
/// InvalidInputError when a polyhedron has more than CellFace::kLimit faces. Parallel; O(F log F)
/// time and 16 F bytes for F cell faces.
void for_each_shared_face(const Mesh& mesh,
                          const std::function<void(std::span<const CellFace> faces)>& visit);

}  // namespace cadmorph
