#include "core/temporary_file.h"

#include <fcntl.h>
#include <stdio.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstring>
#include <string>
#include <utility>

#include "core/errors.h"

namespace fs = std::filesystem;

namespace cadmorph {
namespace {

constexpr int kMaxLinks = 40;  // as Linux follows

[[noreturn]] void fail(const fs::path& target, const std::string& why) {
  throw IoError("can't write " + target.string() + ": " + why);
}

// The last target of a link, which need not be there yet.
fs::path follow_links(const fs::path& target) {
  std::error_code error;
  fs::path path = target;
  for (int links = 0; fs::is_symlink(fs::symlink_status(path, error)); ++links) {
    if (links == kMaxLinks) fail(target, std::strerror(ELOOP));
    path = path.parent_path() / fs::read_symlink(path, error);
    if (error) fail(target, error.message());
  }
  return path;
}

fs::path resolve(const fs::path& target) {
  std::error_code error;
  const auto status = fs::status(target, error);
  if (fs::is_directory(status)) fail(target, "it is a folder");
  if (fs::exists(status) && !fs::is_regular_file(status)) fail(target, "it is no regular file");
  return follow_links(target);
}

fs::path resolve_folder(const fs::path& target) {
  std::error_code error;
  const auto status = fs::status(target, error);
  if (fs::exists(status) && !fs::is_directory(status))
    fail(target, "there is a file of that name, but it is to be a folder");
  fs::path path = follow_links(target);
  return path.has_filename() ? path : path.parent_path();  // "case/"
}

fs::path folder_of(const fs::path& target) {
  return target.has_parent_path() ? target.parent_path() : fs::path(".");
}

/// Calls create(path) with names beside the target until it makes one that was not there; false
/// (and errno) when it fails.
template <class Create>
bool create_beside(const fs::path& target, fs::path& path, Create create) {
  static std::atomic<int> counter = 0;
  // A process of the same number, killed or on another machine, may have left or use the name.
  do {
    path = folder_of(target) /
           (".cadmorph-" + std::to_string(getpid()) + "-" + std::to_string(counter++) + ".tmp");
    if (create(path)) return true;
  } while (errno == EEXIST || errno == ENOTEMPTY);
  return false;
}

/// Flushes a file or folder to disk.
void flush(const fs::path& path, const fs::path& target) {
  const int file = open(path.c_str(), O_RDONLY | O_CLOEXEC);
  const bool is_flushed = file >= 0 && fsync(file) == 0;
  const int error = errno;
  if (file >= 0) close(file);
  if (!is_flushed) fail(target, std::strerror(error));
}

void flush_all(const fs::path& folder, const fs::path& target) {
  flush(folder, target);
  try {
    for (const auto& entry : fs::recursive_directory_iterator(folder))
      if (!entry.is_symlink()) flush(entry.path(), target);
  } catch (const fs::filesystem_error& error) {
    fail(target, error.code().message());
  }
}

}  // namespace

TemporaryFile::TemporaryFile(const fs::path& target) : target_(resolve(target)) {
  const auto create = [&](const fs::path& path) {
    file_ = open(path.c_str(), O_CREAT | O_EXCL | O_WRONLY | O_CLOEXEC, 0666);
    return file_ >= 0;
  };
  if (!create_beside(target_, path_, create)) fail(target_, std::strerror(errno));
  removal_.emplace(path_);
  // Who may read the file that was there may read the new one; where that can't be, the user's own
  // rule for new files holds.
  struct stat old {};
  if (stat(target_.c_str(), &old) == 0) (void)fchmod(file_, old.st_mode & 07777);
}

TemporaryFile::~TemporaryFile() {
  if (file_ >= 0) close(file_);
  if (!path_.empty()) unlink(path_.c_str());
}

void TemporaryFile::write(const char* data, std::size_t size, off_t place) {
  while (size > 0) {
    const ssize_t written = pwrite(file_, data, size, place);
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) fail(target_, std::strerror(errno));
    data += written;
    size -= static_cast<std::size_t>(written);
    place += written;
  }
}

void TemporaryFile::commit() {
  if (fsync(file_) != 0) fail(target_, std::strerror(errno));
  const int closed = close(std::exchange(file_, -1));
  if (closed != 0) fail(target_, std::strerror(errno));
  if (rename(path_.c_str(), target_.c_str()) != 0) fail(target_, std::strerror(errno));
  path_.clear();
}

TemporaryFolder::TemporaryFolder(const fs::path& target) : target_(resolve_folder(target)) {
  const auto create = [](const fs::path& path) { return mkdir(path.c_str(), 0777) == 0; };
  if (!create_beside(target_, path_, create)) fail(target_, std::strerror(errno));
  removal_.emplace(path_);
}

TemporaryFolder::~TemporaryFolder() {
  std::error_code error;
  if (!path_.empty()) fs::remove_all(path_, error);
}

void TemporaryFolder::commit() {
  flush_all(path_, target_);
  if (rename(path_.c_str(), target_.c_str()) == 0) {
    path_.clear();
    return;
  }
  if (errno != ENOTEMPTY && errno != EEXIST) fail(target_, std::strerror(errno));
  exchange();
  std::error_code error;
  fs::remove_all(std::exchange(path_, fs::path()), error);
}

/// Afterwards the folder that was there has the temporary name, by which it is removed.
void TemporaryFolder::exchange() {
  if (renameat2(AT_FDCWD, path_.c_str(), AT_FDCWD, target_.c_str(), RENAME_EXCHANGE) == 0) return;
  // Some network file systems can't exchange.
  if (errno != EINVAL && errno != ENOSYS) fail(target_, std::strerror(errno));
  fs::path old;
  const auto move_away = [&](const fs::path& path) {
    return rename(target_.c_str(), path.c_str()) == 0;
  };
  if (!create_beside(target_, old, move_away)) fail(target_, std::strerror(errno));
  if (rename(path_.c_str(), target_.c_str()) != 0) {
    const int error = errno;
    rename(old.c_str(), target_.c_str());
    fail(target_, std::strerror(error));
  }
  path_ = old;
}

}  // namespace cadmorph
