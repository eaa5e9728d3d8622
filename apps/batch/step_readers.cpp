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
    : variants_(std::move(variants)), timeout_(timeout_s), is_stopped_(is_stopped) {
  queue_.set_capacity(static_cast<std::ptrdiff_t>(ahead));
  try {
    start(std::min<std::size_t>(thread_count(), variants_.size()));
  } catch (const std::system_error& error) {
    close();
    throw SolverError(std::string("can't start a thread that reads STEP files: ") + error.what());
  }
}

StepReaders::~StepReaders() { close(); }

std::vector<StepRead> StepReaders::next(std::size_t most) {
  std::vector<StepRead> block;
  while (open_ > 0 && !is_over() && (block.empty() || (block.size() < most && !queue_.empty())))
    if (const Item item = pop()) block.push_back(std::move(*item));
  rethrow();
  if (is_over()) block.clear();
  return block;
}

void StepReaders::start(std::size_t count) {
  threads_.reserve(count);
  while (open_ < count) {
    threads_.emplace_back([this] { run(); });
    ++open_;
  }
}

// Takes what the readers still push, so that none of them waits for room.
void StepReaders::close() {
  is_closed_ = true;
  while (open_ > 0) pop();
}

void StepReaders::run() {
  try {
    StepWorker worker;
    while (!is_over()) {
      const std::size_t i = next_++;
      if (i >= variants_.size()) break;
      queue_.push(read(worker, *variants_[i]));
    }
  } catch (...) {
    const std::lock_guard guard(mutex_);
    error_ = std::current_exception();
  }
  queue_.push(nullptr);
}

StepReaders::Item StepReaders::read(StepWorker& worker, const Variant& variant) const {
  const Stopwatch watch;
  auto item = std::make_shared<StepRead>();
  item->variant = &variant;
  item->reply = worker.read(variant.step, timeout_, [this] { return is_over(); });
  item->seconds = watch.seconds();
  return item;
}

StepReaders::Item StepReaders::pop() {
  Item item;
  queue_.pop(item);
  if (!item) --open_;
  return item;
}

void StepReaders::rethrow() {
  const std::lock_guard guard(mutex_);
  if (error_) std::rethrow_exception(error_);
}

}  // namespace cadmorph
