#pragma once

#include "apps/pipeline/sliding.h"

namespace cadmorph {

/// Moves the volume in as many steps as it takes, with repair. `one_step`: of the first, or null;
/// used up. Returns whether it took more than inner nodes.
bool move_and_repair(const BaseSide& base, VolumeMorphResult* one_step, Sliding& sliding,
                     PhaseClock& clock, MorphResult& result);

/// Whether second-order cells are moved and repaired by their corners.
bool has_corners_to_repair(const BaseSide& base);

/// Moves and repairs second-order cells as straight ones at their corners, and lays the nodes amid
/// edges then: that is an eighth of the nodes, of cells that cost a tenth. `result`: of one step.
/// Returns false, with `result` as it was, where curved cells need another way (where the straight
/// ones can't be repaired, neither can they), or where that step was valid and following gains
/// nothing.
bool go_by_corners(const BaseSide& base, Sliding& sliding, PhaseClock& clock, MorphResult& result);

}  // namespace cadmorph
