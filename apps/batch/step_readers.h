#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <deque>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

#include "apps/batch/step_worker.h"
#include "apps/batch/variant_list.h"

namespace cadmorph {

/// A variant's STEP file as a worker read it.
struct StepRead {
  const Variant* variant = nullptr;
  StepReply reply;
  double seconds = 0;
};

/// Reads the STEP files of variants in processes of their own, as many as threads, a few ahead of
/// who takes them.
class StepReaders {
 public:
  /// `ahead`: files read that wait to be taken, at most. Throws SolverError when no threads can be
  /// had.
  StepReaders(std::vector<const Variant*> variants, double timeout_s, std::size_t ahead,
              const std::atomic<bool>& is_stopped);
  ~StepReaders();
  StepReaders(const StepReaders&) = delete;
  StepReaders& operator=(const StepReaders&) = delete;

  /// The next files read: waits for one and takes what else is there, `most` at most; none at the
  /// end, or when the batch was stopped. Throws what kept a reader from working.
  std::vector<StepRead> next(std::size_t most);

 private:
  bool is_over() const { return is_closed_ || is_stopped_; }
  void close();
  void run();
  void read_all();
  StepRead read(StepWorker& worker, const Variant& variant) const;
  void put(StepRead item);

  std::vector<const Variant*> variants_;
  std::chrono::duration<double> timeout_;
  std::size_t ahead_;
  const std::atomic<bool>& is_stopped_;
  std::atomic<bool> is_closed_ = false;
  std::atomic<std::size_t> next_ = 0;

  std::mutex mutex_;  ///< of what follows
  std::condition_variable changed_;
  std::deque<StepRead> items_;
  std::size_t open_ = 0;  ///< readers at work
  std::exception_ptr error_;

  std::vector<std::jthread> threads_;
};

}  // namespace cadmorph
