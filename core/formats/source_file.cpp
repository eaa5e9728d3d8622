#include "core/formats/source_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>
#include <zlib.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstring>
#include <limits>
#include <memory>
#include <optional>
#include <ranges>

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

constexpr std::size_t kWhole = std::numeric_limits<std::size_t>::max();

/// The bytes of a file.
FileBytes read_plain(const fs::path& path) {
  const int file = open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (file < 0) fail_reading(path, std::strerror(errno));
  const std::unique_ptr<const int, void (*)(const int*)> closer(&file,
                                                                [](const int* f) { close(*f); });
  struct stat status {};
  if (fstat(file, &status) != 0) fail_reading(path, std::strerror(errno));
  if (S_ISDIR(status.st_mode)) fail_reading(path, "it is a folder");
  FileBytes bytes{std::size_t(status.st_size)};
  std::atomic<Index> end =
      std::ssize(std::string_view(bytes));  // nearer when the file gets shorter
  constexpr Index kPiece = 1 << 23;  // a thread's: milliseconds, far more than its call costs
  parallel_for(end, kPiece, [&](Index at, Index piece_end) {
    while (at < piece_end) {
      const ssize_t got = pread(file, bytes.data() + at, std::size_t(piece_end - at), at);
      if (got < 0 && errno == EINTR) continue;
      if (got < 0) fail_reading(path, std::strerror(errno));
      at += got;
      if (got > 0) continue;
      for (Index known = end; at < known && !end.compare_exchange_weak(known, at);) continue;
      return;
    }
  });
  bytes.cut(std::size_t(end.load()));
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

[[noreturn]] void fail_changed(const fs::path& path) {
  fail_reading(path, "it has changed while it was in use; run again");
}

class NoReplacement : public Replacement {
  std::uint64_t last_cut(std::uint64_t /*begin*/, std::uint64_t end) const override { return end; }
  void append(std::uint64_t /*place*/, std::string_view bytes, std::string& copy) const override {
    copy += bytes;
  }
};

}  // namespace

bool are_one_file(const fs::path& a, const fs::path& b) {
  std::error_code error;
  return fs::equivalent(a, b, error);
}

SourceBytes read_source(const fs::path& path) {
  SourceBytes result;
  result.source.path = path;
  result.bytes = read_plain(path);
  result.source.is_compressed = is_gzip(result.bytes);
  if (result.source.is_compressed) {
    const std::string text = read_through_zlib(path, kWhole);
    result.bytes = FileBytes(text.size());
    std::ranges::copy(text, result.bytes.data());
  }
  result.source.hash = content_hash(result.bytes);
  return result;
}

FileBytes read_again(const SourceFile& source) {
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

Index ReplacedText::first_part_from(std::uint64_t at) const {
  const auto parts = std::views::iota(Index{0}, count());
  return std::ranges::partition_point(parts, [&](Index p) { return place(p).place < at; }) -
         parts.begin();
}

std::uint64_t ReplacedText::last_cut(std::uint64_t /*begin*/, std::uint64_t end) const {
  const Index next = first_part_from(end);
  if (next == 0) return end;
  const TextToken last = place(next - 1);
  return last.place + last.length > end ? last.place : end;
}

void ReplacedText::append(std::uint64_t at, std::string_view bytes, std::string& copy) const {
  std::size_t from = 0;
  const Index parts = count();
  for (Index part = first_part_from(at); part < parts; ++part) {
    const TextToken token = place(part);
    if (token.place >= at + bytes.size()) break;
    const auto begin = std::size_t(token.place - at);
    copy.append(bytes, from, begin - from);
    write(part, bytes.substr(begin, token.length), copy);
    from = begin + token.length;
  }
  copy.append(bytes, from);
}

bool is_copy_compressed(const SourceFile& source, const fs::path& target) {
  const auto is_named = [](const fs::path& path) { return path.extension() == ".gz"; };
  return is_named(target) || (source.is_compressed && !is_named(source.path));
}

void write_replaced(const SourceFile& source, const Replacement& parts, const fs::path& target,
                    const std::function<void()>& accept) {
  constexpr std::size_t kPiece = 1 << 20;  // so that no file has to fit into memory
  struct Piece {
    std::uint64_t at = 0;  ///< in the file
    std::string bytes, copy;
  };
  SourceReader reader(source.path);
  PieceWriter writer(target, is_copy_compressed(source, target));
  ContentHasher hasher;
  std::vector<Piece> pieces(std::size_t(2 * thread_count() + 2));
  std::string cut_off;  // the beginning of the next piece
  std::uint64_t at = 0;
  const auto read = [&](Index slot) {
    Piece& piece = pieces[std::size_t(slot)];
    piece.at = at;
    piece.bytes = cut_off;
    const bool goes_on = reader.append(kPiece, piece.bytes);
    hasher.add(std::string_view(piece.bytes).substr(cut_off.size()));
    const std::size_t end = piece.bytes.size();
    const auto size = goes_on ? std::size_t(parts.last_cut(at, at + end) - at) : end;
    cut_off.assign(piece.bytes, size);
    piece.bytes.resize(size);
    at += size;
    return end > 0;
  };
  const auto replace = [&](Index slot) {
    Piece& piece = pieces[std::size_t(slot)];
    piece.copy.clear();
    parts.append(piece.at, piece.bytes, piece.copy);
  };
  const auto write = [&](Index slot) { writer.put(pieces[std::size_t(slot)].copy); };
  parallel_pipeline(std::ssize(pieces), read, replace, write);
  if (hasher.hash() != source.hash) fail_changed(source.path);
  accept();
  writer.commit();
}

void write_unchanged(const SourceFile& source, const fs::path& target) {
  if (!source.is_compressed || !is_copy_compressed(source, target))
    return write_replaced(source, NoReplacement(), target);
  read_again(source);
  write_pieces(target, {read_plain(source.path)}, false);
}

}  // namespace cadmorph
