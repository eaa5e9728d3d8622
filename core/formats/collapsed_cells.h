#pragma once

#include <vector>

#include "core/mesh.h"

namespace cadmorph {

/// A cell that decks write as a hexahedron or quadrilateral with equal corners: as the tetrahedron,
/// pyramid, wedge or triangle that it is. `nodes` (20 or 8 for hexahedra, 8 or 4 for
/// quadrilaterals, in VTK's order) become those of the type returned. Wedges have the normal of
/// their first triangle towards the second. What collapses otherwise stays as it is.
CellType reduce_collapsed(CellType type, std::vector<Index>& nodes);

}  // namespace cadmorph
