#pragma once

#include "core/cell_faces.h"
#include "core/quality.h"

namespace cadmorph {

/// Finite-volume measures of a mesh as OpenFOAM's checkMesh states them (primitiveMeshCheck).
struct QualityChecks {
  /// Angle of the face normal out of one cell and the line from its centre to the neighbour's:
  /// above 90 degrees where that lies behind the face.
  double max_non_orthogonality_deg = 0;
  double mean_non_orthogonality_deg = 0;  ///< angle of the mean cosine
  Index severely_non_orthogonal = 0;      ///< faces above 70 degrees
  double max_skewness = 0;                ///< off-centre of that line at the face, in face sizes
  Index highly_skew = 0;                  ///< faces above 4
  double max_aspect_ratio = 0;            ///< 1 for a cube
  Index high_aspect = 0;                  ///< cells above 1000
  double min_volume = 0;                  ///< in the mesh's unit, cubed; a plane cell's area
  Index worst_non_orthogonal_cell = -1, worst_skew_cell = -1, worst_aspect_cell = -1;

  bool has_cells() const { return worst_aspect_cell >= 0; }

  template <class Archive>
  void serialize(Archive& archive) {
    archive(max_non_orthogonality_deg, mean_non_orthogonality_deg, severely_non_orthogonal,
            max_skewness, highly_skew, max_aspect_ratio, high_aspect, min_volume,
            worst_non_orthogonal_cell, worst_skew_cell, worst_aspect_cell);
  }
};

/// Measures all solid cells by their corner nodes at positions `points` (N x 3). Cells are
/// polyhedra with faces split around their centre, as in OpenFOAM; faces without area do not count.
/// A plane mesh (flat_axis) is measured as one_layer, its aspect ratio in the plane. Nothing is
/// measured of other meshes without solid cells. Throws InvalidInputError when sizes differ or a
/// position is not finite. Parallel; O(F).
QualityChecks check_quality(const Mesh& mesh, const Points& points,
                            const CellNeighbours& neighbours, const Orientation& orientation);

}  // namespace cadmorph
