#pragma once

#include "core/sliding_nodes.h"
#include "surface/surface_morph.h"

namespace cadmorph {

/// The surface nodes that may slide on the variant: those on edges along them, those within faces
/// on these; what each keeps of an offset from the CAD goes with it, turned no further. Left out,
/// for what belongs to them would not follow: nodes on facets that are not on the CAD (symmetry
/// planes that cut it, interfaces) or have nodes amid straight edges, nodes at a place with others
/// (both sides of a slit), where entities cross without an imprint, on sides named as periodic, and
/// poles; where `on_edges_alone` is set, also those within faces. `moved` is what
/// SurfaceMorph::morph made of the nodes of `boundary`.
SlidingNodes slide_on_cad(const CadModel& variant, const Association& association,
                          const Boundary& boundary, const SurfaceMorphResult& moved,
                          bool on_edges_alone = false);

/// Number of facets that look clearly (by over 120 degrees) to another side of their CAD face than
/// most do, at `positions` (a row for each mesh node) with the nodes at `slides`: cells there are
/// valid, but lie over each other. Judged at nodes that slide within the face; facets without one
/// are not counted.
Index count_turned_facets(const Mesh& mesh, const Association& association,
                          const Boundary& boundary, const SlidingNodes& sliding,
                          const Points& positions, const RowMatrix& slides);

}  // namespace cadmorph
