#pragma once

#include <filesystem>

#include "volume/deformation_field.h"

namespace cadmorph {

/// Format of field files written; others are refused.
constexpr unsigned kFieldFormat = 1;

/// Writes a deformation to a file, whole or not at all: a line that names the format, its version,
/// the size and the XXH3 checksum of what follows, then all numbers bit by bit (docs/field.md).
/// Throws IoError.
void write_field(const std::filesystem::path& path, const DeformationTerms& terms);

/// Reads such a file. Throws IoError when it is missing, no field file, of another format version,
/// truncated or damaged.
DeformationTerms read_field(const std::filesystem::path& path);

}  // namespace cadmorph
