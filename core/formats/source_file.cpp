#include "core/formats/source_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>
#include <zlib.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <limits>
#include <memory>

#include "core/content_hash.h"
#include "core/errors.h"
#include "core/formats/mesh_format.h"
#include "core/temporary_file.h"

namespace fs = std::filesystem;

namespace cadmorph {
namespace {

bool is_gzip(std::string_view bytes) { return bytes.starts_with("\x1f\x8b"); }

// zlib's counts are 32 bits wide.
constexpr std::size_t kLargestBlock = std::size_t{1} << 30;

/// Reads up to `size` bytes; a plain file as it is.
std::string read_through_zlib(const fs::path& path, std::size_t size) {
  const std::unique_ptr<gzFile_s, int (*)(gzFile)> file(gzopen(path.c_str(), "rbe"), gzclose);
  if (!file) fail_reading(path, std::strerror(errno));
  gzbuffer(file.get(), 1 << 18);
  std::string bytes;
  for (std::size_t block = 1 << 22; bytes.size() < size;) {
    const std::size_t begin = bytes.size();
    bytes.resize(std::min(size, begin + block));
    const int got = gzread(file.get(), bytes.data() + begin, unsigned(bytes.size() - begin));
    bytes.resize(begin + std::size_t(std::max(got, 0)));
    int code = Z_OK;
    const char* message = gzerror(file.get(), &code);
    if (got < 0 || code == Z_BUF_ERROR)
      fail_reading(path, "it is damaged or cut off (" + std::string(message) + ")");
    if (got == 0) break;
    block = std::min(kLargestBlock, 2 * block);
  }
  return bytes;
}

std::string read_plain(const fs::path& path) {
  const int file = open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (file < 0) fail_reading(path, std::strerror(errno));
  const std::unique_ptr<const int, void (*)(const int*)> closer(&file,
                                                                [](const int* f) { close(*f); });
  struct stat status {};
  if (fstat(file, &status) != 0) fail_reading(path, std::strerror(errno));
  if (S_ISDIR(status.st_mode)) fail_reading(path, "it is a folder");
  std::string bytes(std::size_t(status.st_size), '\0');
  std::size_t at = 0;
  while (at < bytes.size()) {
    const ssize_t got = ::read(file, bytes.data() + at, std::min(kLargestBlock, bytes.size() - at));
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) fail_reading(path, std::strerror(errno));
    if (got == 0) break;
    at += std::size_t(got);
  }
  bytes.resize(at);
  return bytes;
}

/// Bytes into a gzip file, piece after piece.
class Deflater {
 public:
  Deflater(TemporaryFile& file, const fs::path& target) : file_(file), target_(target) {
    constexpr int kGzip = 15 + 16;  // largest window, gzip's own header
    if (deflateInit2(&stream_, Z_DEFAULT_COMPRESSION, Z_DEFLATED, kGzip, 8, Z_DEFAULT_STRATEGY) !=
        Z_OK)
      fail_writing(target, "zlib has no memory");
  }
  ~Deflater() { deflateEnd(&stream_); }
  Deflater(const Deflater&) = delete;
  Deflater& operator=(const Deflater&) = delete;

  void put(std::string_view bytes) {
    while (!bytes.empty()) {
      const std::size_t size = std::min(bytes.size(), kLargestBlock);
      run(bytes.substr(0, size), Z_NO_FLUSH);
      bytes.remove_prefix(size);
    }
  }
  void finish() { run({}, Z_FINISH); }

 private:
  void run(std::string_view bytes, int flush) {
    stream_.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data()));
    stream_.avail_in = unsigned(bytes.size());
    do {
      stream_.next_out = reinterpret_cast<Bytef*>(buffer_.data());
      stream_.avail_out = unsigned(buffer_.size());
      if (deflate(&stream_, flush) == Z_STREAM_ERROR) fail_writing(target_, "zlib failed");
      const std::size_t size = buffer_.size() - stream_.avail_out;
      file_.write(buffer_.data(), size, place_);
      place_ += off_t(size);
    } while (stream_.avail_out == 0);
  }

  TemporaryFile& file_;
  const fs::path& target_;
  z_stream stream_{};
  std::string buffer_ = std::string(1 << 20, '\0');
  off_t place_ = 0;
};

}  // namespace

SourceBytes read_source(const fs::path& path) {
  SourceBytes result;
  result.source.path = path;
  result.bytes = read_plain(path);
  result.source.is_compressed = is_gzip(result.bytes);
  if (result.source.is_compressed)
    result.bytes = read_through_zlib(path, std::numeric_limits<std::size_t>::max());
  result.source.hash = content_hash(result.bytes);
  return result;
}

std::string read_again(const SourceFile& source) {
  SourceBytes again = read_source(source.path);
  if (again.source.hash != source.hash)
    fail_reading(source.path, "it has changed while it was in use; run again");
  return std::move(again.bytes);
}

std::string read_start(const fs::path& path, std::size_t size) {
  std::error_code error;
  const auto status = fs::status(path, error);
  if (!fs::exists(status)) fail_reading(path, "there is no such file");
  if (fs::is_directory(status)) fail_reading(path, "it is a folder");
  return read_through_zlib(path, size);
}

void write_pieces(const fs::path& target, const std::vector<std::string_view>& pieces,
                  bool is_compressed) {
  TemporaryFile file(target);
  if (is_compressed) {
    Deflater deflater(file, target);
    for (const std::string_view piece : pieces) deflater.put(piece);
    deflater.finish();
  } else {
    off_t place = 0;
    for (const std::string_view piece : pieces) {
      file.write(piece.data(), piece.size(), place);
      place += off_t(piece.size());
    }
  }
  file.commit();
}

void write_unchanged(const SourceFile& source, const fs::path& target) {
  read_again(source);
  write_pieces(target, {read_plain(source.path)}, false);
}

}  // namespace cadmorph
