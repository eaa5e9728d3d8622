#pragma once

#include <string>
#include <string_view>

#include "cad/brep.h"

class TopoDS_Shape;

namespace cadmorph {

struct ShapeSource;

/// Packs a shape, its names and its source into bytes, for another process of the same version of
/// this program. Throws CadError for geometry that OCCT can't write.
std::string pack_shape(const TopoDS_Shape& shape, const ShapeSource& source);

/// Builds the model of a packed shape. OCCT normalises directions when it unpacks them, so the last
/// bits differ from those of the shape that was packed. Thread-safe. Throws CadError when the bytes
/// are damaged, and what build_model throws.
CadModel unpack_model(std::string_view bytes);

}  // namespace cadmorph
