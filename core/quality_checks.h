#pragma once

#include "core/quality.h"

namespace cadmorph {

/// Finite-volume measures of a mesh as OpenFOAM's checkMesh states them (primitiveMeshCheck).
struct QualityChecks {
  double max_non_orthogonality_deg = 0;  ///< angle of face normal and the line of cell centres
  double mean_non_orthogonality_deg = 0;
  Index severely_non_orthogonal = 0;  ///< faces above 70 degrees
  double max_skewness = 0;            ///< off-centre of that line at the face, in face sizes
  Index highly_skew = 0;              ///< faces above 4
  double max_aspect_ratio = 0;        ///< 1 for a cube
  Index high_aspect = 0;              ///< cells above 1000
  double min_volume = 0;              ///< in the mesh's unit, cubed
  Index worst_non_orthogonal_cell = -1, worst_skew_cell = -1, worst_aspect_cell = -1;
};

/// The faces of all solid cells, each once. Depends on the connectivity alone.
struct CellFaces {
  std::vector<Index> owner;         ///< cell the normal points out of
  std::vector<Index> neighbour;     ///< the other cell, -1 on the outside
  std::vector<Index> offsets;       ///< faces + 1
  std::vector<Index> connectivity;  ///< corner nodes
  Index face_count() const { return static_cast<Index>(owner.size()); }
  std::span<const Index> face(Index f) const {
    return {connectivity.data() + offsets[f],
            static_cast<std::size_t>(offsets[f + 1] - offsets[f])};
  }
};

/// Pairs the faces of the solid cells by their corner nodes; normals point out of the owner also
/// where the mesh uses the mirrored node order. O(F log F) for F cell faces.
CellFaces find_cell_faces(const Mesh& mesh, const Orientation& orientation);

/// Measures all solid cells by their corner nodes at positions `points` (N x 3). Cells are
/// polyhedra with faces split around their centre, as in OpenFOAM. Node orders mirrored against
/// VTK's give the same figures. All zero for a mesh without solid cells.
QualityChecks check_quality(const Mesh& mesh, const Points& points, const CellFaces& faces);

}  // namespace cadmorph
