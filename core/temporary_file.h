#pragma once

#include <sys/types.h>

#include <cstddef>
#include <filesystem>
#include <optional>

#include "core/interrupt.h"

namespace cadmorph {

/// A new file beside the one to write; gone again, also at an interrupt, unless it took that one's
/// place. Its members
/// throw IoError.
class TemporaryFile {
 public:
  /// `target` may be a link: its own target is then replaced.
  explicit TemporaryFile(const std::filesystem::path& target);
  ~TemporaryFile();
  TemporaryFile(const TemporaryFile&) = delete;
  TemporaryFile& operator=(const TemporaryFile&) = delete;

  /// Where it is until then.
  const std::filesystem::path& path() const { return path_; }

  /// Writes at a place in the file.
  void write(const char* data, std::size_t size, off_t place);

  /// Flushes to disk and takes the target's place.
  void commit();

 private:
  std::filesystem::path target_;
  std::filesystem::path path_;
  std::optional<InterruptRemoval> removal_;
  int file_ = -1;
};

/// A new folder beside the one to write; gone again, with all in it, unless it took that one's
/// place. Its members throw IoError.
class TemporaryFolder {
 public:
  /// `target` may be a link to a folder: that is then replaced.
  explicit TemporaryFolder(const std::filesystem::path& target);
  ~TemporaryFolder();
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;

  const std::filesystem::path& path() const { return path_; }

  /// Flushes to disk and takes the target's place. A folder that is there is removed once the new
  /// one has its name.
  void commit();

 private:
  void exchange();

  std::filesystem::path target_;
  std::filesystem::path path_;
  std::optional<InterruptRemoval> removal_;
};

}  // namespace cadmorph
