#pragma once

#include <vector>

#include "surface/curve_map.h"

namespace cadmorph {

/// Maps all curves of the base, indexed as in its skeleton, to the variant. Closed curves that
/// seams link start where that costs least, summed over them (Start). Parallel.
CurveMaps map_curves(const ModelPair& pair);

/// Where a base vertex goes: to its counterpart; one inside a chain of edges, along the chain.
Eigen::Vector3d map_vertex(const ModelPair& pair, const CurveMaps& maps, VertexId vertex);

}  // namespace cadmorph
