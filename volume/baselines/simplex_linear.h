#pragma once

#include "volume/baselines/baseline.h"

namespace cadmorph {

/// Simplex-linear (Staten et al. 2011): a free node keeps its barycentric coordinates in that
/// tetrahedron of the surface nodes' Delaunay tetrahedralisation which holds it, and so follows the
/// surface nodes as the corners of that tetrahedron do. Takes any mesh; nodes outside the surface
/// nodes' convex hull take the coordinates of the nearest tetrahedron found, which may be negative.
/// Throws SolverError when all surface nodes lie in a plane, and when cadmorph was built without
/// CGAL (-DCADMORPH_WITH_CGAL=ON).
std::unique_ptr<Baseline> make_simplex_linear(const Mesh& mesh,
                                              const std::vector<Index>& surface_nodes);

/// Whether cadmorph was built with CGAL.
bool has_simplex_linear();

}  // namespace cadmorph
