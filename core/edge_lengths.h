#pragma once

#include "core/mesh.h"

namespace cadmorph {

/// Lengths of the shortest and the longest mesh edge at each node, in the mesh's unit; 0 at a node
/// that no edge uses or whose edges have no length.
struct IncidentEdges {
  Eigen::VectorXd shortest, longest;
};

/// Edges of quadratic cells count in halves, corner to mid-side node. The centre node of a face has
/// the lines to the face's mid-side nodes, that of a cell those to the centres of its faces. The
/// mesh must pass check_mesh. O(cells), on all threads.
IncidentEdges incident_edges(const Mesh& mesh);
/// The same of the mesh with its nodes at `points`, as many.
IncidentEdges incident_edges(const Mesh& mesh, const Points& points);

}  // namespace cadmorph
