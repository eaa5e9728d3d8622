#pragma once

#include "apps/pipeline/morph_job.h"

namespace cadmorph {

/// Cells whose scaled Jacobian is below the limit.
std::vector<Index> cells_below(double limit, const QualityReport& quality);

/// Cells the result is refused for: invalid ones, those whose corners inverted on the way, and
/// those below the quality asked for.
std::vector<Index> bad_cells(const MorphResult& result);

/// Refuses a result with bad cells: sets the report's outcome and the diagnosis with its advice.
void judge(MorphResult& result);

}  // namespace cadmorph
