#include "apps/summary/progress_bar.h"

#include <unistd.h>

#include <algorithm>
#include <cstdio>

namespace cadmorph {
namespace {

constexpr std::chrono::milliseconds kPatience{1000};
constexpr std::chrono::milliseconds kInterval{100};
constexpr int kWidth = 30;

}  // namespace

ProgressBar::ProgressBar(bool is_wanted) : is_active_(is_wanted && isatty(STDERR_FILENO)) {}

ProgressBar::~ProgressBar() { erase(); }

void ProgressBar::show(std::string_view phase, double fraction) {
  if (!is_active_) return;
  const auto now = Clock::now();
  if (now - start_ < kPatience) return;
  if (phase == phase_ && now - last_ < kInterval) return;
  phase_ = phase;
  last_ = now;
  is_drawn_ = true;
  const int filled = static_cast<int>(kWidth * std::clamp(fraction, 0.0, 1.0));
  const std::string bar = std::string(filled, '#') + std::string(kWidth - filled, '.');
  const double seconds = std::chrono::duration<double>(now - start_).count();
  std::fprintf(stderr, "\r[%s] %3d %%  %s, %.0f s\x1b[K", bar.c_str(),
               static_cast<int>(100 * std::clamp(fraction, 0.0, 1.0)), phase_.c_str(), seconds);
  std::fflush(stderr);
}

void ProgressBar::erase() {
  if (!is_drawn_) return;
  std::fputs("\r\x1b[K", stderr);
  std::fflush(stderr);
  is_drawn_ = false;
}

}  // namespace cadmorph
