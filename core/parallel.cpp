#include "core/parallel.h"

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/global_control.h>
#include <oneapi/tbb/info.h>
#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/parallel_pipeline.h>
#include <oneapi/tbb/task_arena.h>
#include <oneapi/tbb/task_group.h>

#include <algorithm>
#include <memory>
#include <mutex>
#include <numeric>
#include <utility>
#include <vector>

#include "core/blas.h"

#ifdef __has_feature
#if __has_feature(thread_sanitizer)
#include <sanitizer/tsan_interface.h>
#define CADMORPH_THREAD_SANITIZER
#endif
#endif

// What oneTBB hands to another thread is read before the order is known: see Order.
#ifdef CADMORPH_THREAD_SANITIZER
#define CADMORPH_UNSEEN __attribute__((no_sanitize("thread")))
#else
#define CADMORPH_UNSEEN
#endif

namespace cadmorph {
namespace {

std::unique_ptr<tbb::global_control> thread_limit;

/// Tells the thread sanitizer what oneTBB, which is built without it, keeps in order: what was done
/// before a release is done before what follows the next acquire.
class Order {
 public:
#ifdef CADMORPH_THREAD_SANITIZER
  void release() { __tsan_release(this); }
  void acquire() { __tsan_acquire(this); }
#else
  void release() {}
  void acquire() {}
#endif
};

// At the end of a block, also where it throws.
struct ReleaseAtEnd {
  Order& order;
  ~ReleaseAtEnd() { order.release(); }
};
struct AcquireAtEnd {
  Order& order;
  ~AcquireAtEnd() { order.acquire(); }
};

}  // namespace

void set_thread_count(int count) {
  const int threads = count > 0 ? count : tbb::info::default_concurrency();
  thread_limit = std::make_unique<tbb::global_control>(tbb::global_control::max_allowed_parallelism,
                                                       static_cast<std::size_t>(threads));
  set_blas_threads(threads);
}

int thread_count() {
  return static_cast<int>(
      tbb::global_control::active_value(tbb::global_control::max_allowed_parallelism));
}

void parallel_for(Index count, Index grain, const std::function<void(Index, Index)>& body) {
  if (count <= 0) return;
  const Index chunk = std::max<Index>(grain, 1);
  const Index chunks = (count + chunk - 1) / chunk;
  // Isolated: a thread that waits for this loop, perhaps with a lock held, takes no task of others.
  // A context of its own: when the caller's tasks are cancelled, since another one threw, the loop
  // would else end with chunks left out.
  tbb::this_task_arena::isolate([&] {
    tbb::task_group_context context(tbb::task_group_context::isolated);
    Order begin, end;
    const auto run = [&](const auto& range) {
      begin.acquire();
      const ReleaseAtEnd done{end};
      for (Index c = range.begin(); c < range.end(); ++c)
        body(c * chunk, std::min(count, (c + 1) * chunk));
    };
    begin.release();
    const AcquireAtEnd all_done{end};
    tbb::parallel_for(tbb::blocked_range<Index>(0, chunks, 1), run, context);
  });
}

void parallel_pipeline(Index slots, const std::function<bool(Index)>& read,
                       const std::function<void(Index)>& work,
                       const std::function<void(Index)>& take, PipelineOrder order) {
  using tbb::filter_mode;
  const filter_mode serial = order == PipelineOrder::Kept ? filter_mode::serial_in_order
                                                          : filter_mode::serial_out_of_order;
  // Isolated, and with a context of its own: see parallel_for.
  tbb::this_task_arena::isolate([&] {
    tbb::task_group_context context(tbb::task_group_context::isolated);
    Order reading, taking;
    std::vector<Order> items(static_cast<std::size_t>(slots));
    std::vector<Index> free(static_cast<std::size_t>(slots));  // there are as many tokens
    std::iota(free.rbegin(), free.rend(), Index(0));
    std::mutex mutex;
    const auto first = [&](tbb::flow_control& control) {
      reading.acquire();
      Index slot = 0;
      {
        const std::lock_guard guard(mutex);
        slot = free.back();
        free.pop_back();
      }
      items[slot].acquire();
      const ReleaseAtEnd has_read{reading}, has_item{items[slot]};
      if (!read(slot)) control.stop();
      return slot;
    };
    const auto second = [&](Index slot) {
      items[slot].acquire();
      const ReleaseAtEnd done{items[slot]};
      // A thread that waits within the item's own work takes up no other item meanwhile.
      tbb::this_task_arena::isolate([&] { work(slot); });
      return slot;
    };
    const auto third = [&](Index slot) {
      items[slot].acquire();
      taking.acquire();
      const ReleaseAtEnd done{items[slot]}, has_taken{taking};
      take(slot);
      const std::lock_guard guard(mutex);
      free.push_back(slot);
    };
    reading.release();
    const AcquireAtEnd all_read{reading}, all_taken{taking};
    tbb::parallel_pipeline(std::size_t(slots),
                           tbb::make_filter<void, Index>(serial, first) &
                               tbb::make_filter<Index, Index>(filter_mode::parallel, second) &
                               tbb::make_filter<Index, void>(serial, third),
                           context);
  });
}

struct BackgroundLoop::Impl {
  void run(Index item) {
    begin.acquire();
    const ReleaseAtEnd done{end};
    body(item);
  }

  std::function<void(Index)> body;
  Order begin, end;
  tbb::task_group_context context{tbb::task_group_context::isolated};  // see parallel_for
  tbb::task_group tasks{context};
};

BackgroundLoop::BackgroundLoop() : impl_(std::make_unique<Impl>()) {}

BackgroundLoop::~BackgroundLoop() {
  const AcquireAtEnd all_done{impl_->end};
  impl_->tasks.cancel();
  try {
    impl_->tasks.wait();
  } catch (...) {  // nobody waits for the items
  }
}

void BackgroundLoop::start(Index count, std::function<void(Index)> body) {
  Impl& impl = *impl_;
  impl.body = std::move(body);
  impl.begin.release();
  for (Index item = 0; item < count; ++item)
    impl.tasks.run([&impl, item]() CADMORPH_UNSEEN { impl.run(item); });
}

void BackgroundLoop::wait() {
  const AcquireAtEnd all_done{impl_->end};
  impl_->tasks.wait();
}

}  // namespace cadmorph
