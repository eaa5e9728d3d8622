#pragma once

#include "core/mesh.h"

namespace cadmorph {

/// Returns the scaled Jacobian of cell `c` at node positions `points` (N x 3), in [-1, 1]: 1 for
/// the ideal cell, not positive for an inverted one, 0 for one with coinciding nodes. Tetrahedra,
/// hexahedra, triangles and quads: as Verdict defines it (Knupp et al. 2006; Sieger et al. 2013,
/// sect. 5). Other cells: as docs/quality.md defines it. Vertex and line cells: 1. Solid cells in
/// the node order opposite to VTK's are negative.
double scaled_jacobian(const Mesh& mesh, const Points& points, Index c);

/// What measure_quality found.
struct QualityReport {
  Index cells = 0;             ///< solid cells measured (shell cells when there is no solid one)
  double min = 0;              ///< smallest scaled Jacobian
  double mean = 0;             ///< mean scaled Jacobian
  Index worst_cell = -1;       ///< cell of `min`
  Index inverted = 0;          ///< cells with a corner Jacobian that is not positive
  std::vector<double> values;  ///< scaled Jacobian of every cell of the mesh (NaN: not measured)
  std::vector<Index> inverted_cells;  ///< ids, ascending

  template <class Archive>
  void serialize(Archive& archive) {
    archive(cells, min, mean, worst_cell, inverted, values, inverted_cells);
  }
};

/// Orientation of each cell type in a mesh: +1 when VTK's node order gives positive volumes for
/// most cells of the type, -1 when the mesh uses the mirrored order (some tools write wedges so).
/// Indexed by the CellType's number. To be taken once from the base mesh and used for all its
/// morphs. Of a mesh of more than a hundred thousand cells some, spread evenly, decide.
using Orientation = std::vector<int>;
Orientation detect_orientation(const Mesh& mesh);

/// Throws InvalidInputError when `points` are not as many as the mesh's nodes or not all finite.
void check_positions(const Mesh& mesh, const Points& points);

/// Measures all cells of highest dimension at node positions `points` (N x 3). A cell counts as
/// inverted when any sampled Jacobian determinant, times the orientation of its type, is not
/// positive: at the corners, in quadratic cells at all nodes and the centre (docs/quality.md), but
/// not where finite volumes take it for sound (finite_volume::is_sound).
/// Shell cells have no sign in 3D: they are inverted only when degenerate or self-folded, in a
/// plane mesh also when turned over (turned_cells). Throws InvalidInputError when sizes differ or a
/// position is not finite. Parallel; O(cells).
QualityReport measure_quality(const Mesh& mesh, const Points& points,
                              const Orientation& orientation);

/// The report of measure_quality where only `cells` (ids, ascending) are other than `before`.
QualityReport measure_again(QualityReport before, const Mesh& mesh, const Points& points,
                            const Orientation& orientation, const std::vector<Index>& cells);

}  // namespace cadmorph
