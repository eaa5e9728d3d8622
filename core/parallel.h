#pragma once

#include <functional>
#include <memory>

#include "core/types.h"

namespace cadmorph {

/// Limits the number of threads of parallel_for and of the BLAS; 0 means all processors available.
void set_thread_count(int count);

/// Returns the number of threads in use.
int thread_count();

/// Runs body(begin, end) on all threads for chunks of exactly `grain` items of [0, count), the last
/// of what is left: chunk-wise reductions are reproducible. Rethrows exceptions of the body; else
/// all chunks have run on return, whatever became of the caller's own parallel loop.
void parallel_for(Index count, Index grain,
                  const std::function<void(Index begin, Index end)>& body);

/// Whether the items of a pipeline end as they came, or as they are done.
enum class PipelineOrder { Kept, Any };

/// A line of work over items that come one after the other: `read` makes the next in a slot of
/// [0, slots) and returns false when there is none, `work` goes on with it on any thread, `take`
/// ends it. The three run at the same time, on different slots. Rethrows exceptions.
void parallel_pipeline(Index slots, const std::function<bool(Index slot)>& read,
                       const std::function<void(Index slot)>& work,
                       const std::function<void(Index slot)>& take,
                       PipelineOrder order = PipelineOrder::Kept);

/// A loop over items, one a task, that the other threads run while the caller does something else.
class BackgroundLoop {
 public:
  BackgroundLoop();
  ~BackgroundLoop();  ///< waits; items that have not begun are left out
  BackgroundLoop(const BackgroundLoop&) = delete;
  BackgroundLoop& operator=(const BackgroundLoop&) = delete;

  /// Starts body(0), ..., body(count - 1). The loop before must have been waited for.
  void start(Index count, std::function<void(Index item)> body);
  /// Helps until all items are done. Rethrows exceptions of the body. To be called where start was,
  /// with no lock held: other tasks may be run, too.
  void wait();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace cadmorph
