#pragma once

#include <filesystem>

#include "core/mesh.h"

namespace cadmorph::models {

/// How to mesh with gmsh; lengths in millimetres.
struct TetOptions {
  double size;                ///< edge length away from curvature
  double minimum_size = 0;    ///< shortest edge length asked for
  int elements_per_turn = 0;  ///< edges around a full circle of any curved face; 0: `size` alone
  int order = 1;              ///< 2 for quadratic tetrahedra
  double far_field_width =
      0;  ///< if positive, mesh the cube of this width around the shape instead
};

/// Sets gmsh's options for sizes and order; gmsh must be initialised.
void set_tet_options(const TetOptions& options);

/// Meshes the solids of a STEP file with tetrahedra; boundary nodes are on its faces, edges and
/// vertices. Solids that touch share nodes; when there are several, each is a region, from 1 on.
/// The same file always gives the same mesh. Throws InvalidInputError when gmsh can't mesh it.
Mesh mesh_with_tets(const std::filesystem::path& step, const TetOptions& options);

}  // namespace cadmorph::models
