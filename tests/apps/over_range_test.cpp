#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>

#include "cad/projector.h"
#include "family_steps.h"

namespace cadmorph {
namespace {

using namespace testing;

// Beyond the parameter range: valid, or refused and explained.
void check_over_range(const std::string& family, const std::string& mesh, Outcome expected,
                      const PipelineOptions& options = {}, double change = 1.5) {
  INFO(family << ' ' << mesh);
  const MorphJob job = family_job(family, mesh, options);
  const MorphResult result = job.morph(family_cad(family, change));
  const Index invalid = invalid_cells(job.base().mesh(), result.positions);
  CHECK(result.report.outcome == expected);
  CHECK(result.report.after.invalid == invalid);
  if (expected == Outcome::Done) {
    CHECK(invalid == 0);
    CHECK(result.quality.inverted == 0);
    return;
  }
  CHECK(invalid > 0);
  REQUIRE(result.report.diagnosis);
  const Diagnosis& diagnosis = *result.report.diagnosis;
  CHECK(diagnosis.bad_cells >= invalid);
  CHECK(diagnosis.face >= 0);
  CHECK_FALSE(diagnosis.advice.empty());
  // A one-step morph of the share below the one named is valid, one of the share itself is not.
  PipelineOptions one_step;
  one_step.stepping.steps = 1;
  one_step.untangle = UntangleMode::Never;
  const MorphJob direct = family_job(family, mesh, one_step);
  const Points full = direct.morph(family_cad(family, change)).positions;
  const auto invalid_at = [&](double share) {
    return invalid_cells(job.base().mesh(),
                         job.base().mesh().points + share * (full - job.base().mesh().points));
  };
  CHECK(invalid_at(diagnosis.first_inversion - 0.011) == 0);
  CHECK(invalid_at(diagnosis.first_inversion) > 0);
}

}  // namespace

TEST_CASE("The bore's tetrahedra are valid at 150 % of the parameter range", "[apps][families]") {
  check_over_range("bore", "tet", Outcome::Done);
  check_over_range("bore", "tet_quadratic", Outcome::Done);
}

TEST_CASE("The pipe is valid at 150 % of the parameter range", "[apps][families]") {
  for (const std::string mesh : {"hex", "tet", "tet_quadratic"})
    check_over_range("pipe", mesh, Outcome::Done);
}

TEST_CASE("The bore's hexahedra at 220 % are refused as prescribed: surface nodes hold some",
          "[apps][families]") {
  PipelineOptions as_prescribed;
  as_prescribed.untangle = UntangleMode::Never;
  check_over_range("bore", "hex", Outcome::Inverted, as_prescribed, 2.2);
  const MorphJob job = family_job("bore", "hex", as_prescribed);
  const MorphResult result = job.morph(family_cad("bore", 2.2));
  REQUIRE(result.report.diagnosis);
  CHECK(result.report.diagnosis->held_cells > 0);
}

TEST_CASE("The bore's hexahedra are valid at 150 %: dented facets are laid out anew",
          "[apps][families]") {
  check_over_range("bore", "hex", Outcome::Done);
  PipelineOptions as_prescribed;
  as_prescribed.untangle = UntangleMode::Never;
  check_over_range("bore", "hex", Outcome::Done, as_prescribed);
  const auto notes =
      family_job("bore", "hex", as_prescribed).morph(family_cad("bore", 1.5)).report.run.notes;
  CHECK(std::ranges::any_of(notes, [](const std::string& note) {
    return note.find("laid out anew") != std::string::npos;
  }));
}

TEST_CASE("The bore's hexahedra are valid at 220 % where surface nodes may slide on the CAD",
          "[apps][families]") {
  check_over_range("bore", "hex", Outcome::Done, {}, 2.2);
  PipelineOptions repaired;
  repaired.quality = QualityMode::Fast;
  const MorphJob job = family_job("bore", "hex", repaired);
  const CadModel variant = family_cad("bore", 2.2);
  const MorphResult result = job.morph(variant);
  REQUIRE(result.report.untangling);
  const Index slid = result.report.untangling->slid_nodes;
  CHECK(slid > 0);
  for (const std::string& warning : result.report.run.warnings)  // of a fold there is none
    CHECK_THAT(warning, Catch::Matchers::Contains("hardly of use"));
  const auto& nodes = job.base().boundary.nodes;
  Index moved = 0;
  for (const RowId i : result.surface.entity.ids()) {
    const Eigen::Vector3d at = result.positions.row(nodes[i]);
    if (at.transpose() == result.surface.positions.row(i)) continue;
    ++moved;
    // Off its old place, and still on its own face or edge.
    const int entity = result.surface.entity[i];
    const Eigen::Vector2d uv = result.surface.uv.row(i);
    const double off = job.base().association().dimension[i] == CadDimension::Face
                           ? project_globally(variant, FaceId(entity), at).distance
                           : project_on_edge(variant, EdgeId(entity), at, uv[0]).distance;
    CHECK(off < 1e-9 * variant.diagonal());
  }
  CHECK(moved == slid);
}

TEST_CASE("The families' tetrahedra are valid at steps 1 to 20", "[apps][families]") {
  for (const std::string family : {"bore", "pipe"}) {
    const MorphJob job = family_job(family, "tet");
    for (int step = 1; step <= 20; ++step) {
      INFO(family << " step " << step);
      const MorphResult result = job.morph(family_cad(family, step / 20.0));
      CHECK(result.report.outcome == Outcome::Done);
      CHECK(invalid_cells(job.base().mesh(), result.positions) == 0);
    }
  }
}

}  // namespace cadmorph
