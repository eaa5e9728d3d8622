#include "cad/match_side.h"

#include <BRepAlgoAPI_Cut.hxx>
#include <BRepAlgoAPI_Fuse.hxx>
#include <BRepPrimAPI_MakeBox.hxx>
#include <BRepPrimAPI_MakeCone.hxx>
#include <BRepPrimAPI_MakeCylinder.hxx>
#include <BRepPrimAPI_MakeSphere.hxx>
#include <BRepPrimAPI_MakeTorus.hxx>
#include <TopExp_Explorer.hxx>
#include <algorithm>
#include <catch2/catch.hpp>
#include <gp_Ax2.hxx>
#include <map>

#include "cad_variants.h"

using namespace cadmorph;
using namespace cadmorph::testing;
using Eigen::Vector3d;

namespace {

constexpr std::uint64_t kNone = 0, kOutside = 1, kInside = 2;  // see face_bulges

gp_Ax2 up_from(double x, double y, double z) { return {gp_Pnt(x, y, z), gp_Dir(0, 0, 1)}; }

/// A block with a hole at x = 10 and a pin at x = 30.
TopoDS_Shape hole_and_pin(double radius) {
  const TopoDS_Shape block = BRepPrimAPI_MakeBox(40, 20, 10).Solid();
  const TopoDS_Shape drilled =
      BRepAlgoAPI_Cut(block, BRepPrimAPI_MakeCylinder(up_from(10, 10, -1), radius, 12).Solid());
  return BRepAlgoAPI_Fuse(drilled,
                          BRepPrimAPI_MakeCylinder(up_from(30, 10, 5), radius, 15).Solid());
}

std::map<std::uint64_t, int> counts(const std::vector<std::uint64_t>& values) {
  std::map<std::uint64_t, int> result;
  for (const std::uint64_t value : values) ++result[value];
  return result;
}

/// Forms of the uses alone, sorted.
std::vector<std::uint64_t> forms(const TopoDS_Shape& shape) {
  std::vector<std::uint64_t> all = make_match_side(to_model(shape), {}).forms;
  std::ranges::sort(all);
  return all;
}

}  // namespace

TEST_CASE("walls of pins bulge to the outside, those of holes to the inside, others nowhere",
          "[cad][side]") {
  for (const bool is_nurbs : {false, true}) {
    INFO(is_nurbs);
    const TopoDS_Shape shape = hole_and_pin(3);
    const CadModel model = to_model(is_nurbs ? to_nurbs(shape) : shape);
    const auto bulges = face_bulges(model);
    const auto features = entity_features(model);
    REQUIRE(bulges.size() == 9);
    CHECK(counts(bulges) == std::map<std::uint64_t, int>{{kNone, 7}, {kOutside, 1}, {kInside, 1}});
    const auto at = [&](std::uint64_t bulge) {
      return features[std::ranges::find(bulges, bulge) - bulges.begin()].centre;
    };
    CHECK((at(kInside) - Vector3d(10, 10, 5)).norm() < 0.1);
    CHECK((at(kOutside) - Vector3d(30, 10, 15)).norm() < 0.1);
  }
}

TEST_CASE("balls and rings bulge to the outside, hollows of their shape to the inside",
          "[cad][side]") {
  const TopoDS_Shape ball = BRepPrimAPI_MakeSphere(gp_Pnt(0, 0, 0), 4).Solid(),
                     ring = BRepPrimAPI_MakeTorus(6, 2).Solid(),
                     block = BRepPrimAPI_MakeBox(gp_Pnt(-10, -10, -10), 20, 20, 20).Solid();
  for (const TopoDS_Shape& shape : {ball, ring}) {
    CHECK(face_bulges(to_model(shape)) == std::vector{kOutside});
    const auto hollow = face_bulges(to_model(BRepAlgoAPI_Cut(block, shape)));
    CHECK(counts(hollow) == std::map<std::uint64_t, int>{{kNone, 6}, {kInside, 1}});
  }
}

TEST_CASE("a cone that is more of a disk bulges nowhere, a steep one as a pin", "[cad][side]") {
  // The normals' mean is 5 / sqrt(5^2 + h^2), to the parts 0.98 and 0.45 along the axis.
  for (const auto& [height, bulge] : {std::pair(1.0, kNone), {10.0, kOutside}}) {
    const CadModel model = to_model(BRepPrimAPI_MakeCone(5, 0, height).Solid());
    for (const FaceId f : model.faces().ids())
      if (model.faces()[f].type == SurfaceType::Cone) CHECK(face_bulges(model)[f] == bulge);
  }
}

TEST_CASE("faces of no solid bulge nowhere", "[cad][side]") {
  const TopoDS_Shape ring = BRepPrimAPI_MakeTorus(6, 2).Solid();
  CHECK(face_bulges(to_model(TopExp_Explorer(ring, TopAbs_SHELL).Current())) == std::vector{kNone});
}

TEST_CASE("forms are those of the part wherever it lies, however large, in any order",
          "[cad][side]") {
  const TopoDS_Shape part = hole_and_pin(3);
  const auto expected = forms(part);
  CHECK(forms(transformed(part, similarity(1.1, 1, {5, -7, 20}))) == expected);
  CHECK(forms(transformed(part, similarity(-2.0, 25.4, {0, 3, 1}))) == expected);
  const ShuffleOptions reversed{.has_reversed_edges = true, .probability = 1};
  CHECK(forms(shuffle(part, reversed).shape) == expected);
  for (const unsigned seed : {1, 2}) CHECK(forms(shuffle(part, {.seed = seed}).shape) == expected);
  CHECK(forms(hole_and_pin(3.2)) != expected);
}

TEST_CASE("faces of a type have its form, those of free forms none", "[cad][side]") {
  const CadModel model = to_model(hole_and_pin(3));
  const MatchSide side = make_match_side(model, {});
  for (const FaceId f : model.faces().ids())
    for (const FaceId g : model.faces().ids())
      CHECK((side.forms[f] == side.forms[g]) == (model.faces()[f].type == model.faces()[g].type));
  const CadModel free = to_model(to_nurbs(hole_and_pin(3)));
  for (const FaceId f : free.faces().ids()) CHECK(make_match_side(free, {}).forms[f] == 0);
}

TEST_CASE("entities are described by number, kind and place", "[cad][side]") {
  const CadModel model = to_model(BRepPrimAPI_MakeBox(2, 4, 6).Solid());
  const MatchSide side = make_match_side(model, {});
  const auto node_at = [&](const Vector3d& x) {
    const auto is_there = [&](const EntityFeature& f) { return (f.centre - x).norm() < 1e-6; };
    return static_cast<int>(std::ranges::find_if(side.features, is_there) - side.features.begin());
  };
  const int face = node_at({1, 2, 6}), edge = node_at({1, 4, 6}), corner = node_at({0, 4, 6});
  CHECK(describe(side, face) == "face " + std::to_string(face + 1) + " (plane at 1 2 6 mm)");
  CHECK(describe(side, edge) == "edge " + std::to_string(edge - 5) + " (length 2 mm at 1 4 6 mm)");
  CHECK(describe(side, corner) == "vertex " + std::to_string(corner - 17) + " (point at 0 4 6 mm)");
}
