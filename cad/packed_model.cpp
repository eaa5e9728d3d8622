#include "cad/packed_model.h"

#include <BinTools.hxx>
#include <Standard_Failure.hxx>
#include <TopExp.hxx>
#include <TopTools_IndexedMapOfShape.hxx>
#include <TopoDS.hxx>
#include <TopoDS_Face.hxx>
#include <TopoDS_Shape.hxx>
#include <algorithm>
#include <cstdint>
#include <sstream>
#include <vector>

#include "cad/brep_builder.h"
#include "cad/brep_impl.h"
#include "cad/fault_guard.h"
#include "core/errors.h"

namespace cadmorph {
namespace {

TopTools_IndexedMapOfShape faces_of(const TopoDS_Shape& shape) {
  TopTools_IndexedMapOfShape faces;
  TopExp::MapShapes(shape, TopAbs_FACE, faces);
  return faces;
}

void put_text(std::ostream& out, const std::string& text) {
  const auto size = static_cast<std::uint64_t>(text.size());
  out.write(reinterpret_cast<const char*>(&size), sizeof size);
  out.write(text.data(), static_cast<std::streamsize>(size));
}

// Takes from the front of `bytes`.
std::string take_text(std::string_view& bytes) {
  std::uint64_t size = 0;
  if (bytes.size() < sizeof size) throw CadError("a packed CAD model is cut short");
  std::copy_n(bytes.data(), sizeof size, reinterpret_cast<char*>(&size));
  bytes.remove_prefix(sizeof size);
  if (bytes.size() < size) throw CadError("a packed CAD model is cut short");
  const std::string text(bytes.substr(0, size));
  bytes.remove_prefix(size);
  return text;
}

std::string write_shape(const std::string& name, const TopoDS_Shape& shape) {
  std::ostringstream out;
  try {
    constexpr bool has_triangles = false, has_normals = false;
    BinTools::Write(shape, out, has_triangles, has_normals, BinTools_FormatVersion_CURRENT);
  } catch (const Standard_Failure& failure) {
    throw_as_error(failure, name + ": its geometry can't be packed", "Export the part again.");
  }
  return out.str();
}

TopoDS_Shape read_shape(const std::string& name, std::string_view bytes) {
  std::istringstream in{std::string(bytes)};
  TopoDS_Shape shape;
  try {
    BinTools::Read(shape, in);
  } catch (const Standard_Failure& failure) {
    throw_as_error(failure, name + ": the packed CAD model is damaged", "Make it again.");
  }
  if (shape.IsNull()) throw CadError(name + ": the packed CAD model is damaged");
  return shape;
}

}  // namespace

std::string pack_shape(const TopoDS_Shape& shape, const ShapeSource& source) {
  std::ostringstream out;
  put_text(out, write_shape(source.file_name, shape));
  put_text(out, source.file_name);
  put_text(out, source.file_unit);
  const TopTools_IndexedMapOfShape faces = faces_of(shape);
  for (int i = 1; i <= faces.Extent(); ++i)
    put_text(out, source.face_name ? source.face_name(TopoDS::Face(faces(i))) : "");
  return out.str();
}

CadModel unpack_model(std::string_view bytes) {
  const std::string geometry = take_text(bytes);
  const std::string file_name = take_text(bytes), file_unit = take_text(bytes);
  const TopoDS_Shape shape = read_shape(file_name, geometry);
  const TopTools_IndexedMapOfShape faces = faces_of(shape);
  std::vector<std::string> names(faces.Extent());
  for (std::string& name : names) name = take_text(bytes);
  if (!bytes.empty()) throw CadError(file_name + ": the packed CAD model has another face count");
  const auto name_of = [&](const TopoDS_Face& face) { return names[faces.FindIndex(face) - 1]; };
  return guarded(file_name, [&] { return build_model(shape, {file_name, file_unit, name_of}); });
}

}  // namespace cadmorph
