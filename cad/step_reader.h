#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "cad/brep.h"

namespace cadmorph {

/// Reads a STEP file (AP203, AP214, AP242) into millimetres. Not thread-safe: OCCT's STEP reader is
/// global. Throws IoError when the file is missing, CadError when it is truncated, no STEP, or
/// holds no face.
CadModel read_step(const std::filesystem::path& path);

/// Reads a STEP file as read_step does, for unpack_model in another process, which then has the
/// same model to the bit: read_step itself is unpack_model of this.
std::string read_step_packed(const std::filesystem::path& path);

/// Reads a STEP file that lies in memory, to the bit as read_step reads it from disk; `name` stands
/// for the file's in messages. Throws CadError as that does.
CadModel read_step_bytes(std::string_view bytes, const std::string& name);

/// Whether a file begins as STEP files do; false for one that can't be read.
bool is_step_file(const std::filesystem::path& path);

/// Throws what read_step would for a file that is missing, truncated or no STEP at all, by a look
/// at its first and last bytes; nothing of a pipe that is there.
void check_step_file(const std::filesystem::path& path);

}  // namespace cadmorph
