#pragma once

#include <TopoDS_Shape.hxx>

#include "core/mesh.h"

namespace cadmorph::models {

/// Makes the pipe model: a hollow pipe, straight, bent, and straight again. As `change` goes from 0
/// to 1 both straight parts, both radii, the radius of the bend and its angle change.
TopoDS_Shape make_pipe(double change);

/// Meshes make_pipe(change) with structured hexahedra, exactly on the CAD; equal node and cell
/// numbers for every `change`.
Mesh make_pipe_hex(double change = 0);

}  // namespace cadmorph::models
