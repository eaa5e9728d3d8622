#pragma once

#include "volume/baselines/baseline.h"

namespace cadmorph {

/// Log-barrier weights of a node over its neighbours: the w_j > 0 with sum w_j = 1 and
/// sum w_j x_j = x that maximise sum log w_j (Shontz, Vavasis 2003). `offsets` (k x 3): neighbours
/// minus the node, x_j - x. With the multiplier y of the second constraint
/// w_j = 1 / (k + y . (x_j - x)); y by damped Newton steps on the convex dual. Throws SolverError
/// when the node does not lie strictly inside the convex hull of its neighbours, where there are no
/// such weights.
Eigen::VectorXd log_barrier_weights(const Points& offsets);

/// LBWARP (Shontz, Vavasis 2003): each free node keeps its log-barrier weights over the nodes that
/// a mesh edge joins it to; where it is not inside their hull, over all the nodes of its cells.
/// Takes any mesh of linear cells and polyhedra.
std::unique_ptr<Baseline> make_lbwarp(const Mesh& mesh, const std::vector<Index>& surface_nodes);

}  // namespace cadmorph
