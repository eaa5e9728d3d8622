#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "core/formats/text_scanner.h"

namespace cadmorph {

/// A file that was read and is to be copied later: what tells that it is still the same.
struct SourceFile {
  std::filesystem::path path;
  bool is_compressed = false;  ///< gzip
  std::string hash;            ///< of its (uncompressed) bytes
};

/// The bytes of a file, uncompressed where it is a gzip file.
struct SourceBytes {
  std::string bytes;
  SourceFile source;
};

/// Reads a whole file. Throws IoError when it is missing, a folder, can't be read or is a damaged
/// gzip file.
SourceBytes read_source(const std::filesystem::path& path);

/// Reads it again. Throws IoError when it has changed since.
std::string read_again(const SourceFile& source);

/// The first `size` bytes of a file, uncompressed. Throws as read_source.
std::string read_start(const std::filesystem::path& path, std::size_t size);

/// Writes a file of one or several pieces whole or not at all, compressed where `is_compressed`.
/// Throws IoError.
void write_pieces(const std::filesystem::path& target, const std::vector<std::string_view>& pieces,
                  bool is_compressed);

/// Parts of a file that a copy has other text for, in the order of the file.
class ReplacedText {
 public:
  virtual ~ReplacedText() = default;

  virtual Index count() const = 0;
  virtual TextToken place(Index part) const = 0;
  /// Appends what stands there instead of `old_text`, or that. Called by several threads.
  virtual void write(Index part, std::string_view old_text, std::string& text) const = 0;
};

/// Writes a copy in which those parts are replaced. Throws IoError, leaving nothing behind, also
/// when the file has changed since. Memory: some ten MB, whatever the file.
void write_replaced(const SourceFile& source, const ReplacedText& parts,
                    const std::filesystem::path& target);

/// Writes a copy with the same bytes. Throws IoError, also when the file has changed since.
void write_unchanged(const SourceFile& source, const std::filesystem::path& target);

}  // namespace cadmorph
