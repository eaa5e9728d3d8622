#pragma once

#include "cad/brep.h"
#include "surface/association.h"
#include "surface/surface_mesh.h"

namespace cadmorph {

/// Whether a node lies in the middle of a straight edge or facet of a quadratic cell.
bool is_amid_straight(const SurfaceMesh& surface, RowId node);

/// Marks the nodes of straight-sided quadratic cells that lie off the CAD in the middle of an edge
/// or facet whose corners are on it (Association::is_amid): they share the motion of these, however
/// far a coarse cell cuts off a curve. They belong to no CAD entity then. `is_off_voted`: for each
/// node, whether it lies off one of the faces of its facets.
void find_straight_nodes(const CadModel& model, const SurfaceMesh& surface,
                         const IdVector<RowId, char>& is_off_voted, Association& association);

}  // namespace cadmorph
