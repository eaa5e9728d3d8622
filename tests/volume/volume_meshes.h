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

/// Bends the cube's floor into waves; everything above follows less and less.
Eigen::Vector3d wave(const Eigen::Vector3d& x);

}  // namespace cadmorph::testing
