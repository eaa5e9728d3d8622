#pragma once

#include <TopoDS_Shape.hxx>

#include "core/mesh.h"

namespace cadmorph::models {

/// Makes the canister model: a thin-walled vessel with elliptic domes and a nozzle on the upper
/// one. As `change` goes from 0 to 1 its radii, lengths, dome heights and wall thicknesses change.
TopoDS_Shape make_canister(double change);

/// Meshes make_canister(0) with structured hexahedra, three through the wall, boundary nodes on the
/// CAD; a square core closes the lower dome.
Mesh make_canister_hex();

}  // namespace cadmorph::models
