#pragma once

#include <algorithm>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "core/formats/text_scanner.h"

namespace cadmorph {

/// Bytes whose memory is not set to zero before they are read: that costs as much as the reading.
class FileBytes {
 public:
  FileBytes() = default;
  explicit FileBytes(std::size_t size)
      : data_(std::make_unique_for_overwrite<char[]>(size)), size_(size) {}

  char* data() { return data_.get(); }
  const char* data() const { return data_.get(); }
  std::size_t size() const { return size_; }
  void cut(std::size_t size) { size_ = std::min(size_, size); }
  operator std::string_view() const { return {data_.get(), size_}; }

 private:
  std::unique_ptr<char[]> data_;
  std::size_t size_ = 0;
};

/// A file that was read and is to be copied later: what tells that it is still the same.
struct SourceFile {
  std::filesystem::path path;
  bool is_compressed = false;  ///< gzip
  std::string hash;            ///< of its (uncompressed) bytes
};

/// Whether two paths lead to one file; false where one is missing.
bool are_one_file(const std::filesystem::path& a, const std::filesystem::path& b);

/// The bytes of a file, uncompressed where it is a gzip file.
struct SourceBytes {
  FileBytes bytes;
  SourceFile source;
};

/// Reads a whole file. Throws IoError when it is missing, a folder, can't be read or is a damaged
/// gzip file.
SourceBytes read_source(const std::filesystem::path& path);

/// Reads it again. Throws IoError when it has changed since.
FileBytes read_again(const SourceFile& source);

/// The first `size` bytes of a file, uncompressed. Throws as read_source.
std::string read_start(const std::filesystem::path& path, std::size_t size);

/// Writes a file of one or several pieces whole or not at all, compressed where `is_compressed`.
/// Throws IoError.
void write_pieces(const std::filesystem::path& target, const std::vector<std::string_view>& pieces,
                  bool is_compressed);

/// What a copy has in place of parts of a file. Several threads call it.
class Replacement {
 public:
  virtual ~Replacement() = default;

  /// The last place of [begin, end] in the file that lies inside of no part.
  virtual std::uint64_t last_cut(std::uint64_t begin, std::uint64_t end) const = 0;
  /// Appends the copy of `bytes`, which stand at `place` and cut no part.
  virtual void append(std::uint64_t place, std::string_view bytes, std::string& copy) const = 0;
};

/// Parts of a text, in the order of the file.
class ReplacedText : public Replacement {
 public:
  virtual Index count() const = 0;
  virtual TextToken place(Index part) const = 0;
  /// Appends what stands there instead of `old_text`, or that.
  virtual void write(Index part, std::string_view old_text, std::string& text) const = 0;

  std::uint64_t last_cut(std::uint64_t begin, std::uint64_t end) const final;
  void append(std::uint64_t place, std::string_view bytes, std::string& copy) const final;

 private:
  Index first_part_from(std::uint64_t place) const;
};

/// Whether a copy is a gzip file: where its name says so, or the original is one by another name.
bool is_copy_compressed(const SourceFile& source, const std::filesystem::path& target);

/// Writes a copy in which those parts are replaced. Calls `accept` before it appears; leaves
/// nothing behind where that throws. Throws IoError, leaving nothing behind, also when the file has
/// changed since. Memory: some ten MB, whatever the file.
void write_replaced(
    const SourceFile& source, const Replacement& parts, const std::filesystem::path& target,
    const std::function<void()>& accept = [] {});

/// Writes a copy with the same bytes. Throws IoError, also when the file has changed since.
void write_unchanged(const SourceFile& source, const std::filesystem::path& target);

}  // namespace cadmorph
