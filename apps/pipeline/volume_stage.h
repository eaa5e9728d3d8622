#pragma once

#include <optional>
#include <vector>

#include "apps/pipeline/morph_job.h"

namespace cadmorph {

/// Moves the volume in one step for all attempts without an error, those of a base side together
/// (see VolumeMorph::morph_each), whose error becomes that of each. Nothing where more steps were
/// asked for.
std::vector<std::optional<VolumeMorphResult>> first_steps(std::vector<MorphAttempt>& attempts);

/// From the surface's new positions to a judged result: the volume in steps (`one_step`, if not
/// null, is the result of the first, and used up), then repair, then quality, all told in the
/// report.
void move_volume(MorphResult& result, VolumeMorphResult* one_step);

/// Calls on the attempts without an error; what a call throws becomes its attempt's.
template <class Call>
void for_each_good(std::vector<MorphAttempt>& attempts, Call&& call) {
  for (std::size_t i = 0; i < attempts.size(); ++i) {
    if (attempts[i].error) continue;
    try {
      call(i, attempts[i].result);
    } catch (...) {
      attempts[i].error = std::current_exception();
    }
  }
}

}  // namespace cadmorph
