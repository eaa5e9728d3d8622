#include "cad/step_reader.h"

#define OCC_CONVERT_SIGNALS  // as OCCT itself is built: makes OCC_CATCH_SIGNALS work

#include <Interface_Static.hxx>
#include <Message.hxx>
#include <Message_Messenger.hxx>
#include <NCollection_DataMap.hxx>
#include <STEPControl_Reader.hxx>
#include <Standard_ErrorHandler.hxx>
#include <Standard_Failure.hxx>
#include <StepData_StepModel.hxx>
#include <StepGeom_CartesianPoint.hxx>
#include <StepGeom_Circle.hxx>
#include <StepGeom_ConicalSurface.hxx>
#include <StepGeom_CylindricalSurface.hxx>
#include <StepGeom_Direction.hxx>
#include <StepGeom_Ellipse.hxx>
#include <StepGeom_Hyperbola.hxx>
#include <StepGeom_Parabola.hxx>
#include <StepGeom_SphericalSurface.hxx>
#include <StepGeom_ToroidalSurface.hxx>
#include <StepGeom_Vector.hxx>
#include <StepRepr_RepresentationItem.hxx>
#include <TColStd_SequenceOfAsciiString.hxx>
#include <TCollection_HAsciiString.hxx>
#include <TopTools_OrientedShapeMapHasher.hxx>
#include <TopTools_ShapeMapHasher.hxx>
#include <TopoDS_Face.hxx>
#include <TransferBRep.hxx>
#include <Transfer_TransientProcess.hxx>
#include <XSControl_TransferReader.hxx>
#include <XSControl_WorkSession.hxx>
#include <algorithm>
#include <cmath>
#include <fstream>
#include <functional>
#include <memory>
#include <optional>
#include <sstream>
#include <vector>

#include "cad/brep_builder.h"
#include "cad/fault_guard.h"
#include "cad/healing.h"
#include "cad/packed_model.h"
#include "core/byte_order_mark.h"
#include "core/errors.h"

namespace cadmorph {
namespace {

constexpr std::string_view kStart = "ISO-10303-21";
constexpr std::string_view kEnd = "END-ISO-10303-21";
constexpr std::streamoff kEndSearch = 4096;  // room for comments and blank lines after the end

std::string read_part(std::ifstream& in, std::streamoff from, std::streamoff count) {
  std::string part(static_cast<std::size_t>(count), '\0');
  in.seekg(from);
  in.read(part.data(), count);
  part.resize(static_cast<std::size_t>(in.gcount()));
  in.clear();
  return part;
}

// Whether the pcurves are those of the file, or made anew from the 3D curves. OCCT fails on some
// that the files hold: hyperbolas over a range for which they are not meant.
enum PcurveMode { kFilesPcurves = 0, kOwnPcurves = 3 };

// A STEP file: on disk, or in memory where there are bytes.
struct StepSource {
  std::string name;
  std::optional<std::string_view> bytes = {};
};

// Reads it behind a byte-order mark, which OCCT takes for a syntax error.
IFSelect_ReturnStatus read_source(STEPControl_Reader& reader, const StepSource& source) {
  if (source.bytes) {
    std::istringstream in{std::string(source.bytes->substr(byte_order_mark_size(*source.bytes)))};
    return reader.ReadStream(source.name.c_str(), in);
  }
  std::ifstream file(source.name, std::ios::binary);
  const std::size_t mark = byte_order_mark_size(read_part(file, 0, 3));
  if (mark == 0) return reader.ReadFile(source.name.c_str());
  return reader.ReadStream(source.name.c_str(), file.seekg(std::streamoff(mark)));
}

// From 2^53 on doubles lie more than a whole unit apart: nothing has its place there, and OCCT,
// which steps along a curve to such a point by the curve's period, comes to no end.
constexpr double kSenselessNumber = 9007199254740992;

using Numbers = std::optional<std::vector<double>>;

template <class Entity, class... Get>
void take(const Handle(Standard_Transient) & entity, Numbers& numbers, Get... get) {
  if (const auto typed = Handle(Entity)::DownCast(entity); !typed.IsNull())
    numbers = {std::invoke(get, *typed)...};
}

// Coordinates, directions and lengths; nothing for other entities.
Numbers numbers_of(const Handle(Standard_Transient) & entity) {
  Numbers numbers;
  if (const auto point = Handle(StepGeom_CartesianPoint)::DownCast(entity); !point.IsNull()) {
    numbers.emplace();
    for (int i = 1; i <= point->NbCoordinates(); ++i)
      numbers->push_back(point->CoordinatesValue(i));
  } else if (const auto direction = Handle(StepGeom_Direction)::DownCast(entity);
             !direction.IsNull()) {
    numbers.emplace();
    if (!direction->DirectionRatios().IsNull())
      for (const double ratio : *direction->DirectionRatios()) numbers->push_back(ratio);
  }
  take<StepGeom_Vector>(entity, numbers, &StepGeom_Vector::Magnitude);
  take<StepGeom_Circle>(entity, numbers, &StepGeom_Circle::Radius);
  take<StepGeom_Ellipse>(entity, numbers, &StepGeom_Ellipse::SemiAxis1,
                         &StepGeom_Ellipse::SemiAxis2);
  take<StepGeom_Hyperbola>(entity, numbers, &StepGeom_Hyperbola::SemiAxis,
                           &StepGeom_Hyperbola::SemiImagAxis);
  take<StepGeom_Parabola>(entity, numbers, &StepGeom_Parabola::FocalDist);
  take<StepGeom_CylindricalSurface>(entity, numbers, &StepGeom_CylindricalSurface::Radius);
  take<StepGeom_ConicalSurface>(entity, numbers, &StepGeom_ConicalSurface::Radius);
  take<StepGeom_SphericalSurface>(entity, numbers, &StepGeom_SphericalSurface::Radius);
  take<StepGeom_ToroidalSurface>(entity, numbers, &StepGeom_ToroidalSurface::MajorRadius,
                                 &StepGeom_ToroidalSurface::MinorRadius);
  return numbers;
}

// OCCT goes on with infinite coordinates, or none, where it can't read numbers.
void check_numbers(const STEPControl_Reader& reader, const std::string& name) {
  const auto model = reader.StepModel();
  for (int i = 1; i <= model->NbEntities(); ++i) {
    const Numbers numbers = numbers_of(model->Value(i));
    if (!numbers) continue;
    const auto refuse = [&](const std::string& why) {
      throw CadError(name + ": entity " + model->StringLabel(model->Value(i))->ToCString() + " " +
                     why + ": the file is damaged. Export the part again.");
    };
    if (model->IsErrorEntity(i) || numbers->empty()) refuse("has numbers that can't be read");
    for (const double number : *numbers)
      if (!(std::abs(number) < kSenselessNumber))
        refuse("has a number beyond 2^53, where nothing has a place");
  }
}

std::unique_ptr<STEPControl_Reader> read_and_transfer(const StepSource& source, PcurveMode mode) {
  auto reader = std::make_unique<STEPControl_Reader>();
  Interface_Static::SetCVal("xstep.cascade.unit", "MM");
  Interface_Static::SetIVal("read.surfacecurve.mode", mode);
  if (read_source(*reader, source) != IFSelect_RetDone)
    throw CadError(source.name +
                   ": the STEP reader rejects it (syntax error or damaged data). Export the "
                   "part again.");
  check_numbers(*reader, source.name);
  reader->TransferRoots();
  return reader;
}

int failed_roots(STEPControl_Reader& reader) {
  return reader.NbRootsForTransfer() - reader.NbShapes();
}

std::string why_nothing(STEPControl_Reader& reader) {
  if (reader.NbRootsForTransfer() == 0)
    return "holds no shape. The DATA section is empty or has only drawings; export the solid or "
           "the surfaces.";
  return "OCCT can't translate what it holds. Check the part in the CAD program for "
         "self-intersections and open shells, and export it again as AP203 or AP242.";
}

std::string length_units(STEPControl_Reader& reader) {
  TColStd_SequenceOfAsciiString lengths, angles, solid_angles;
  reader.FileUnits(lengths, angles, solid_angles);
  std::string units;
  for (const auto& unit : lengths)
    units += (units.empty() ? "" : ", ") + std::string(unit.ToCString());
  return units.empty() ? "unknown" : units;
}

/// Names of faces: those of the entities they came from. As XSControl_TransferReader's
/// EntityFromShapeResult finds them, which takes a pass over all entities for each face.
class FaceNames {
 public:
  explicit FaceNames(const Handle(Transfer_TransientProcess) & process) {
    for (int i = 1; i <= process->NbMapped(); ++i) {
      const auto& entity = process->Mapped(i);
      const TopoDS_Shape shape = TransferBRep::ShapeResult(process, entity);
      if (shape.IsNull() || shape.ShapeType() != TopAbs_FACE) continue;
      if (!oriented_.IsBound(shape)) oriented_.Bind(shape, entity);
      any_.Bind(shape, entity);
    }
  }

  std::string operator()(const TopoDS_Face& face) const {
    const auto* entity = oriented_.Seek(face);
    if (!entity) entity = any_.Seek(face);
    if (!entity) return {};
    const auto item = Handle(StepRepr_RepresentationItem)::DownCast(*entity);
    if (item.IsNull() || item->Name().IsNull()) return {};
    return item->Name()->ToCString();
  }

 private:
  NCollection_DataMap<TopoDS_Shape, Handle(Standard_Transient), TopTools_OrientedShapeMapHasher>
      oriented_;
  NCollection_DataMap<TopoDS_Shape, Handle(Standard_Transient), TopTools_ShapeMapHasher> any_;
};

// OCCT reads a file that was cut short without complaint; the frame of ISO 10303-21 tells.
void check_frame(const std::string& name, std::string_view start, std::string_view end) {
  if (start.starts_with("PK\x03\x04") || start.starts_with("\x1f\x8b"))
    throw CadError(name + ": packed (zip or gzip). Unpack it first.");
  if (start.find(kStart) == std::string_view::npos)
    throw CadError(name +
                   ": not a STEP file (no ISO-10303-21 header). Export the part as STEP "
                   "AP203, AP214 or AP242.");
  if (end.find(kEnd) == std::string_view::npos)
    throw CadError(name +
                   ": truncated (no END-ISO-10303-21 at its end). The export or the copy was "
                   "interrupted; write the file again.");
}

std::string pack_step(const StepSource& source) {
  Message::DefaultMessenger()->ChangePrinters().Clear();
  const std::string& name = source.name;
  const FaultGuard guard;
  const QuickHealing healing;
  try {
    OCC_CATCH_SIGNALS
    auto reader = read_and_transfer(source, kFilesPcurves);
    if (failed_roots(*reader) > 0) {
      auto other = read_and_transfer(source, kOwnPcurves);
      if (failed_roots(*other) < failed_roots(*reader)) reader = std::move(other);
    }
    const TopoDS_Shape shape = reader->OneShape();
    if (shape.IsNull()) throw CadError(name + ": " + why_nothing(*reader));
    const FaceNames names(reader->WS()->TransferReader()->TransientProcess());
    return pack_shape(shape, {name, length_units(*reader), std::cref(names)});
  } catch (const Standard_Failure& failure) {
    throw_as_error(failure, name + ": it can't be read", "Export the part again.");
  }
}

}  // namespace

bool is_step_file(const std::filesystem::path& path) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error)) return false;
  std::ifstream in(path, std::ios::binary | std::ios::ate);
  if (!in) return false;
  const auto piece = std::min<std::streamoff>(in.tellg(), kEndSearch);
  return read_part(in, 0, piece).find(kStart) != std::string::npos;
}

void check_step_file(const std::filesystem::path& path) {
  const std::string name = path.string();
  std::error_code unreadable;
  if (!std::filesystem::exists(path, unreadable))
    throw IoError(name + (unreadable ? ": can't be reached (" + unreadable.message() + ")."
                                     : ": no such file. Check the path of the STEP file."));
  if (std::filesystem::is_directory(path, unreadable))
    throw IoError(name + " is a folder, not a STEP file.");
  // A pipe can be read once only, and may keep whoever opens it.
  if (!std::filesystem::is_regular_file(path, unreadable)) return;
  std::ifstream in(path, std::ios::binary | std::ios::ate);
  if (!in) throw IoError(name + ": can't be opened. Check its permissions.");
  const std::streamoff size = in.tellg();
  const auto piece = std::min<std::streamoff>(size, kEndSearch);
  check_frame(name, read_part(in, 0, piece), read_part(in, size - piece, piece));
}

std::string read_step_packed(const std::filesystem::path& path) {
  check_step_file(path);
  return pack_step({path.string()});
}

CadModel read_step(const std::filesystem::path& path) {
  return unpack_model(read_step_packed(path));
}

CadModel read_step_bytes(std::string_view bytes, const std::string& name) {
  const auto piece = std::min<std::size_t>(bytes.size(), kEndSearch);
  check_frame(name, bytes.substr(0, piece), bytes.substr(bytes.size() - piece));
  return unpack_model(pack_step({name, bytes}));
}

}  // namespace cadmorph
