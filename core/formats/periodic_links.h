#pragma once

#include <utility>
#include <vector>

#include "core/mesh.h"

namespace cadmorph {

/// What a mesh file says of a curve or surface that is the image of another: its nodes, and the
/// other's.
using PeriodicLink = std::vector<std::pair<Index, Index>>;

/// Sets the partner of each group whose corner nodes are those of some of the links, where their
/// images are the corner nodes of one other group.
void set_partners(const std::vector<PeriodicLink>& links, Mesh& mesh);

}  // namespace cadmorph
