#pragma once

#include "core/types.h"

namespace cadmorph {

/// Carries displacements on to what is near. `at`: n x 3; `displacements`: n x 3 there; returns
/// those at `targets` (T x 3): at the given points as given, to 1e-3 of the distance to the next
/// one, smooth between them, and nothing beyond `reach` of those that move. By compactly supported
/// functions on several levels (MultiscaleCorrection), which do not run on as a polyharmonic spline
/// does. Points given twice count once, the first. Throws what MultiscaleCorrection throws. O(n +
/// T) for points as dense as those of a surface.
RowMatrix near_displacements(const Points& at, const RowMatrix& displacements, double reach,
                             const Points& targets);

}  // namespace cadmorph
