#pragma once

#include "core/mesh.h"

namespace cadmorph {

/// The surface of a mesh: the facets that bound solid cells, and those between two regions.
struct Boundary {
  std::vector<CellType> types;      ///< one a facet
  std::vector<Index> offsets;       ///< facets + 1
  std::vector<Index> connectivity;  ///< mesh node ids, corners first
  std::vector<Index> cell;          ///< owner cell of each facet (the one its normal points out of)
  std::vector<Index> neighbour;     ///< cell on the other side of an interface, -1 on the outside
  std::vector<Index> nodes;         ///< ids of all mesh nodes on the surface, ascending

  Index facet_count() const { return static_cast<Index>(types.size()); }
  std::span<const Index> facet(Index f) const {
    return {connectivity.data() + offsets[f], static_cast<std::size_t>(offsets[f + 1] - offsets[f])};
  }
};

/// Extracts the facets used by one solid cell only and those between cells of different regions
/// (once each). Shell cells on top of solids (boundary patches stored as cells) add nothing; in a
/// mesh without solid cells the shell cells are the surface. Nodes in `Boundary::nodes` that no
/// facet uses do not occur. Sorting-based and parallel: O(F log F) for F cell faces.
/// Throws InvalidInputError when the mesh has neither solid nor shell cells.
Boundary extract_boundary(const Mesh& mesh);

}  // namespace cadmorph
