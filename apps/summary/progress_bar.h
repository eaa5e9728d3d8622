#pragma once

#include <chrono>
#include <string>
#include <string_view>

namespace cadmorph {

/// A progress bar on stderr, drawn only on a terminal and only once a second has passed; gone when
/// the object is.
class ProgressBar {
 public:
  explicit ProgressBar(bool is_wanted = true);
  ~ProgressBar();
  ProgressBar(const ProgressBar&) = delete;
  ProgressBar& operator=(const ProgressBar&) = delete;

  /// Shows a phase at a fraction in [0, 1].
  void show(std::string_view phase, double fraction);

  /// Takes the bar away, so that other text can be printed.
  void erase();

 private:
  using Clock = std::chrono::steady_clock;
  bool is_active_;
  bool is_drawn_ = false;
  Clock::time_point start_ = Clock::now();
  Clock::time_point last_ = start_;
  std::string phase_;
};

}  // namespace cadmorph
