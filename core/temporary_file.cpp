#include "core/temporary_file.h"

#include <fcntl.h>
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

}  // namespace

TemporaryFile::TemporaryFile(const fs::path& target) : target_(resolve(target)) {
  static std::atomic<int> counter = 0;
  const auto folder = target_.has_parent_path() ? target_.parent_path() : fs::path(".");
  // A process of the same number, killed or on another machine, may have left or use the name.
  do {
    path_ = folder /
            (".cadmorph-" + std::to_string(getpid()) + "-" + std::to_string(counter++) + ".tmp");
    file_ = open(path_.c_str(), O_CREAT | O_EXCL | O_WRONLY | O_CLOEXEC, 0666);
  } while (file_ < 0 && errno == EEXIST);
  if (file_ < 0) fail(target_, std::strerror(errno));
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

}  // namespace cadmorph
