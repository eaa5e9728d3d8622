#pragma once

#include <filesystem>

#include "cad/brep.h"

namespace cadmorph {

/// Reads a STEP file (AP203, AP214, AP242) into millimetres. Not thread-safe: OCCT's STEP reader is
/// global. Throws IoError when the file is missing, CadError when it is truncated, no STEP, or
/// holds no face.
CadModel read_step(const std::filesystem::path& path);

}  // namespace cadmorph
