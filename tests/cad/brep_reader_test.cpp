#include "cad/brep_reader.h"

#include <BRepBuilderAPI_MakeEdge.hxx>
#include <BRepPrimAPI_MakeBox.hxx>
#include <BRepPrimAPI_MakeCone.hxx>
#include <BRepTools.hxx>
#include <BinTools.hxx>
#include <catch2/catch.hpp>
#include <fstream>
#include <sstream>

#include "cad/step_reader.h"
#include "cad_variants.h"
#include "core/errors.h"

using namespace cadmorph;
using namespace cadmorph::testing;
using Catch::Matchers::Contains;

namespace {

std::string as_text(const TopoDS_Shape& shape) {
  std::ostringstream out;
  BRepTools::Write(shape, out);
  return out.str();
}

std::string as_binary(const TopoDS_Shape& shape) {
  std::ostringstream out;
  BinTools::Write(shape, out);
  return out.str();
}

TopoDS_Shape cone() { return BRepPrimAPI_MakeCone(10, 4, 20).Shape(); }

// Reads bytes that may be damaged: a model or a CadError, nothing else.
bool is_read(const std::string& bytes) {
  try {
    return !read_brep(bytes, "damaged").faces().empty();
  } catch (const CadError&) {
    return false;
  }
}

}  // namespace

TEST_CASE("a shape in memory is read as text and binary", "[cad][brep]") {
  for (const std::string& bytes : {as_text(cone()), as_binary(cone())}) {
    const CadModel model = read_brep(bytes, "cone");
    CHECK(model.faces().size() == 3);
    CHECK(model.solid_count() == 1);
    CHECK(model.file_name() == "cone");
    CHECK(model.upper().z() == Approx(20));
    // OCCT writes 15 digits of the radius.
    CHECK(model.upper().x() == Approx(10).epsilon(1e-12));
    CHECK_THAT(model.file_unit(), Contains("milli"));
  }
}

TEST_CASE("bytes that are no BREP say so", "[cad][brep]") {
  CHECK_THROWS_WITH(read_brep("", "part"), Contains("part: no BREP data"));
  CHECK_THROWS_WITH(read_brep("ISO-10303-21;", "part"), Contains("no BREP data"));
  const TopoDS_Shape edge = BRepBuilderAPI_MakeEdge(gp_Pnt(0, 0, 0), gp_Pnt(1, 0, 0)).Shape();
  CHECK_THROWS_AS(read_brep(as_text(edge), "edge"), CadError);
}

TEST_CASE("damaged BREP is a CadError, or still a model", "[cad][brep]") {
  for (const std::string& whole : {as_text(cone()), as_binary(cone())}) {
    CHECK(is_read(whole));
    int refused = 0;
    constexpr int kParts = 40;
    for (int part = 0; part < kParts; ++part)
      refused += !is_read(whole.substr(0, whole.size() * part / kParts));
    CHECK(refused > kParts / 2);
    for (std::size_t at = 0; at < whole.size(); at += whole.size() / 97) {
      std::string damaged = whole;
      damaged[at] = static_cast<char>(damaged[at] ^ 0x15);
      is_read(damaged);
    }
  }
}

TEST_CASE("STEP bytes give to the bit the model of the file", "[cad][step]") {
  const std::string name = model_file("shapes/bracket.step").string();
  std::ostringstream bytes;
  bytes << std::ifstream(name, std::ios::binary).rdbuf();
  const CadModel file = read_step(name), memory = read_step_bytes(bytes.str(), "memory");
  REQUIRE(memory.faces().size() == file.faces().size());
  CHECK(memory.lower() == file.lower());
  CHECK(memory.upper() == file.upper());
  for (const FaceId f : file.faces().ids()) {
    const Eigen::Vector2d middle = 0.5 * (file.faces()[f].lower + file.faces()[f].upper);
    CHECK(memory.faces()[f].name == file.faces()[f].name);
    CHECK(memory.evaluate(FaceId(f), middle).point == file.evaluate(FaceId(f), middle).point);
  }
}
