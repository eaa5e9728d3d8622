#pragma once

#include "core/formats/mesh_format.h"

namespace cadmorph {

// One source each, named as the function.
const MeshFormat& abaqus_format();
const MeshFormat& ansys_format();
const MeshFormat& cgns_format();
const MeshFormat& exodus_format();
const MeshFormat& fluent_format();
const MeshFormat& fluent_hdf5_format();
const MeshFormat& gmsh_format();
const MeshFormat& ls_dyna_format();
const MeshFormat& med_format();
const MeshFormat& medit_format();
const MeshFormat& mfem_format();
const MeshFormat& nastran_format();
const MeshFormat& netgen_format();
const MeshFormat& openfoam_format();
const MeshFormat& su2_format();
const MeshFormat& ugrid_format();
const MeshFormat& unv_format();
const MeshFormat& vtk_format();
const MeshFormat& vtkhdf_format();
const MeshFormat& xdmf_format();

}  // namespace cadmorph
