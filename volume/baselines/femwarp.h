#pragma once

#include "volume/baselines/baseline.h"

namespace cadmorph {

/// Stiffness matrix of one cell for the Laplace equation, K_ij = integral of grad N_i . grad N_j
/// over the cell, for node positions `nodes` (rows, VTK order): linear tetrahedron exactly,
/// trilinear hexahedron and voxel, wedge and pyramid (as collapsed hexahedra) by 2 x 2 x 2 Gauss
/// points, with which the rows annihilate linear functions exactly. Throws InvalidInputError for
/// another type.
Eigen::MatrixXd laplace_stiffness(CellType type, const RowMatrix& nodes);

/// FEMWARP (Baker 2002; for hexahedra Staten et al. 2011): nodes inside follow the finite-element
/// solution of the Laplace equation on the base mesh, A_II u_I = -A_IB u_B. Tetrahedra, hexahedra,
/// voxels, wedges and pyramids, mixed at will.
std::unique_ptr<Baseline> make_femwarp(const Mesh& mesh, const std::vector<Index>& surface_nodes);

}  // namespace cadmorph
