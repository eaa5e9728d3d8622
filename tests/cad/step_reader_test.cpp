#include "cad/step_reader.h"

#include <BRepAlgoAPI_Common.hxx>
#include <BRepBuilderAPI_MakeEdge.hxx>
#include <BRepPrimAPI_MakeBox.hxx>
#include <BRepPrimAPI_MakeCone.hxx>
#include <catch2/catch.hpp>
#include <fstream>
#include <sstream>

#include "cad_variants.h"
#include "core/errors.h"
#include "warped_shape.h"

using namespace cadmorph;
using namespace cadmorph::testing;
using Catch::Matchers::Contains;

namespace {

std::string text_of(const std::string& name) {
  std::ifstream in(model_file(name), std::ios::binary);
  std::stringstream text;
  text << in.rdbuf();
  return text.str();
}

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  for (std::size_t at = text.find(from); at != std::string::npos;
       at = text.find(from, at + to.size()))
    text.replace(at, from.size(), to);
  return text;
}

CadModel read_text(const std::string& text) {
  const TemporaryFile file(".step");
  std::ofstream(file.path(), std::ios::binary) << text;
  return read_step(file.path());
}

std::string error_of(const std::string& text) {
  try {
    read_text(text);
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

}  // namespace

TEST_CASE("a missing STEP file, or a folder, can't be read", "[cad][step][errors]") {
  const TemporaryFile nothing(".step");
  CHECK_THROWS_AS(read_step(nothing.path()), IoError);
  CHECK_THROWS_WITH(read_step(nothing.path()), Contains(nothing.path().filename().string()));
  CHECK_THROWS_AS(read_step(std::filesystem::temp_directory_path()), IoError);
}

TEST_CASE("what is no STEP file is refused", "[cad][step][errors]") {
  CHECK_THROWS_AS(read_text(""), CadError);
  CHECK_THROWS_AS(read_text("solid cube\nfacet normal 0 0 1\n"), CadError);
  CHECK_THROWS_AS(read_text(std::string(5000, '\0')), CadError);
  CHECK_THAT(error_of("garbage"), Contains(".step"));
  CHECK_THAT(error_of("PK\x03\x04 a .stpz"), Contains("Unpack it"));
}

TEST_CASE("a byte order mark before a STEP file is passed over", "[cad][step]") {
  const std::string marked = "\xef\xbb\xbf" + text_of("shapes/box.step");
  CHECK(read_text(marked).faces().size() == 6);
  CHECK(read_step_bytes(marked, "marked").faces().size() == 6);
}

TEST_CASE("a truncated STEP file is refused wherever it ends", "[cad][step][errors]") {
  const std::string whole = text_of("shapes/bracket.step");
  for (const double part : {0.05, 0.3, 0.5, 0.9, 0.999}) {
    CAPTURE(part);
    const auto size = static_cast<std::size_t>(part * static_cast<double>(whole.size()));
    CHECK_THROWS_AS(read_text(whole.substr(0, size)), CadError);
  }
  CHECK_NOTHROW(read_text(whole));
}

TEST_CASE("a STEP file with lost entities is refused", "[cad][step][errors]") {
  // Its frame is right, some of its entities are gone: the solid can't be complete.
  const std::string whole = text_of("shapes/box.step");
  const std::size_t from = whole.find("ADVANCED_FACE");
  REQUIRE(from != std::string::npos);
  const std::size_t data_end = whole.find("ENDSEC", from);
  CHECK_THROWS_AS(read_text(whole.substr(0, from) + whole.substr(data_end)), CadError);
}

TEST_CASE("a STEP file with unknown entities is refused", "[cad][step][errors]") {
  const std::string whole = text_of("shapes/box.step");
  CHECK_THROWS_AS(read_text(replaced(whole, "CARTESIAN_POINT", "CARTESIAN_PLANT")), CadError);
}

TEST_CASE("points and directions that make no sense are refused before OCCT uses them",
          "[cad][step][errors]") {
  const std::string whole = text_of("shapes/box.step");
  const std::string beyond = "beyond 2^53", unread = "can't be read";
  const std::vector<std::pair<std::string, std::string>> numbers = {
      {"1.E308", beyond}, {"-1.E16", beyond}, {"1.E999", beyond}, {"-1e16", unread},
      {"nan", unread},    {"$", unread},      {"#1", unread}};
  int count = 0;
  for (const std::string entity : {"CARTESIAN_POINT('',(", "DIRECTION('',("})
    for (std::size_t at = whole.find(entity); at != std::string::npos;
         at = whole.find(entity, at + 1)) {
      const std::size_t from = at + entity.size(), to = whole.find_first_of(",)", from);
      const auto& [number, why] = numbers[count++ % numbers.size()];
      CAPTURE(whole.substr(at, to - at), number);
      CHECK_THAT(error_of(whole.substr(0, from) + number + whole.substr(to)),
                 Contains("entity #") && Contains(why));
    }
  CHECK(count > 100);
}

TEST_CASE("lengths that make no sense are refused before OCCT uses them", "[cad][step][errors]") {
  int count = 0;
  for (const std::string shape : {"cylinder", "cone_frustum", "sphere", "torus"}) {
    const std::string whole = text_of("shapes/" + shape + ".step");
    for (const std::string entity : {"CIRCLE('',#", "_SURFACE('',#", "VECTOR('',#"}) {
      const std::size_t at = whole.find(entity);
      if (at == std::string::npos) continue;
      const std::size_t from = whole.find(',', at + entity.size()) + 1;
      const std::size_t to = whole.find_first_of(",)", from);
      CAPTURE(whole.substr(at, to - at));
      CHECK_THAT(error_of(whole.substr(0, from) + "1.E308" + whole.substr(to)),
                 Contains("entity #") && Contains("beyond 2^53"));
      ++count;
    }
  }
  CHECK(count == 10);
}

TEST_CASE("a STEP file without a shape is refused", "[cad][step][errors]") {
  const std::string whole = text_of("shapes/box.step");
  const std::size_t data = whole.find("DATA;") + 5, end = whole.find("ENDSEC", data);
  CHECK_THROWS_AS(read_text(whole.substr(0, data) + "\n" + whole.substr(end)), CadError);
}

TEST_CASE("a STEP file with curves alone is refused", "[cad][step][errors]") {
  const TemporaryFile file(".step");
  write_step(file.path(), BRepBuilderAPI_MakeEdge(gp_Pnt(0, 0, 0), gp_Pnt(1, 2, 3)).Edge());
  CHECK_THROWS_AS(read_step(file.path()), CadError);
}

TEST_CASE("lengths come in millimetres whatever the file's unit", "[cad][step][unit]") {
  const std::string millimetres = text_of("shapes/box.step");
  const CadModel box = read_text(millimetres);
  CHECK_THAT(box.file_unit(), Contains("milli", Catch::CaseSensitive::No));
  CHECK((box.upper() - box.lower() - Eigen::Vector3d(40, 30, 20)).norm() < 1e-9);

  const std::string milli = "SI_UNIT(.MILLI.,.METRE.)";
  REQUIRE(millimetres.find(milli) != std::string::npos);
  const CadModel large = read_text(replaced(millimetres, milli, "SI_UNIT($,.METRE.)"));
  CHECK((large.upper() - large.lower() - 1000 * Eigen::Vector3d(40, 30, 20)).norm() < 1e-6);
  CHECK(large.file_unit() != box.file_unit());
  CHECK_THAT(large.file_unit(), Contains("metre", Catch::CaseSensitive::No));
  CHECK_THAT(large.file_unit(), !Contains("milli", Catch::CaseSensitive::No));
}

TEST_CASE("a part is read though OCCT fails on the pcurves of its file", "[cad][step]") {
  // A plane that cuts a cone along a hyperbola, bent into splines: only the pcurve is a hyperbola.
  const TemporaryFile file(".step");
  write_step(file.path(), BRepAlgoAPI_Common(
                              BRepPrimAPI_MakeCone(20, 5, 30).Shape(),
                              BRepPrimAPI_MakeBox(gp_Pnt(-30, -30, -5), gp_Pnt(8, 30, 40)).Shape())
                              .Shape());
  const TopoDS_Shape cut = read_shape(file.path());
  const CadModel bent = through_step(warped(cut, [](const Eigen::Vector3d& x) -> Eigen::Vector3d {
    return {x.x() + 0.001 * x.z() * x.z(), x.y(), x.z()};
  }));
  CHECK(bent.faces().size() == to_model(cut).faces().size());
  CHECK(bent.solid_count() == 1);
}

TEST_CASE("the order of faces is that of OCCT's own map, time and again", "[cad][step]") {
  const auto path = model_file("shapes/bracket.step");
  const FaceOracle oracle(read_shape(path));
  for (int repeat = 0; repeat < 2; ++repeat) {
    const CadModel model = read_step(path);
    REQUIRE(static_cast<int>(model.faces().size()) == oracle.face_count());
    for (int f = 0; f < oracle.face_count(); ++f) {
      const Eigen::Vector2d uv =
          0.5 * (model.faces()[FaceId(f)].lower + model.faces()[FaceId(f)].upper);
      CHECK((model.evaluate(FaceId(f), uv).point - oracle.point(f, uv)).norm() < 1e-12);
    }
  }
}
