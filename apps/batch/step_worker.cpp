#include "apps/batch/step_worker.h"

#include <fcntl.h>
#include <poll.h>
#include <spawn.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdint>
#include <cstring>
#include <optional>
#include <thread>

#include "apps/pipeline/exit_code.h"
#include "apps/summary/text_table.h"
#include "cad/packed_model.h"
#include "cad/step_reader.h"
#include "core/content_hash.h"
#include "core/errors.h"

namespace cadmorph {
namespace {

using Clock = std::chrono::steady_clock;

constexpr int kSliceMs = 50;  // between two looks at the clock and at is_stopped

enum class Wait { Ready, Timeout, Stopped };

// When to give up waiting.
struct Patience {
  Clock::time_point end = Clock::time_point::max();
  std::function<bool()> is_stopped = [] { return false; };

  Wait wait(int socket) const {
    pollfd item{socket, POLLIN, 0};
    while (poll(&item, 1, kSliceMs) <= 0) {
      if (is_stopped()) return Wait::Stopped;
      if (Clock::now() > end) return Wait::Timeout;
    }
    return Wait::Ready;
  }
};

// The clock counts 292 years; who waits for longer waits for ever.
Clock::time_point end_of(std::chrono::duration<double> timeout) {
  const Clock::time_point now = Clock::now();
  const std::chrono::duration<double> countable = (Clock::time_point::max() - now) / 2;
  if (timeout > countable) return Clock::time_point::max();
  return now + std::chrono::duration_cast<Clock::duration>(timeout);
}

bool send_all(int socket, const char* data, std::size_t size) {
  while (size > 0) {
    const ssize_t count = send(socket, data, size, MSG_NOSIGNAL);
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return false;
    data += count;
    size -= static_cast<std::size_t>(count);
  }
  return true;
}

bool send_text(int socket, const std::string& text) {
  const auto size = static_cast<std::uint64_t>(text.size());
  return send_all(socket, reinterpret_cast<const char*>(&size), sizeof size) &&
         send_all(socket, text.data(), text.size());
}

// Nothing when the other side is gone or patience ended, which `why` then tells.
bool receive_all(int socket, char* data, std::size_t size, const Patience& patience, Wait& why) {
  while (size > 0) {
    why = patience.wait(socket);
    if (why != Wait::Ready) return false;
    const ssize_t count = recv(socket, data, size, 0);
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return false;
    data += count;
    size -= static_cast<std::size_t>(count);
  }
  return true;
}

std::optional<std::string> receive_text(int socket, const Patience& patience, Wait& why) {
  std::uint64_t size = 0;
  if (!receive_all(socket, reinterpret_cast<char*>(&size), sizeof size, patience, why)) return {};
  std::string text(size, '\0');
  if (!receive_all(socket, text.data(), size, patience, why)) return {};
  return text;
}

// Not the STEP file's doing: someone else, or the system short of memory, killed the reader.
bool is_from_outside(int status) {
  return WIFSIGNALED(status) && (WTERMSIG(status) == SIGKILL || WTERMSIG(status) == SIGTERM ||
                                 WTERMSIG(status) == SIGINT || WTERMSIG(status) == SIGHUP);
}

StepReply lost(ExitCode code, const std::string& message) {
  StepReply reply;
  reply.exit_code = static_cast<int>(code);
  reply.message = message;
  reply.is_lost = true;
  return reply;
}

StepReply died(const std::string& path, int status) {
  if (!WIFSIGNALED(status))
    return lost(ExitCode::Resources,
                path + format(": the STEP reader ended with exit code %d", WEXITSTATUS(status)));
  const int signal = WTERMSIG(status);
  if (is_from_outside(status))
    return lost(ExitCode::Resources,
                path + format(": the STEP reader was killed twice (signal %d), as happens when "
                              "memory runs out. Free some, then try again (a batch with --resume).",
                              signal));
  return lost(ExitCode::Input, path + format(": the STEP reader crashed on it (signal %d, %s). "
                                             "Export the part again.",
                                             signal, sigdescr_np(signal)));
}

bool send_reply(int socket, const StepReply& reply) {
  return send_text(socket, std::to_string(reply.exit_code)) && send_text(socket, reply.message) &&
         send_text(socket, reply.hash) && send_text(socket, reply.model);
}

std::optional<StepReply> receive_reply(int socket, const Patience& patience, Wait& why) {
  StepReply reply;
  std::string exit_code;
  for (std::string* text : {&exit_code, &reply.message, &reply.hash, &reply.model}) {
    std::optional<std::string> received = receive_text(socket, patience, why);
    if (!received) return {};
    *text = std::move(*received);
  }
  reply.exit_code = std::stoi(exit_code);
  return reply;
}

StepReply read_here(const std::string& path) {
  StepReply reply;
  try {
    check_step_file(path);
    reply.hash = file_hash(path);
    reply.model = read_step_packed(path);
  } catch (const std::bad_alloc&) {
    reply.exit_code = static_cast<int>(ExitCode::Resources);
    reply.message = path + ": out of memory while reading it";
  } catch (const std::exception& error) {
    reply.exit_code = static_cast<int>(exit_code_of(error));
    reply.message = error.what();
  }
  return reply;
}

}  // namespace

StepWorker::~StepWorker() { stop(); }

void StepWorker::start() {
  if (process_ > 0) return;
  int ends[2];
  if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) != 0)
    throw SolverError(std::string("can't start a STEP reader: ") + std::strerror(errno));
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, ends[1], STDIN_FILENO);
  posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
  char name[] = "cadmorph", command[] = "read-step";
  char* const arguments[] = {name, command, nullptr};
  const int error = posix_spawn(&process_, "/proc/self/exe", &actions, nullptr, arguments, environ);
  posix_spawn_file_actions_destroy(&actions);
  close(ends[1]);
  socket_ = ends[0];
  if (error == 0) return;
  process_ = -1;
  stop();
  throw SolverError(std::string("can't start a STEP reader: ") + std::strerror(error));
}

// Returns the process's status.
int StepWorker::stop() {
  int status = 0;
  if (socket_ >= 0) close(socket_);
  if (process_ > 0) {
    kill(process_, SIGKILL);
    while (waitpid(process_, &status, 0) < 0 && errno == EINTR) continue;
  }
  socket_ = -1;
  process_ = -1;
  return status;
}

StepReply StepWorker::read(const std::filesystem::path& path, std::chrono::duration<double> timeout,
                           const std::function<bool()>& is_stopped) {
  for (bool is_first = true;; is_first = false) {
    start();
    const Patience patience{end_of(timeout), is_stopped};
    Wait why = Wait::Ready;
    if (send_text(socket_, path.string()))
      if (std::optional<StepReply> reply = receive_reply(socket_, patience, why)) return *reply;
    const int status = stop();
    if (why == Wait::Stopped) return lost(ExitCode::Resources, path.string() + ": interrupted");
    if (why == Wait::Timeout)
      return lost(
          ExitCode::Input,
          path.string() + format(": the STEP reader gave no answer in %g s and was stopped. "
                                 "Export the part again, or raise --timeout.",
                                 timeout.count()));
    if (is_first && is_from_outside(status)) continue;
    return died(path.string(), status);
  }
}

CadModel read_step_within(std::chrono::duration<double> timeout,
                          const std::filesystem::path& path) {
  StepWorker worker;
  const StepReply reply = worker.read(path, timeout, [] { return false; });
  if (reply.exit_code == 0) return unpack_model(reply.model);
  if (reply.exit_code == static_cast<int>(ExitCode::Input)) throw CadError(reply.message);
  throw SolverError(reply.message);
}

void serve_step_files() {
  // The parent handles interrupts; a reader ends when the parent's side of the socket closes.
  std::signal(SIGINT, SIG_IGN);
  std::signal(SIGTERM, SIG_IGN);
  const rlimit no_core{0, 0};
  setrlimit(RLIMIT_CORE, &no_core);
  std::thread([] {
    pollfd item{STDIN_FILENO, 0, 0};
    while (poll(&item, 1, -1) < 0 && errno == EINTR) continue;
    _exit(0);
  }).detach();
  Wait why = Wait::Ready;
  while (const std::optional<std::string> path = receive_text(STDIN_FILENO, {}, why))
    if (!send_reply(STDIN_FILENO, read_here(*path))) return;
}

}  // namespace cadmorph
