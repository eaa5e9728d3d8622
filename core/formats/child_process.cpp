#include "core/formats/child_process.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdlib>

namespace cadmorph {
namespace {

void limit_child(rlim_t seconds) {
  const rlimit no_core{0, 0}, time{seconds, seconds};
  setrlimit(RLIMIT_CORE, &no_core);
  setrlimit(RLIMIT_CPU, &time);
  for (const int fault : {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT, SIGXCPU})
    std::signal(fault, SIG_DFL);
  if (const int nothing = open("/dev/null", O_WRONLY); nothing >= 0) dup2(nothing, STDERR_FILENO);
}

}  // namespace

bool Socket::send(const void* bytes, std::size_t size) const {
  const char* at = static_cast<const char*>(bytes);
  while (size > 0) {
    const ssize_t sent = ::send(descriptor_, at, size, MSG_NOSIGNAL);
    if (sent < 0 && errno == EINTR) continue;
    if (sent <= 0) return false;
    at += sent;
    size -= std::size_t(sent);
  }
  return true;
}

bool Socket::receive(void* bytes, std::size_t size) const {
  char* at = static_cast<char*>(bytes);
  while (size > 0) {
    const ssize_t got = recv(descriptor_, at, size, 0);
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) return false;
    at += got;
    size -= std::size_t(got);
  }
  return true;
}

bool Socket::waits(int seconds) const {
  pollfd ready{descriptor_, POLLIN, 0};
  return poll(&ready, 1, 1000 * seconds) != 0;
}

ChildProcess::ChildProcess(std::uint64_t seconds, const std::function<void(const Socket&)>& work) {
  int ends[2] = {-1, -1};
  if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) != 0) return;
  id_ = fork();
  if (id_ == 0) {
    close(ends[0]);
    limit_child(seconds);
    try {
      work(Socket(ends[1]));
    } catch (...) {  // nothing of this process's may run on in the copy
    }
    _exit(EXIT_SUCCESS);
  }
  close(ends[1]);
  socket_ = Socket(ends[0]);
}

ChildProcess::~ChildProcess() {
  if (id_ > 0) kill(id_, SIGKILL);
  while (id_ > 0 && waitpid(id_, nullptr, 0) < 0 && errno == EINTR) {
  }
  if (socket_.descriptor_ >= 0) close(socket_.descriptor_);
}

}  // namespace cadmorph
