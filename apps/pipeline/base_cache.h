#pragma once

#include "apps/pipeline/base_side.h"

namespace cadmorph {

/// Keeps a base side in the file PipelineOptions::cache (docs/batch.md).
class BaseCache {
 public:
  /// Sets `side` up by what the file holds if that is just this base side, else anew, and writes
  /// it. The side is the same to the last bit. A file that can't be used or written is told in the
  /// report, no error; but one that is no cache is left as it is: InvalidInputError.
  static CacheReport set_up(BaseSide& side, PhaseClock& clock);
};

}  // namespace cadmorph
