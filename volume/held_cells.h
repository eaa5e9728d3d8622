#pragma once

#include "core/mesh.h"

namespace cadmorph {

/// Whether cell `c`, inverted at `positions` (N x 3), stays so however the free nodes move: all its
/// nodes are fixed, or, unless it is a polyhedron, all those of a plane quadrilateral facet with a
/// corner that turns inwards or has no area (the Jacobian determinant changes its sign on such a
/// facet, whatever lies above it; polyhedra have none). `is_fixed` marks nodes (N). Sufficient to
/// be beyond repair, not necessary.
bool is_held(const Mesh& mesh, const Points& positions, const std::vector<char>& is_fixed, Index c);

}  // namespace cadmorph
