#pragma once

#include <vector>

#include "core/mesh.h"

namespace cadmorph {

/// Sorts cells (ids) by where their first nodes lie, along a Z-order curve (Morton 1966), so that
/// cells near in space are near in memory. Parallel; O(cells).
void sort_in_space(const Mesh& mesh, const Points& positions, std::vector<Index>& cells);

}  // namespace cadmorph
