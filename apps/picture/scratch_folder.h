#pragma once

#include <filesystem>

namespace cadmorph {

/// A new folder below the system's one for temporary files; gone, with all in it, when the object
/// is.
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
};

}  // namespace cadmorph
