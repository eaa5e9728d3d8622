#pragma once

#include "core/mesh.h"

namespace cadmorph {

/// Length of the shortest mesh edge at each node, in the mesh's unit; 0 at a node that no edge uses
/// or whose shortest edge has no length. Edges of quadratic cells count in halves, corner to
/// mid-side node. O(cells).
Eigen::VectorXd shortest_incident_edges(const Mesh& mesh);

/// The same for the longest edge.
Eigen::VectorXd longest_incident_edges(const Mesh& mesh);

}  // namespace cadmorph
