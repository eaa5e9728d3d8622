#pragma once

#include <filesystem>
#include <string>
#include <string_view>

namespace cadmorph {

/// 128-bit hash (XXH3) of bytes, as 32 hexadecimal digits: tells whether contents are the same; no
/// protection against forgery.
std::string content_hash(std::string_view bytes);

/// The hash of a file's bytes. Throws IoError.
std::string file_hash(const std::filesystem::path& path);

}  // namespace cadmorph
