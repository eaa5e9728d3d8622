#pragma once

#include <TopoDS_Shape.hxx>

#include "core/mesh.h"

namespace cadmorph::models {

/// Makes the bore model: a block with a shoulder, a bolt hole and, next to both, a through-bore
/// with a keyway. As `change` goes from 0 to 1 the bore grows, turns about its own axis and tilts.
TopoDS_Shape make_bore(double change);

/// Meshes make_bore(0) with structured hexahedra: an O-grid around either hole; boundary nodes are
/// exactly on the faces, edges and vertices of the CAD.
Mesh make_bore_hex();

}  // namespace cadmorph::models
