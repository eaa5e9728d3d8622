#pragma once

#include "core/id.h"

namespace cadmorph {

using RowId = Id<struct SurfaceRow>;      ///< of Boundary::nodes, of a SurfaceMesh
using FacetId = Id<struct SurfaceFacet>;  ///< of a Boundary, of a SurfaceMesh

}  // namespace cadmorph
