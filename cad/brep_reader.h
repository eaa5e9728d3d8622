#pragma once

#include <string>
#include <string_view>

#include "cad/brep.h"

namespace cadmorph {

/// Reads a shape in OCCT's BREP format, as text (BRepTools) or binary (BinTools), in which FreeCAD,
/// CadQuery and build123d hand over shapes. Lengths are taken for millimetres; `name` stands for a
/// file's in messages. Not thread-safe, as read_step. Throws CadError when the bytes are no BREP,
/// damaged, or hold no face.
CadModel read_brep(std::string_view bytes, const std::string& name);

}  // namespace cadmorph
