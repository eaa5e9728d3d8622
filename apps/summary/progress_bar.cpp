#include "apps/summary/progress_bar.h"

#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>

#include "apps/summary/text_table.h"

namespace cadmorph {
namespace {

// What ends within a second needs no bar; one that changes ten times a second looks alive. Its
// width leaves room for a phase and the time in a line of 80 columns, what terminals mostly have.
constexpr std::chrono::milliseconds kQuietFor{1000};
constexpr std::chrono::milliseconds kInterval{100};
constexpr int kWidth = 30, kLeastWidth = 5;
constexpr int kUsualColumns = 80;

int terminal_columns() {
  winsize size{};
  const bool is_known = ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 0;
  return is_known ? size.ws_col : kUsualColumns;
}

}  // namespace

ProgressBar::ProgressBar(bool is_wanted) : is_active_(is_wanted && isatty(STDERR_FILENO)) {}

ProgressBar::~ProgressBar() { erase(); }

void ProgressBar::show(std::string_view phase, double fraction) {
  if (!is_active_) return;
  const auto now = Clock::now();
  if (now - start_ < kQuietFor) return;
  if (phase == phase_ && now - last_ < kInterval) return;
  phase_ = phase;
  last_ = now;
  is_drawn_ = true;
  const double part = std::clamp(fraction, 0.0, 1.0);
  const double seconds = std::chrono::duration<double>(now - start_).count();
  const std::string text =
      format("%3d %%  ", static_cast<int>(100 * part)) + phase_ + format(", %.0f s", seconds);
  const int columns = terminal_columns() - 1;  // in the last one the line would break
  const int room = columns - static_cast<int>(text.size()) - 3;
  const int width = std::clamp(room, kLeastWidth, kWidth);
  const int filled = static_cast<int>(width * part);
  const std::string line =
      '[' + std::string(filled, '#') + std::string(width - filled, '.') + "] " + text;
  std::fprintf(stderr, "\r%.*s\x1b[K", columns, line.c_str());
  std::fflush(stderr);
}

void ProgressBar::erase() {
  if (!is_drawn_) return;
  std::fputs("\r\x1b[K", stderr);
  std::fflush(stderr);
  is_drawn_ = false;
}

}  // namespace cadmorph
