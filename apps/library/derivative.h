#pragma once

#include "apps/library/include/cadmorph/derivative.h"
#include "apps/pipeline/pipeline.h"

namespace cadmorph::v1 {

Derivative make_derivative(const MorphJob& job, const Points& surface_positions);

Velocity make_velocity(const MorphJob& job, const cadmorph::CadModel& plus,
                       const cadmorph::CadModel& minus, double step);

}  // namespace cadmorph::v1
