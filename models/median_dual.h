#pragma once

#include <functional>
#include <span>

#include "core/mesh.h"

namespace cadmorph::models {

/// Where the dual shall have its node of a boundary edge (2 nodes), boundary triangle (3) or
/// tetrahedron (4), given the mean of their nodes.
using PlaceDualNode =
    std::function<Eigen::Vector3d(std::span<const Index> nodes, const Eigen::Vector3d& mean)>;

/// Returns the median dual of a tetrahedral mesh: a polyhedron about each of its nodes. The dual's
/// nodes are the middles of the tetrahedra, boundary triangles and boundary edges, and the boundary
/// nodes; a face stands on each edge, and a quadrangle in each corner of a boundary triangle.
Mesh median_dual(const Mesh& tets, const PlaceDualNode& place);

}  // namespace cadmorph::models
