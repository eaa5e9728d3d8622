#pragma once

#include "core/formats/mesh_format.h"

namespace cadmorph {

// One source each, named as the function.
const MeshFormat& cgns_format();
const MeshFormat& exodus_format();
const MeshFormat& med_format();
const MeshFormat& su2_format();
const MeshFormat& vtk_format();
const MeshFormat& vtkhdf_format();
const MeshFormat& xdmf_format();

}  // namespace cadmorph
