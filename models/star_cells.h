#pragma once

#include "core/mesh.h"

namespace cadmorph::models {

/// Joins tetrahedra to polyhedra: all that share an inner node become one cell, and the node goes,
/// where no other such cell has taken any of them and every face is seen from the mean of the
/// remaining nodes. Other cells stay, in their order; the polyhedra follow. All faces are
/// triangles.
Mesh join_stars(const Mesh& mesh);

}  // namespace cadmorph::models
