#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>

#include "cad/step_reader.h"
#include "core/quality.h"
#include "morph_case.h"
#include "volume/volume_morph.h"

using namespace cadmorph;
using namespace cadmorph::testing;

TEST_CASE("elements are as good with the fast solver as with the dense one",
          "[surface][families][fast]") {
  for (const std::string family : {"bore", "pipe"}) {
    INFO(family);
    const MorphCase c = file_case(family + "/base.step", family + "/hex.vtu");
    const Points surface =
        morph_surface(c, read_step(model_file(family + "/step20.step"))).positions;
    const Orientation orientation = detect_orientation(c.mesh);
    const auto quality = [&](SolverKind solver) {
      RbfReport report;
      const VolumeMorph morph(c.mesh, c.boundary.nodes, {.rbf = {.solver = solver}});
      const Points moved = morph.morph(surface, &report);
      REQUIRE(report.solver == solver);
      return measure_quality(c.mesh, moved, orientation);
    };
    const QualityReport dense = quality(SolverKind::Cholesky), fast = quality(SolverKind::Fast);
    REQUIRE(dense.values.size() == fast.values.size());
    double largest = 0;
    for (std::size_t i = 0; i < dense.values.size(); ++i)
      largest = std::max(largest, std::abs(dense.values[i] - fast.values[i]));
    CHECK(largest < 5e-4);  // three digits of every element
    CHECK(dense.inverted == fast.inverted);
  }
}

TEST_CASE("elements are as good with the adaptive solver as with all centres",
          "[surface][families][adaptive]") {
  for (const std::string family : {"bore", "pipe"})
    for (const std::string mesh : {"hex", "tet"}) {
      INFO(family << " " << mesh);
      const MorphCase c = file_case(family + "/base.step", family + "/" + mesh + ".vtu");
      const Points surface =
          morph_surface(c, read_step(model_file(family + "/step20.step"))).positions;
      const Orientation orientation = detect_orientation(c.mesh);
      const auto quality = [&](SolverKind solver) {
        const VolumeMorph morph(c.mesh, c.boundary.nodes, {.rbf = {.solver = solver}});
        const Points moved = morph.morph(surface);
        for (std::size_t i = 0; i < c.boundary.nodes.size(); ++i)
          REQUIRE(moved.row(c.boundary.nodes[i]) == surface.row(static_cast<Index>(i)));
        return measure_quality(c.mesh, moved, orientation);
      };
      const QualityReport all = quality(SolverKind::Fast), few = quality(SolverKind::Adaptive);
      CHECK(few.min > 0.95 * all.min);
      CHECK(few.mean > 0.995 * all.mean);
      CHECK(few.inverted == 0);
    }
}
