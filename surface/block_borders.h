#pragma once

#include <vector>

#include "core/boundary.h"
#include "core/mesh.h"
#include "surface/association.h"

namespace cadmorph {

/// What a mesh is without the borders of blocks (Mesh::zone_of_block) that only its mesher needed.
struct JoinedBlocks {
  std::vector<int> regions;  ///< one a cell; empty: no blocks are joined
  Boundary boundary;         ///< without the facets between blocks that are joined
};

/// Joins blocks of a zone where most of the facets between them (of shells and plane meshes: of the
/// edges) are on no face (edge) of the CAD: nodes there are inner nodes of the zone. O(facets).
JoinedBlocks join_blocks(const Mesh& mesh, const Boundary& boundary,
                         const Association& association);

}  // namespace cadmorph
