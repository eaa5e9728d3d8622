#pragma once

#include <vector>

#include "cad/brep.h"
#include "core/boundary.h"
#include "core/cell_faces.h"
#include "core/mesh.h"
#include "surface/association.h"

namespace cadmorph {

/// Faces of the CAD inside of the mesh that its file tells nothing of: it names no regions.
struct UnnamedInterfaces {
  std::vector<InnerFace> faces;  ///< of cells, that lie on them
  std::vector<FaceId> crossed;   ///< CAD faces that run through the mesh where no face of a cell is
};

/// Looks for faces between two cells of a region on those CAD faces that no facet of `boundary`
/// lies on. One is taken whose corners lie on such a CAD face, by the tolerance of an association,
/// and that looks the same way; a CAD face, where they make up most of its area. Where each has a
/// facet O(facets); else parallel, O((N + F) log) for N nodes and F cell faces.
UnnamedInterfaces find_unnamed_interfaces(const CadModel& base, const Mesh& mesh,
                                          const CellNeighbours& neighbours,
                                          const Boundary& boundary, const Association& association,
                                          double tolerance);

}  // namespace cadmorph
