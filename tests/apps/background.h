#pragma once

#include <sys/types.h>

#include <chrono>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

namespace cadmorph::testing {

/// cadmorph, run beside the test in a folder; its stderr goes to `<folder>/background.err`. Killed
/// with its readers when the object ends.
class Background {
 public:
  Background(const std::filesystem::path& folder, const std::vector<std::string>& arguments);
  ~Background();
  Background(const Background&) = delete;
  Background& operator=(const Background&) = delete;

  pid_t id() const { return process_; }

  /// Processes that read STEP files for it now.
  std::vector<pid_t> readers() const;

  void send(int signal) const;

  /// Waits for its end; the exit code, or minus the signal that ended it.
  int wait();

 private:
  pid_t process_ = -1;
};

/// Waits until `condition` holds, a minute at most; says whether it does.
bool wait_for(const std::function<bool()>& condition);

/// The parent of a process; 0 when it is gone or waits to be buried.
pid_t parent_of(pid_t process);

}  // namespace cadmorph::testing
