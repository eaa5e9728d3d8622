#pragma once

#include <vector>

#include "core/quality.h"
#include "volume/moving_nodes.h"
#include "volume/node_cells.h"

namespace cadmorph {

/// The cells that lost against the reference, worst first: a twentieth of all, those whose mean is
/// one of the figures. Those of a bin (quality_bin) come together: mirror images in a mesh, which
/// differ by rounding.
std::vector<Index> worst_that_lost(const QualityReport& now, const QualityReport& reference);

/// The nodes of these cells that may move, of the first until more than `most` cells change, and of
/// layers of cells round them.
Patch patch_round(std::vector<Index> seeds, int layers, double most, const QualityReport& now,
                  const NodeCells& cells_at, const MovingNodes& moving);

}  // namespace cadmorph
