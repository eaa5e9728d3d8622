#include "cad/brep_reader.h"

#define OCC_CONVERT_SIGNALS  // as OCCT itself is built: makes OCC_CATCH_SIGNALS work

#include <BRepTools.hxx>
#include <BRep_Builder.hxx>
#include <BinTools.hxx>
#include <Message.hxx>
#include <Message_Messenger.hxx>
#include <Standard_ErrorHandler.hxx>
#include <Standard_Failure.hxx>
#include <TopoDS_Shape.hxx>
#include <sstream>

#include "cad/brep_builder.h"
#include "cad/fault_guard.h"
#include "cad/packed_model.h"
#include "core/errors.h"

namespace cadmorph {
namespace {

constexpr std::string_view kText = "CASCADE Topology V", kBinary = "Open CASCADE Topology V";
constexpr std::size_t kStartSearch = 256;  // a comment may stand before

constexpr const char *kDamaged = ": the BREP data are damaged or cut short",
                     *kHandOver = "Hand over all bytes of the export.";

[[noreturn]] void fail_damaged(const std::string& name) {
  throw CadError(name + kDamaged + ". " + kHandOver);
}

TopoDS_Shape read_shape(std::string_view bytes, const std::string& name) {
  const std::string_view start = bytes.substr(0, kStartSearch);
  const bool is_binary = start.find(kBinary) != std::string_view::npos;
  if (!is_binary && start.find(kText) == std::string_view::npos)
    throw CadError(name +
                   ": no BREP data (they begin with 'CASCADE Topology' or 'Open CASCADE "
                   "Topology'). In FreeCAD shape.exportBrepToString() makes them.");
  std::istringstream in{std::string(bytes)};
  // OCCT reads on after the end, a wrong number of times.
  in.exceptions(std::ios::failbit | std::ios::badbit);
  TopoDS_Shape shape;
  if (is_binary)
    BinTools::Read(shape, in);
  else
    BRepTools::Read(shape, in, BRep_Builder());
  if (shape.IsNull()) fail_damaged(name);
  return shape;
}

}  // namespace

CadModel read_brep(std::string_view bytes, const std::string& name) {
  Message::DefaultMessenger()->ChangePrinters().Clear();
  const FaultGuard guard;
  try {
    OCC_CATCH_SIGNALS
    return unpack_model(pack_shape(read_shape(bytes, name), {name, "millimetre", {}}));
  } catch (const std::ios::failure&) {
    fail_damaged(name);
  } catch (const Standard_Failure& failure) {
    throw_as_error(failure, name + kDamaged, kHandOver);
  }
}

}  // namespace cadmorph
