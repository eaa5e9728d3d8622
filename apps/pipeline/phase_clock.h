#pragma once

#include <string>
#include <vector>

#include "core/progress.h"
#include "core/stopwatch.h"

namespace cadmorph {

/// Time of one phase of the trip.
struct PhaseTime {
  std::string name;
  double seconds;
};

/// Takes the time of phases that follow each other, and announces each to a progress callback.
class PhaseClock {
 public:
  explicit PhaseClock(Progress progress = {}) : progress_(std::move(progress)) {}

  /// Ends the running phase and begins another.
  void start(const std::string& name) {
    stop();
    phases_.push_back({name, 0});
    is_running_ = true;
    phase_ = Stopwatch();
    if (progress_) progress_(name, 0);
  }

  void stop() {
    if (!is_running_) return;
    phases_.back().seconds = phase_.seconds();
    is_running_ = false;
  }

  /// Ends the running phase and returns all.
  const std::vector<PhaseTime>& phases() {
    stop();
    return phases_;
  }

 private:
  Progress progress_;
  std::vector<PhaseTime> phases_;
  Stopwatch phase_;
  bool is_running_ = false;
};

}  // namespace cadmorph
