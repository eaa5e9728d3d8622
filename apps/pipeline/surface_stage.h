#pragma once

#include <memory>

#include "apps/pipeline/morph_job.h"

namespace cadmorph {

/// Starts a result: its base side and variant with the match between them, told in the report.
MorphResult begin_result(std::shared_ptr<const BaseSide> base, const CadModel& variant,
                         TopologyMatch match);

/// Moves the surface of a matched result; what it tells goes into the report.
void move_surface(MorphResult& result);

}  // namespace cadmorph
