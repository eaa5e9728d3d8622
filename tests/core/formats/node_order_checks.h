#pragma once

#include "core/mesh.h"

namespace cadmorph::test {

/// Requires that each node of a straight second-order cell beyond its corners lies in the middle of
/// the edge, face or cell where VTK's node order has it.
void require_middles(const Mesh& mesh, Index cell);

/// The unit cube as one straight hexahedron of second order, or half of it as a wedge: the places
/// of its nodes in VTK's order.
Points unit_cell(CellType type);

}  // namespace cadmorph::test
