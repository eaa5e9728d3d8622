#pragma once

#include "core/formats/mesh_format.h"

namespace cadmorph {

// One source each, named as the function.
const MeshFormat& abaqus_format();
const MeshFormat& gmsh_format();
const MeshFormat& openfoam_format();
const MeshFormat& su2_format();
const MeshFormat& vtk_format();

}  // namespace cadmorph
