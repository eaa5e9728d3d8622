#pragma once

#include <TopoDS_Shape.hxx>

#include "core/mesh.h"

namespace cadmorph::models {

/// Makes the courier model: a pan with a flange, ribs around a hub, four bosses, holes, and fillets
/// along all bends. As `change` goes from 0 to 1 its 29 parameters change at once.
TopoDS_Shape make_courier(double change);

/// Meshes make_courier(0) with unstructured hexahedra: quadrangles of floor and flange swept
/// through their thickness, joined by swept bends. Boundary nodes are exactly on the CAD.
Mesh make_courier_hex();

}  // namespace cadmorph::models
