#pragma once

#include "cad/brep.h"

namespace cadmorph {

/// Finds the physical curves and corners of a model: edges that are neither seams nor degenerate,
/// chained over vertices where a seam ends and just two of them meet smoothly between the same faces. A
/// re-export cuts such curves where its seam happens to lie, so those vertices carry no meaning. The
/// only vertex of a smooth closed edge is no corner either.
CadSkeleton build_skeleton(const CadModel& model);

}  // namespace cadmorph
