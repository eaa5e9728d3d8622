#pragma once

#include <vector>

#include "core/mesh.h"
#include "core/sliding_nodes.h"

namespace cadmorph {

struct FollowingNodes {
  RowMatrix slides;  ///< a row for each of SlidingNodes::nodes
  Points positions;  ///< N x 3, an estimate of where all nodes then are, in the mesh's unit
};

/// Cells, and those within so many cells of them.
struct Surroundings {
  const std::vector<Index>& cells;
  int reach;
};

/// The slides by which surface nodes follow what moves beside them: where a rib moves along a thin
/// wall, the nodes on the wall's other side go with it.
/// Displacements u from `reference` to `moved` (N x 3, in the mesh's unit) are given at `is_fixed`
/// nodes (N), and found at the others in `around`: those of least sum of |u_i - u_j|^2 / l_ij^2
/// over the pairs of nodes of each cell, l_ij their distance in the reference (a graph's
/// Laplacian). Nodes that slide go along the tangents of their surfaces, unless they would leave
/// these, and are drawn back weakly to where they are: what moves is forgotten beyond `around`.
/// Cost: a sparse solve for what is so near the cells.
FollowingNodes follow_neighbours(const Mesh& mesh, const Points& reference, const Points& moved,
                                 const std::vector<char>& is_fixed, const SlidingNodes& sliding,
                                 const Surroundings& around);

}  // namespace cadmorph
