#pragma once

#include <array>
#include <filesystem>
#include <vector>

#include "models/tet_mesher.h"

namespace cadmorph::models {

using Point3 = Eigen::Vector3d;

/// Triangles in space.
struct TriangleMesh {
  std::vector<Point3> points;
  std::vector<std::array<int, 3>> triangles;
  std::vector<int> faces;  ///< number of each triangle's CAD face, where there is one
};

/// Meshes the faces of a STEP file, nodes on the CAD. Triangles are `size_at_curves` large at the
/// CAD's curves and grow to `options.size` away from them; normals point out of the solid. Throws
/// InvalidInputError.
TriangleMesh triangulate(const std::filesystem::path& step, const TetOptions& options,
                         double size_at_curves);

/// Edges that belong to one triangle alone, in the direction that this triangle has them.
std::vector<std::array<int, 2>> rim(const TriangleMesh& mesh);

/// A box on the plane y = 0 that body and fluid end at.
struct HalfBox {
  Point3 low, high;  ///< low.y is 0
  double size;       ///< edge length at its corners
};

/// Closes `body`, open along a rim in the plane y = 0, by the six sides of `box`, the one on the
/// plane cut out along the rim. The body's nodes and triangles come first. Throws
/// InvalidInputError.
TriangleMesh enclose(const TriangleMesh& body, const HalfBox& box);

/// Fills a closed surface with tetrahedra. The surface's nodes come first, as they are; no others
/// are put on it. Throws InvalidInputError.
Mesh fill_with_tets(const TriangleMesh& closed);

}  // namespace cadmorph::models
