#include "cad/packed_model.h"

#include <BRep_Builder.hxx>
#include <Geom_BezierSurface.hxx>
#include <Geom_OffsetSurface.hxx>
#include <TColgp_Array2OfPnt.hxx>
#include <TopoDS_Face.hxx>
#include <TopoDS_Shape.hxx>
#include <catch2/catch.hpp>

#include "cad/brep_builder.h"
#include "cad/step_reader.h"
#include "cad_variants.h"
#include "core/errors.h"

using namespace cadmorph;
using namespace cadmorph::testing;

namespace {

void check_same_topology(const CadModel& a, const CadModel& b) {
  REQUIRE(a.faces().size() == b.faces().size());
  REQUIRE(a.edges().size() == b.edges().size());
  REQUIRE(a.vertices().size() == b.vertices().size());
  REQUIRE(a.coedges().size() == b.coedges().size());
  CHECK(a.solid_count() == b.solid_count());
  for (const FaceId f : a.faces().ids()) {
    CHECK(a.faces()[f].wires == b.faces()[f].wires);
    CHECK(a.faces()[f].type == b.faces()[f].type);
    CHECK(a.faces()[f].is_reversed == b.faces()[f].is_reversed);
    CHECK(a.faces()[f].tolerance == b.faces()[f].tolerance);
  }
  for (const EdgeId e : a.edges().ids()) {
    CHECK(a.edges()[e].start == b.edges()[e].start);
    CHECK(a.edges()[e].end == b.edges()[e].end);
    CHECK(a.edges()[e].first == b.edges()[e].first);
    CHECK(a.edges()[e].last == b.edges()[e].last);
    CHECK(a.edges()[e].tolerance == b.edges()[e].tolerance);
  }
}

void check_same_geometry(const CadModel& a, const CadModel& b) {
  const double rounding = 1e-14 * a.diagonal();
  for (const FaceId f : a.faces().ids())
    for (const double s : {0.0, 0.3, 1.0}) {
      const CadFace& face = a.faces()[f];
      const Eigen::Vector2d uv = face.lower + s * (face.upper - face.lower);
      const int id = static_cast<int>(f);
      CHECK((a.evaluate(FaceId(id), uv).point - b.evaluate(FaceId(id), uv).point).norm() <
            10 * rounding);
    }
  for (const EdgeId e : a.edges().ids()) {
    const int id = static_cast<int>(e);
    const double t = 0.7 * a.edges()[e].first + 0.3 * a.edges()[e].last;
    CHECK((a.evaluate_edge(EdgeId(id), t).point - b.evaluate_edge(EdgeId(id), t).point).norm() <
          10 * rounding);
  }
}

}  // namespace

TEST_CASE("a surface that OCCT can't evaluate is a CadError", "[cad][packed]") {
  // The offset of a patch that is folded flat onto a line has no normal.
  TColgp_Array2OfPnt poles(1, 2, 1, 2);
  for (int i = 1; i <= 2; ++i)
    for (int j = 1; j <= 2; ++j) poles.SetValue(i, j, gp_Pnt(i + 2 * j, 0, 0));
  const Handle(Geom_Surface) flat = new Geom_BezierSurface(poles);
  TopoDS_Face face;
  BRep_Builder().MakeFace(face, new Geom_OffsetSurface(flat, 1), 1e-6);
  const std::string packed = pack_shape(face, {"flat.step", "mm", {}});
  CHECK_THROWS_AS(unpack_model(packed), CadError);
}

TEST_CASE("a packed model is the one that OCCT read", "[cad][packed]") {
  for (const std::string name : {"bore/step20", "pipe/step05", "shapes/two_blocks", "shapes/torus",
                                 "shapes/sphere", "shapes/blade", "shapes/cone"}) {
    INFO(name);
    const std::string path = model_file(name + ".step").string();
    const CadModel unpacked = unpack_model(read_step_packed(path));
    const CadModel direct = to_model(testing::read_shape(path));
    check_same_topology(unpacked, direct);
    check_same_geometry(unpacked, direct);
    CHECK(unpacked.file_name() == path);
  }
}

TEST_CASE("packing twice gives the same bytes", "[cad][packed]") {
  const std::string path = model_file("bore/base.step").string();
  CHECK(read_step_packed(path) == read_step_packed(path));
}

TEST_CASE("a packed model cut short is refused", "[cad][packed][errors]") {
  const std::string bytes = read_step_packed(model_file("shapes/box.step"));
  for (const std::size_t size :
       {std::size_t{0}, std::size_t{5}, bytes.size() / 2, bytes.size() - 1})
    CHECK_THROWS_AS(unpack_model(bytes.substr(0, size)), CadError);
  CHECK_THROWS_AS(unpack_model(bytes + "x"), CadError);
}
