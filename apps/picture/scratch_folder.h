#pragma once

#include <filesystem>
#include <optional>

#include "core/interrupt.h"

namespace cadmorph {

/// A new folder below the system's one for temporary files; gone, with all in it, when the object
/// is, and at an interrupt.
class ScratchFolder {
 public:
  /// Throws OutputError when it can't be made.
  ScratchFolder();
  ~ScratchFolder();
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;

  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
  std::optional<InterruptRemoval> removal_;
};

}  // namespace cadmorph
