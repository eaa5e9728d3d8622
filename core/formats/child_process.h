#pragma once

#include <sys/types.h>

#include <cstddef>
#include <cstdint>
#include <functional>

namespace cadmorph {

/// The two ends of what a process and its child say to each other.
class Socket {
 public:
  explicit Socket(int descriptor) : descriptor_(descriptor) {}

  /// False when the other process has ended.
  bool send(const void* bytes, std::size_t size) const;
  bool receive(void* bytes, std::size_t size) const;
  /// Whether within so many seconds of the clock something came, or the other process ended.
  bool waits(int seconds) const;

 private:
  friend class ChildProcess;

  int descriptor_ = -1;
};

/// Processor time to read a file: 20 s and a second for each 4 MB.
inline std::uint64_t seconds_to_read(std::uint64_t file_size) { return 20 + (file_size >> 22); }

/// A copy of this process for work that may crash or come to no end, as HDF5 1.10 on some damaged
/// files. It prints nothing, leaves no core file, and is ended after some processor time. Locks
/// that other threads held when it was made stay locked in it: the work must register no function
/// for the exit (std::atexit, a static object with a destructor).
class ChildProcess {
 public:
  /// Starts `work` in the copy, which ends with it, or after `seconds` of processor time.
  ChildProcess(std::uint64_t seconds, const std::function<void(const Socket&)>& work);
  /// Ends it.
  ~ChildProcess();
  ChildProcess(const ChildProcess&) = delete;
  ChildProcess& operator=(const ChildProcess&) = delete;

  bool has_started() const { return id_ > 0; }
  const Socket& socket() const { return socket_; }

 private:
  pid_t id_ = -1;
  Socket socket_{-1};
};

}  // namespace cadmorph
