#include "core/interrupt.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <mutex>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

namespace cadmorph {
namespace {

namespace fs = std::filesystem;

struct Doomed {
  std::mutex mutex;
  std::vector<fs::path> paths;
};

// Never destroyed: the remover may still run while the process ends.
Doomed& doomed() {
  static auto* const all = new Doomed;
  return *all;
}

int pipe_ends[2] = {-1, -1};
pid_t owner = 0;

// A handler may do next to nothing: the rest is for a thread to do.
void pass_on(int signal) {
  const int error = errno;
  const char byte = static_cast<char>(signal);
  if (getpid() != owner || write(pipe_ends[1], &byte, 1) != 1) {
    std::signal(signal, SIG_DFL);
    raise(signal);
  }
  errno = error;
}

void remove_all_doomed() {
  const std::lock_guard lock(doomed().mutex);
  // Another thread may put a file into a folder while it is emptied: hardly so many times, and
  // what can't be removed is not tried without end.
  constexpr int kTrials = 100;
  for (const fs::path& path : doomed().paths) {
    std::error_code error;
    for (int trial = 0; trial == 0 || (error && trial < kTrials); ++trial)
      fs::remove_all(path, error);
  }
}

void wait_for_interrupt() {
  char signal = 0;
  ssize_t size = 0;
  while ((size = read(pipe_ends[0], &signal, 1)) < 0 && errno == EINTR) continue;
  if (size != 1) return;
  remove_all_doomed();
  std::signal(signal, SIG_DFL);
  kill(getpid(), signal);
}

}  // namespace

void remove_temporaries_at_interrupt() {
  if (owner == getpid() || pipe2(pipe_ends, O_CLOEXEC) != 0) return;
  owner = getpid();
  std::thread(wait_for_interrupt).detach();
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
    struct sigaction old = {}, action = {};
    sigaction(signal, nullptr, &old);
    if (old.sa_handler == SIG_IGN) continue;
    action.sa_handler = pass_on;
    action.sa_flags = SA_RESTART;
    sigaction(signal, &action, nullptr);
  }
}

InterruptRemoval::InterruptRemoval(fs::path path) : path_(std::move(path)) {
  std::error_code error;
  path_ = fs::absolute(path_, error);
  const std::lock_guard lock(doomed().mutex);
  doomed().paths.push_back(path_);
}

InterruptRemoval::~InterruptRemoval() {
  const std::lock_guard lock(doomed().mutex);
  auto& paths = doomed().paths;
  if (const auto mine = std::ranges::find(paths, path_); mine != paths.end()) paths.erase(mine);
}

}  // namespace cadmorph
