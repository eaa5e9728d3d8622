#pragma once

#include <functional>
#include <vector>

#include "core/mesh.h"

namespace cadmorph::testing {

/// Nodes on the sides of the unit cube's mesh (see cube()), ascending.
std::vector<Index> cube_surface(const Mesh& mesh);

/// Rows of `points`.
Points rows_of(const Points& points, const std::vector<Index>& rows);

/// Each point mapped.
Points mapped(const Points& points,
              const std::function<Eigen::Vector3d(const Eigen::Vector3d&)>& map);

/// The unit cube in n^3 pairs of wedges, in layers that thin out towards the floor to `first`.
Mesh graded_layers(int n, double first);

/// A body and what is round it.
struct FarField {
  Mesh mesh;
  std::vector<Index> body, surface;  ///< the far boundary's nodes follow the body's
};

/// Hexahedra between a sphere of radius 1 and one of radius `far`, in layers as high as the cells
/// are wide; n^2 of them on each of six sides.
FarField far_field(int n, double far);

/// Quads between a circle of radius 1 and one of radius `far` in the plane z = 0.
FarField flat_far_field(int n, double far);

using Motion = std::function<Eigen::Vector3d(const Eigen::Vector3d&)>;

/// Where the surface's nodes go when the body moves.
Points targets(const FarField& field, const Motion& motion);

/// Bends the cube's floor into waves; everything above follows less and less.
Eigen::Vector3d wave(const Eigen::Vector3d& x);

}  // namespace cadmorph::testing
