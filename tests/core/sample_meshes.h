#pragma once

#include <vector>

#include "core/mesh.h"

namespace cadmorph::testing {

/// All solid cell types, and the same without the polyhedron.
const std::vector<CellType>& solid_types();
const std::vector<CellType>& solid_types_without_polyhedron();

/// The unit cube in n x n x n blocks, each one hexahedron or voxel, 2 wedges, 6 tetrahedra, 6
/// pyramids, or one polyhedron, or their quadratic forms with straight edges. VTK's node order,
/// positive volumes. Mid nodes lie where VTK's own parametric coordinates put them.
Mesh cube(CellType type, int n);

/// The unit cube of tetrahedra, 6 blocks a side, whose halves x < 1/2 and x > 1/2 are two regions.
Mesh two_halves();

/// One cell with the given node positions (rows), numbered in order.
Mesh single_cell(CellType type, const RowMatrix& positions);

/// One cell of a type at VTK's own parametric coordinates.
Mesh parametric_cell(CellType type);

/// VTK's own shape function derivatives: rows d/dr, d/ds, d/dt by nodes, at each node of the cell.
std::vector<RowMatrix> vtk_derivatives_at_nodes(CellType type);

/// VTK's own faces of a cell type as local node lists (VTK's order).
std::vector<std::vector<Index>> vtk_faces(CellType type);

/// VTK's own edges of a cell type as local node lists: two ends, then the mid node, if any.
std::vector<std::vector<Index>> vtk_edges(CellType type);

/// A mesh whose nodes have moved by up to `amount` in each direction (uniform, fixed seed).
Points shaken(const Points& points, double amount, unsigned seed);

/// Sets the region of each cell to 1, or to 0 where its centre has x < `limit`.
void set_regions_by_x(Mesh& mesh, double limit);

}  // namespace cadmorph::testing
