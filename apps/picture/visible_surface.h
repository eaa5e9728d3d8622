#pragma once

#include <Eigen/Geometry>
#include <vector>

#include "core/quality_checks.h"

namespace cadmorph {

/// A mesh, or a part of it, seen from outside.
struct VisibleSurface {
  Mesh mesh;                 ///< shell cells; no regions
  std::vector<Index> nodes;  ///< ids, ascending, in the mesh it was taken from, of its nodes
  std::vector<Index> cells;  ///< id of the cell each shell cell belongs to
};

/// Returns the faces of the shown solid cells (`is_shown`, one a cell) that no other shown cell
/// covers; in a mesh without solid cells, the shown shell cells. O(cells).
VisibleSurface visible_surface(const Mesh& mesh, const CellNeighbours& neighbours,
                               const std::vector<char>& is_shown);

/// The facets whose centre lies in a box.
VisibleSurface facets_in_box(const VisibleSurface& whole, const Eigen::AlignedBox3d& box);

/// 1 for each cell of `mesh` that reaches above the middle of a box (of the mesh's own, for one)
/// along `axis`: what a cut there leaves, whole cells, so that a wall of one cell in the middle is
/// not cut to pieces.
std::vector<char> cells_above_middle(const Mesh& mesh, const Eigen::AlignedBox3d& box, int axis);

/// The bounding box of all nodes.
Eigen::AlignedBox3d box_of(const Mesh& mesh);

/// 1 for each cell whose centre lies in a box.
std::vector<char> cells_in_box(const Mesh& mesh, const Eigen::AlignedBox3d& box);

}  // namespace cadmorph
