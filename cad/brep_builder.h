#pragma once

#include <functional>
#include <string>

#include "cad/brep.h"

class TopoDS_Shape;
class TopoDS_Face;

namespace cadmorph {

/// Where a shape came from.
struct ShapeSource {
  std::string file_name;
  std::string file_unit;
  std::function<std::string(const TopoDS_Face&)> face_name;  ///< may be empty
  int merged_faces = 0;                                      ///< see CadModel::merged_face_count
};

/// Turns an OCCT shape into a CadModel: unique faces, edges and vertices in the shape's own order,
/// pcurves by wire occurrence. Throws CadError when the shape holds no usable face.
CadModel build_model(const TopoDS_Shape& shape, const ShapeSource& source);

}  // namespace cadmorph
