#pragma once

#include <vector>

#include "core/mesh.h"
#include "core/quality.h"

namespace cadmorph {

/// Moves nodes of `unsound` cells (ids, ascending) of a mesh for finite volumes (N nodes), one
/// after the other, to where the least sound of the cells at the node is as sound as can be
/// (finite_volume::soundness; Freitag and Ollivier-Gooch 1997), or as they are in `mesh`. Unlike
/// the smooth distortion of untangle, this asks for nothing but what such solvers do. Nodes with
/// `is_fixed` true (N) stay. Returns the positions (N x 3), `positions` themselves where it does
/// not leave fewer such cells. O(cells), then O(unsound).
Points mend_volumes(const Mesh& mesh, const Points& positions, const std::vector<char>& is_fixed,
                    const Orientation& orientation, const std::vector<Index>& unsound);

}  // namespace cadmorph
