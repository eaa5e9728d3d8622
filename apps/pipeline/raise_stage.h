#pragma once

#include "apps/pipeline/sliding.h"

namespace cadmorph {

/// Whether nodes may move for quality alone. `quality`: of the moved mesh.
bool may_raise(const BaseSide& base, const QualityReport& quality);

/// Raises the cells that lost most against the mesh file's, also after a series of morphs. Faces of
/// finite volumes may be good where a cell is flat: shapes that lost much are raised after them,
/// where that costs the faces nothing.
void raise_lost_cells(const BaseSide& base, Sliding& sliding, MorphResult& result);

/// Raises the lost cells, after surface nodes followed where that promises to keep more.
/// Where it does not, but raising leaves less than half, that is tried still, and the better one
/// taken.
void raise_or_follow(const BaseSide& base, Sliding& sliding, PhaseClock& clock,
                     MorphResult& result);

}  // namespace cadmorph
