#pragma once

#include "core/cell_faces.h"
#include "core/mesh.h"

namespace cadmorph {

/// The surface of a mesh: the facets that bound solid cells, those between two regions or on a part
/// inside that was asked for, and shell cells beside or within solids.
struct Boundary {
  std::vector<CellType> types;      ///< one a facet
  std::vector<Index> offsets;       ///< facets + 1
  std::vector<Index> connectivity;  ///< mesh node ids, corners first
  std::vector<Index> cell;          ///< owner cell of each facet (the one its normal points out of)
  /// Cell on the other side of an interface, -1 on the outside; of a shell beside solids itself.
  std::vector<Index> neighbour;
  std::vector<Index> nodes;  ///< ids of the mesh nodes that a facet uses, ascending

  template <class Archive>
  void serialize(Archive& archive) {
    archive(types, offsets, connectivity, cell, neighbour, nodes);
  }

  Index facet_count() const { return static_cast<Index>(types.size()); }
  std::span<const Index> facet(Index f) const {
    return {connectivity.data() + offsets[f],
            static_cast<std::size_t>(offsets[f + 1] - offsets[f])};
  }
};

/// Extracts the facets used by one solid cell only and those between cells of different regions
/// (once each, owned by the cell of the lower region id), in the order of their cells. Normals
/// point out of the owner also where the mesh uses the mirrored node order (see
/// detect_orientation). Faces match by their corners; those of collapsed cells that have no area
/// are left out. Shell cells on the outside of solids (boundary patches stored as cells) add
/// nothing; the faces inside that one lies on are taken as those between regions are; those that
/// are no face of solids, sheets, come last, as they are. In a mesh without solid cells the shell
/// cells are the surface. The mesh must pass check_mesh. Throws InvalidInputError when the mesh has
/// neither solid nor shell cells, or when more than two cells share a face. Parallel; O(F log F)
/// time and 16 F bytes for F cell faces.
Boundary extract_boundary(const Mesh& mesh);

/// A face between two cells: one of them, and its number as cell_facets has it.
struct InnerFace {
  Index cell, local;
  auto operator<=>(const InnerFace&) const = default;
};

/// The same where the neighbours of the mesh's cells are there already: O(F). `parts`, if not
/// empty, marks nodes of parts inside of the mesh: the faces whose corners are all marked are taken
/// as those between regions are, owned by the cell that comes first, and so are those of `inner`.
Boundary extract_boundary(const Mesh& mesh, const CellNeighbours& neighbours,
                          const std::vector<char>& parts = {},
                          const std::vector<InnerFace>& inner = {});

/// The same with straight facets at the corners of those of second order; `nodes` stay.
Boundary corners_alone(const Boundary& boundary);

/// Facets at each node of a mesh.
struct Incidence {
  std::vector<Index> offsets;  ///< nodes + 1 positions in `facets`
  std::vector<Index> facets;   ///< facet numbers, ascending at each node

  std::span<const Index> at(Index node) const {
    return {facets.data() + offsets[node],
            static_cast<std::size_t>(offsets[node + 1] - offsets[node])};
  }
};

/// Returns the facets of `boundary` that use each of the mesh's `node_count` nodes.
Incidence node_facets(const Boundary& boundary, Index node_count);

}  // namespace cadmorph
