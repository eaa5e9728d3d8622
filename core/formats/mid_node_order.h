#pragma once

#include "core/mesh.h"

namespace cadmorph {

/// Puts the nodes amid edges and faces of cells of this type in the order of VTK, where the file
/// has another one: programs differ, and a mesh shows by where its nodes lie (`points`, N x 3), on
/// the mean of all cells, which one it has. Left alone where it shows none.
void order_mid_nodes(Mesh& mesh, const Eigen::Ref<const Points>& points, CellType type);

}  // namespace cadmorph
