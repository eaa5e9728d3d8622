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

}  // namespace cadmorph::testing
