#include "apps/batch/step_readers.h"

#include <algorithm>
#include <string>
#include <system_error>
#include <utility>

#include "core/errors.h"
#include "core/parallel.h"
#include "core/stopwatch.h"

namespace cadmorph {

StepReaders::StepReaders(std::vector<const Variant*> variants, double timeout_s, std::size_t ahead,
                         const std::atomic<bool>& is_stopped)
    : variants_(std::move(variants)), timeout_(timeout_s), ahead_(ahead), is_stopped_(is_stopped) {
  const std::size_t count = std::min<std::size_t>(thread_count(), variants_.size());
  open_ = count;
  threads_.reserve(count);
  try {
    while (threads_.size() < count) threads_.emplace_back([this] { run(); });
  } catch (const std::system_error& error) {
    close();
    throw SolverError(std::string("can't start a thread that reads STEP files: ") + error.what());
  }
}

StepReaders::~StepReaders() { close(); }

std::vector<StepRead> StepReaders::next(std::size_t most) {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [&] { return !items_.empty() || open_ == 0; });
  if (error_) std::rethrow_exception(error_);
  std::vector<StepRead> block;
  while (!is_over() && !items_.empty() && block.size() < most) {
    block.push_back(std::move(items_.front()));
    items_.pop_front();
  }
  changed_.notify_all();
  return block;
}

void StepReaders::close() {
  const std::lock_guard guard(mutex_);
  is_closed_ = true;
  changed_.notify_all();
}

void StepReaders::run() {
  std::exception_ptr error;
  try {
    read_all();
  } catch (...) {
    error = std::current_exception();
  }
  const std::lock_guard guard(mutex_);
  if (error) error_ = error;
  --open_;
  changed_.notify_all();
}

void StepReaders::read_all() {
  StepWorker worker;
  while (!is_over()) {
    const std::size_t i = next_++;
    if (i >= variants_.size()) break;
    put(read(worker, *variants_[i]));
  }
}

StepRead StepReaders::read(StepWorker& worker, const Variant& variant) const {
  const Stopwatch watch;
  StepRead item{.variant = &variant,
                .reply = worker.read(variant.step, timeout_, [this] { return is_over(); })};
  item.seconds = watch.seconds();
  return item;
}

void StepReaders::put(StepRead item) {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [&] { return items_.size() < ahead_ || is_closed_; });
  items_.push_back(std::move(item));
  changed_.notify_all();
}

}  // namespace cadmorph
