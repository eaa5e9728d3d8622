#pragma once

#include "core/mesh.h"

namespace cadmorph {

/// Scaled Jacobian of cell `c` at node positions `points`, in [-1, 1], 1 for the ideal cell.
/// Tetrahedra, hexahedra, triangles and quads: as Verdict defines it (Knupp et al. 2006; Sieger et
/// al. 2013, sect. 5). Wedge, pyramid, quadratic cells, polyhedra: see the source of each
/// definition in docs/quality.md. Vertex and line cells: 1.
double scaled_jacobian(const Mesh& mesh, const Points& points, Index c);

/// Signs of the corner Jacobian determinants relative to a mesh's own convention.
struct QualityReport {
  Index cells = 0;             ///< solid cells measured (shell cells when there is no solid one)
  double min = 0;              ///< smallest scaled Jacobian
  double mean = 0;             ///< mean scaled Jacobian
  Index worst_cell = -1;       ///< cell of `min`
  Index inverted = 0;          ///< cells with a corner Jacobian that is not positive
  std::vector<double> values;  ///< scaled Jacobian of every cell of the mesh (NaN: not measured)
  std::vector<Index> inverted_cells;  ///< ids, ascending
};

/// Orientation of each cell type in a mesh: +1 when VTK's node order gives positive volumes for
/// most cells of the type, -1 when the mesh uses the mirrored order (some tools write wedges so).
/// Indexed by the CellType's number. To be taken once from the base mesh and used for all its
/// morphs.
using Orientation = std::vector<int>;
Orientation detect_orientation(const Mesh& mesh);

/// Measures all cells of highest dimension at node positions `points` (N x 3). A cell counts as
/// inverted when any corner Jacobian, times the orientation of its type, is <= 0. Shell cells have
/// no sign in 3D: they are inverted only when degenerate or self-folded. Parallel.
QualityReport measure_quality(const Mesh& mesh, const Points& points,
                              const Orientation& orientation);

}  // namespace cadmorph
