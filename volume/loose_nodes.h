#pragma once

#include "core/boundary.h"
#include "core/mesh.h"

namespace cadmorph {

/// Moves the nodes that neither a solid nor a shell cell uses and that lie outside of the solids,
/// such as the reference node of a coupling in a hole, as what lies nearest to them moves: by the
/// affine map, rigid (Kabsch 1976) in directions in which they have no extent, that fits the
/// surface's nodes nearest to one, weighted by (nearest distance / distance)^32, so that a node
/// amid a hole's rim stays there; farther off than these reach it is a translation more and more. A
/// field that is known about the mesh alone overshoots there. Where nothing near moves, they stay.
/// A node that the mesh ties to others (Mesh::ties) takes the rigid motion of least squares of all
/// that it is tied to, one after another where that is loose, too; where it is one node, or a line,
/// that of the smallest rotation. The loose ones among the others go along where the rest of the
/// tie moves without them. Ties in a ring of loose nodes move nothing. Nodes between the ends of
/// lines of beams keep their places between these and the surface's nodes (the field's correction
/// solves the Laplace equation along the lines). Where the motion of the surface is an affine map,
/// that is theirs. `surface`: where the CAD puts the boundary's nodes, a row each, before any slid:
/// a rim whose nodes slide turns nothing. `positions`: N x 3, of the moved mesh, in which other
/// nodes stay.
void carry_loose_nodes(const Mesh& mesh, const Boundary& boundary, const Points& surface,
                       Points& positions);

}  // namespace cadmorph
