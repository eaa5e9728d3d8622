#pragma once

#include "cad/brep.h"

namespace cadmorph {

/// Finds the physical curves and corners of a model: edges that are neither seams nor degenerate,
/// chained over vertices where just two of them meet smoothly between the same faces. A re-export
/// splits such curves where a seam happens to end, so those vertices carry no meaning.
CadSkeleton build_skeleton(const CadModel& model);

}  // namespace cadmorph
