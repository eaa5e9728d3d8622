#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <string_view>

#include "core/archive.h"

namespace cadmorph {

/// What files of one kind begin with, and what is said of bad ones.
struct FileKind {
  std::string_view mark;  ///< its first line, the line's end included
  unsigned format;        ///< version of the contents; files of others are refused
  std::string name;       ///< "field file"
  std::string remedy;     ///< "make the field anew"
};

/// Writes a file, whole or not at all: its mark; the format, the size and the XXH3 checksum of what
/// follows; the contents. Throws IoError.
void write_checked_file(const std::filesystem::path& path, const FileKind& kind,
                        const std::function<void(OutputArchive&)>& contents);

/// Reads such a file; `contents` is called once the whole file is known to be as it was written.
/// Throws IoError when it is missing, of another kind or format, truncated or damaged.
void read_checked_file(const std::filesystem::path& path, const FileKind& kind,
                       const std::function<void(InputArchive&)>& contents);

}  // namespace cadmorph
