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
#include <optional>
#include <utility>

#include "core/content_hash.h"
#include "core/errors.h"
#include "core/formats/mesh_format.h"
#include "core/parallel.h"
#include "core/temporary_file.h"

namespace fs = std::filesystem;

namespace cadmorph {
namespace {

bool is_gzip(std::string_view bytes) { return bytes.starts_with("\x1f\x8b"); }

// zlib's counts are 32 bits wide.
constexpr std::size_t kLargestBlock = std::size_t{1} << 30;

/// Reads a file piece after piece, uncompressed where it is a gzip file.
class SourceReader {
 public:
  explicit SourceReader(const fs::path& path)
      : path_(path), file_(gzopen(path.c_str(), "rbe"), gzclose) {
    if (!file_) fail_reading(path, std::strerror(errno));
    gzbuffer(file_.get(), 1 << 18);
  }

  /// Appends up to `size` bytes; false at the end of the file.
  bool append(std::size_t size, std::string& bytes) {
    const std::size_t begin = bytes.size();
    bytes.resize(begin + std::min(size, kLargestBlock));
    const int got = gzread(file_.get(), bytes.data() + begin, unsigned(bytes.size() - begin));
    bytes.resize(begin + std::size_t(std::max(got, 0)));
    int code = Z_OK;
    const char* message = gzerror(file_.get(), &code);
    if (got < 0 || code == Z_BUF_ERROR)
      fail_reading(path_, "it is damaged or cut off (" + std::string(message) + ")");
    return got > 0;
  }

 private:
  const fs::path& path_;
  std::unique_ptr<gzFile_s, int (*)(gzFile)> file_;
};

/// Reads up to `size` bytes; a plain file as it is.
std::string read_through_zlib(const fs::path& path, std::size_t size) {
  SourceReader reader(path);
  std::string bytes;
  for (std::size_t block = 1 << 22; bytes.size() < size; block = std::min(kLargestBlock, 2 * block))
    if (!reader.append(std::min(block, size - bytes.size()), bytes)) break;
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

/// A file that is written piece after piece, compressed or not, and appears whole or not at all.
class PieceWriter {
 public:
  PieceWriter(const fs::path& target, bool is_compressed) : file_(target) {
    if (is_compressed) deflater_.emplace(file_, target);
  }

  void put(std::string_view piece) {
    if (deflater_) return deflater_->put(piece);
    file_.write(piece.data(), piece.size(), place_);
    place_ += off_t(piece.size());
  }
  void commit() {
    if (deflater_) deflater_->finish();
    file_.commit();
  }

 private:
  TemporaryFile file_;
  std::optional<Deflater> deflater_;
  off_t place_ = 0;
};

/// A piece of a file on its way to a copy.
struct CopiedPiece {
  std::string old_text, new_text;
  std::uint64_t at = 0;                ///< where it begins in the file
  Index first_part = 0, end_part = 0;  ///< that lie in it
};

void replace_parts(const ReplacedText& parts, CopiedPiece& piece) {
  const std::string_view old_text = piece.old_text;
  piece.new_text.clear();
  std::size_t from = 0;
  for (Index part = piece.first_part; part < piece.end_part; ++part) {
    const TextToken token = parts.place(part);
    const auto place = std::size_t(token.place - piece.at);
    piece.new_text.append(old_text, from, place - from);
    parts.write(part, old_text.substr(place, token.length), piece.new_text);
    from = place + token.length;
  }
  piece.new_text.append(old_text, from);
}

[[noreturn]] void fail_changed(const fs::path& path) {
  fail_reading(path, "it has changed while it was in use; run again");
}

class NoReplacedText : public ReplacedText {
  Index count() const override { return 0; }
  TextToken place(Index /*part*/) const override { return {}; }
  void write(Index /*part*/, std::string_view /*old_text*/, std::string& /*text*/) const override {}
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
  if (again.source.hash != source.hash) fail_changed(source.path);
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
  PieceWriter writer(target, is_compressed);
  for (const std::string_view piece : pieces) writer.put(piece);
  writer.commit();
}

void write_replaced(const SourceFile& source, const ReplacedText& parts, const fs::path& target) {
  constexpr std::size_t kPiece = 1 << 20;
  SourceReader reader(source.path);
  PieceWriter writer(target, source.is_compressed);
  ContentHasher hasher;
  std::vector<CopiedPiece> pieces(std::size_t(2 * thread_count() + 2));
  std::string rest;      // of a part that was cut off
  std::uint64_t at = 0;  // of the next piece in the file
  Index next = 0;
  const auto read = [&](Index slot) {
    CopiedPiece& piece = pieces[std::size_t(slot)];
    piece.old_text = std::exchange(rest, {});
    const std::size_t kept = piece.old_text.size();
    const bool goes_on = reader.append(kPiece, piece.old_text);
    hasher.add(std::string_view(piece.old_text).substr(kept));
    piece.at = at;
    piece.first_part = next;
    for (; next < parts.count(); ++next) {
      const TextToken token = parts.place(next);
      if (token.place + token.length <= at + piece.old_text.size()) continue;
      const std::uint64_t size = std::min<std::uint64_t>(token.place - at, piece.old_text.size());
      if (!goes_on) break;
      rest = piece.old_text.substr(std::size_t(size));
      piece.old_text.resize(std::size_t(size));
      break;
    }
    piece.end_part = next;
    at += piece.old_text.size();
    return goes_on || !piece.old_text.empty();
  };
  parallel_pipeline(
      std::ssize(pieces), read,
      [&](Index slot) { replace_parts(parts, pieces[std::size_t(slot)]); },
      [&](Index slot) { writer.put(pieces[std::size_t(slot)].new_text); });
  if (next < parts.count() || hasher.hash() != source.hash) fail_changed(source.path);
  writer.commit();
}

void write_unchanged(const SourceFile& source, const fs::path& target) {
  if (!source.is_compressed) return write_replaced(source, NoReplacedText(), target);
  read_again(source);
  write_pieces(target, {read_plain(source.path)}, false);
}

}  // namespace cadmorph
