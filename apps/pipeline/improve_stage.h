#pragma once

#include "apps/pipeline/sliding.h"

namespace cadmorph {

/// Raises cells below the figure that was asked for, if one was: by the inner nodes, then where
/// that does not do by those on CAD edges and faces, too. What it did goes into the report.
void improve_result(const BaseSide& base, Sliding& sliding, MorphResult& result);

}  // namespace cadmorph
