#include <catch2/catch.hpp>

#include "cad/topology_match.h"
#include "morph_case.h"
#include "surface_parts.h"
#include "triangulation.h"

using namespace cadmorph;
using namespace cadmorph::testing;

namespace {

// Distance from a trimmed face that counts as on it, of these meshes: millimetres.
constexpr double kUnnoticed = 1e-2;

}  // namespace

TEST_CASE("a hole that moves far leaves no fold unreported", "[surface][fold]") {
  for (const double to : {20.0, 30.0, 45.0, 50.0}) {
    DYNAMIC_SECTION("to " << to) {
      const TopoDS_Shape base = drilled_plate(60, 60, 10, 6, {{15, 15}});
      const MorphCase c =
          mesh_case(to_model(base), split_triangles(split_triangles(triangulate(base, 0.02, 0.2))));
      const TopoDS_Shape shape = drilled_plate(60, 60, 10, 8, {{to, to}});
      const CadModel variant = to_model(shape);
      const TopologyMatch match = match_topology(*c.base, variant);
      SurfaceMorphOptions options;
      options.snap = true;
      const auto result = SurfaceMorph(c.base, c.mesh, c.boundary, options).morph(variant, match);
      const OnCad judged = judge(c, result.positions, match, variant, shape);
      CAPTURE(judged.folded, judged.farthest);
      // A node may leave the trimmed face only with a word about it.
      CHECK((judged.folded == 0 || !result.folded_facets.empty()));
      CHECK((judged.farthest <= 1e-6 || !result.beyond_wires.isZero(0)));
      CHECK(result.distance.maxCoeff() == Approx(judged.farthest).margin(kUnnoticed));
      CHECK(judged.folded == 0);
    }
  }
}

TEST_CASE("what a face took to be mapped without a fold is no warning", "[surface][fold]") {
  const TopoDS_Shape base = drilled_plate(60, 60, 10, 6, {{15, 15}});
  const MorphCase c =
      mesh_case(to_model(base), split_triangles(split_triangles(triangulate(base, 0.02, 0.2))));
  std::size_t remedies = 0;
  for (const double to : {20.0, 25.0, 30.0, 35.0, 40.0}) {
    const SurfaceMorphResult result =
        morph_surface(c, to_model(drilled_plate(60, 60, 10, 8, {{to, to}})));
    for (const auto& [what, faces] : result.remedies) {
      CAPTURE(to, what);
      CHECK_FALSE(faces.empty());
      ++remedies;
    }
    for (const std::string& warning : result.warnings)
      CHECK_THAT(warning, !Catch::Matchers::Contains("wires"));
  }
  CHECK(remedies > 0);
}
