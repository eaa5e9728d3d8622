#pragma once

#include <functional>

#include "core/types.h"

namespace cadmorph {

/// Limits the number of threads of parallel_for and of the BLAS; 0 means all processors available.
void set_thread_count(int count);

/// Returns the number of threads in use.
int thread_count();

/// Runs body(begin, end) over disjoint chunks of [0, count), at least `grain` items each where
/// possible, on all threads. The chunks depend on count and grain alone, not on the thread count, so
/// that chunk-wise reductions are reproducible. Exceptions of the body are rethrown to the caller.
void parallel_for(Index count, Index grain, const std::function<void(Index begin, Index end)>& body);

}  // namespace cadmorph
