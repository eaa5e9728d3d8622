#pragma once

#include <sys/types.h>

#include <chrono>
#include <filesystem>
#include <functional>
#include <string>

#include "cad/brep.h"

namespace cadmorph {

/// What became of one STEP file.
struct StepReply {
  int exit_code = 0;     ///< as a command of its own would give
  std::string message;   ///< of an error
  std::string hash;      ///< of the file's bytes; empty when the reader did not live to tell
  std::string model;     ///< for unpack_model
  bool is_lost = false;  ///< the reader hung, crashed, was killed or stopped: not the file's word
};

/// A process of this program that reads STEP files one after the other (OCCT's reader is global,
/// and damaged files can crash or hang it). For one thread at a time. It ends with this object, or
/// with this process, however that ends.
class StepWorker {
 public:
  StepWorker() = default;
  ~StepWorker();
  StepWorker(const StepWorker&) = delete;
  StepWorker& operator=(const StepWorker&) = delete;

  /// Reads one file. A reader that does not answer within `timeout` is killed; one that died is
  /// replaced, and asked once more if a signal from outside killed it. Returns early, with is_lost,
  /// when `is_stopped` says so. Throws SolverError when no process can be started.
  StepReply read(const std::filesystem::path& path, std::chrono::duration<double> timeout,
                 const std::function<bool()>& is_stopped);

 private:
  void start();
  int stop();

  pid_t process_ = -1;
  int socket_ = -1;
};

/// Reads a STEP file as read_step does, in a process of its own. Throws CadError when the file
/// can't be read, keeps that process longer than `timeout` or crashes it; SolverError when
/// resources end.
CadModel read_step_within(std::chrono::duration<double> timeout, const std::filesystem::path& path);

/// The worker's side: answers requests on standard input, a socket, until it closes.
void serve_step_files();

}  // namespace cadmorph
