#pragma once

#include "core/cell_faces.h"
#include "core/quality.h"

namespace cadmorph {

/// What the exact validity test found.
struct ValidityReport {
  Index cells = 0;      ///< solid cells tested
  Index invalid = 0;    ///< cells whose Jacobian determinant is not positive everywhere
  Index undecided = 0;  ///< of these: touching zero so closely that no sign could be proved
  std::vector<Index> invalid_cells;  ///< ids, ascending

  template <class Archive>
  void serialize(Archive& archive) {
    archive(cells, invalid, undecided, invalid_cells);
  }
};

/// Tests whether the map of each solid cell is valid at node positions `points` (N x 3): its
/// Jacobian determinant, times the orientation of its type, is positive in the whole cell. Positive
/// corners, as counted by measure_quality, do not suffice for hexahedra and quadratic cells.
/// Tetrahedra: by the exact sign of the volume. Cells with a polynomial map: the Bernstein
/// coefficients bound the determinant; the cell is cut in parts until all are positive or a value
/// is not (Johnen, Remacle, Geuzaine 2013). Polyhedra: each face's pyramid over the mean of the
/// nodes, or over the centroid of the volume, has positive volume. Straight-edged cells of a mesh
/// for finite volumes (Mesh::is_of_finite_volumes): by finite_volume::is_sound alone. A cell that
/// names a node twice (a hexahedron collapsed to a wedge) may vanish where it collapses. Shell,
/// line and vertex cells are not tested. Throws InvalidInputError when sizes differ or a position
/// is not finite. Parallel; O(cells).
ValidityReport check_validity(const Mesh& mesh, const Points& points,
                              const Orientation& orientation);

/// The same of some cells alone (ids, ascending).
ValidityReport check_validity(const Mesh& mesh, const Points& points,
                              const Orientation& orientation, const std::vector<Index>& cells);

/// Of `invalid_cells` (ids, ascending) of solids: those whose nodes are named in another order than
/// the cells around expect, as when two nodes are swapped. Such a cell goes round a face it shares
/// with a cell that is not invalid the same way as that does, or holds the corners of such a cell's
/// open face without having that face; a cell that nodes in wrong places invert does neither.
/// `neighbours`: find_cell_neighbours of the mesh.
std::vector<Index> misordered_cells(const Mesh& mesh, const CellNeighbours& neighbours,
                                    const Orientation& orientation,
                                    const std::vector<Index>& invalid_cells);

}  // namespace cadmorph
