#include "apps/picture/picture_display.h"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <string>

#include "core/errors.h"

namespace cadmorph {
namespace {

constexpr int start_timeout_ms = 20000;  // a loaded machine needs some seconds

[[noreturn]] void run_server(int display_fd) {
  prctl(PR_SET_PDEATHSIG, SIGTERM);
  const int null = open("/dev/null", O_RDWR);
  dup2(null, STDOUT_FILENO);
  dup2(null, STDERR_FILENO);
  const std::string fd = std::to_string(display_fd);
  execlp("Xvfb", "Xvfb", "-displayfd", fd.c_str(), "-screen", "0", "640x480x24", "-nolisten", "tcp",
         static_cast<char*>(nullptr));
  _exit(127);
}

/// Reads the display number that Xvfb writes once it is ready; empty when it ended or took too
/// long.
std::string read_display_number(int fd) {
  std::string number;
  pollfd waiting{fd, POLLIN, 0};
  while (poll(&waiting, 1, start_timeout_ms) > 0) {
    char c = 0;
    if (read(fd, &c, 1) != 1) return "";
    if (c == '\n') return number;
    number += c;
  }
  return "";
}

void stop(pid_t server) {
  kill(server, SIGTERM);
  waitpid(server, nullptr, 0);
}

}  // namespace

PrivateDisplay::PrivateDisplay() {
  int pipe_ends[2];
  if (pipe(pipe_ends) != 0) throw SolverError("can't open a pipe to start Xvfb");
  server_ = fork();
  if (server_ == 0) {
    close(pipe_ends[0]);
    run_server(pipe_ends[1]);
  }
  close(pipe_ends[1]);
  const std::string number = server_ > 0 ? read_display_number(pipe_ends[0]) : "";
  close(pipe_ends[0]);
  if (!number.empty()) {
    setenv("DISPLAY", (":" + number).c_str(), 1);
    return;
  }
  if (server_ > 0) stop(server_);
  server_ = -1;
  if (std::getenv("DISPLAY") == nullptr) {
    throw SolverError(
        "no display to render on: DISPLAY is not set and Xvfb can't be started; install it "
        "(apt-get install xvfb)");
  }
}

PrivateDisplay::~PrivateDisplay() {
  if (server_ > 0) stop(server_);
}

}  // namespace cadmorph
