#pragma once

#include "core/formats/mesh_format.h"

namespace cadmorph {

// One source each, named as the function.
const MeshFormat& gmsh_format();
const MeshFormat& medit_format();
const MeshFormat& mfem_format();
const MeshFormat& netgen_format();
const MeshFormat& su2_format();
const MeshFormat& ugrid_format();
const MeshFormat& vtk_format();

}  // namespace cadmorph
