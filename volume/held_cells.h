#pragma once

#include "core/quality.h"

namespace cadmorph {

/// Whether cell `c`, inverted at `positions` (N x 3), stays so however the free nodes move. Either
/// all its nodes are fixed; or, unless it is a polyhedron, the fixed ones alone set its Jacobian at
/// one of its samples (jacobian_samples), as along the edge between two facets on the surface, and
/// set it inverted; or all nodes of a plane quadrilateral facet are fixed and one of its corners
/// turns inwards or has no area (the determinant changes its sign on such a facet, whatever lies
/// above it; polyhedra have none). `is_fixed` marks nodes (N). Sufficient to be beyond repair, not
/// necessary.
bool is_held(const Mesh& mesh, const Points& positions, const std::vector<char>& is_fixed,
             const Orientation& orientation, Index c);

}  // namespace cadmorph
