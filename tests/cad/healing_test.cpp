#include "cad/healing.h"

#include <BRepAlgoAPI_Cut.hxx>
#include <BRepPrimAPI_MakeBox.hxx>
#include <BRepPrimAPI_MakeCylinder.hxx>
#include <BRepTools.hxx>
#include <STEPControl_Reader.hxx>
#include <TopTools_ListOfShape.hxx>
#include <catch2/catch.hpp>
#include <optional>
#include <sstream>

#include "cad_variants.h"

using namespace cadmorph;
using namespace cadmorph::testing;

namespace {

// All of the shape that OCCT makes of the file: places, curves in space and on faces, tolerances.
std::string shape_of(const std::filesystem::path& path, bool is_quick) {
  std::optional<QuickHealing> healing;
  if (is_quick) healing.emplace();
  STEPControl_Reader reader;
  REQUIRE(reader.ReadFile(path.c_str()) == IFSelect_RetDone);
  reader.TransferRoots();
  std::ostringstream text;
  BRepTools::Write(reader.OneShape(), text);
  return text.str();
}

TopoDS_Shape plate_with_holes() {
  BRepPrimAPI_MakeBox plate(60, 60, 5);
  TopTools_ListOfShape arguments, tools;
  arguments.Append(plate.Shape());
  for (int i = 0; i < 25; ++i) {
    const gp_Pnt centre(6 + 12 * (i % 5), 6 + 12 * (i / 5), -1);
    tools.Append(BRepPrimAPI_MakeCylinder(gp_Ax2(centre, gp::DZ()), 3, 7).Shape());
  }
  BRepAlgoAPI_Cut cut;
  cut.SetArguments(arguments);
  cut.SetTools(tools);
  cut.Build();
  return cut.Shape();
}

}  // namespace

TEST_CASE("healing with a memory comes to the same shape", "[cad][step]") {
  const TemporaryFile plate(".step");
  write_step(plate.path(), plate_with_holes());
  const auto check = [](const std::filesystem::path& path) {
    INFO(path);
    const std::string plain = shape_of(path, false);
    CHECK(plain.size() > 500);
    CHECK(shape_of(path, true) == plain);
    CHECK(shape_of(path, false) == plain);
  };
  check(plate.path());
  // In these three healing replaces something.
  for (const char* name : {"pipe/base.step", "shapes/stepped_shaft.step", "shapes/torus.step"})
    check(model_file(name));
}
