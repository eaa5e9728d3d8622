#pragma once

#include <span>
#include <vector>

#include "core/cell_faces.h"
#include "core/mesh.h"

namespace cadmorph {

/// Nodes through a wall, from one side to the other.
using NodeRow = std::vector<Index>;

/// The rows of corner nodes through hexahedra and wedges, from a face of the surface to the one
/// opposite it, over 2 to 16 cells: straight ones at `points` (N x 3) that are at most half as long
/// as other rows through the same nodes. No inner node of theirs is one of the `swept` rows.
/// Each row once; the order depends on the mesh alone. O(cells).
std::vector<NodeRow> find_wall_rows(const Mesh& mesh, const CellNeighbours& neighbours,
                                    const Points& points, std::span<const NodeRow> swept = {});

/// A node of a sheet of the surface that has images: in all sheets of a family the same place.
struct SheetNode {
  Index node, family, place;
};

/// The same rows of a swept mesh, over any number of cells and however long: those between images,
/// of the families all of whose places have such rows. Where rows of several cross, those of the
/// family with the most nodes.
std::vector<NodeRow> find_swept_rows(const Mesh& mesh, const CellNeighbours& neighbours,
                                     const Points& points, std::vector<SheetNode> sheets);

/// Where the nodes between a row's ends would be at `after` (N x 3), had the row stayed as straight
/// as it was `before`, and its nodes at the same parts of its length: a row each.
Points straight_places(const NodeRow& row, const Points& before, const Points& after);

/// Whether its cells have about the same height: those of layers grow by 1.1 or more.
bool is_even(const NodeRow& row, const Points& points);

/// Largest distance of the row's nodes from those places, in parts of the row's length.
double deviation(const NodeRow& row, const Points& before, const Points& after);

}  // namespace cadmorph
