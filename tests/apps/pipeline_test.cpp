#include <algorithm>
#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>
#include <set>

#include "apps/pipeline/morph_files.h"
#include "apps/pipeline/refusal.h"
#include "apps/pipeline/surface_stage.h"
#include "cad/step_reader.h"
#include "command_line.h"
#include "core/mesh_file.h"

namespace cadmorph {
namespace {

using namespace testing;

MorphJob box_job(const Workplace& place, PipelineOptions options = {}) {
  return MorphJob(std::make_shared<const CadModel>(read_step(place.folder() / "box.step")),
                  std::make_shared<const MeshFile>(place.folder() / "box.vtu"), std::move(options));
}

}  // namespace

TEST_CASE("A job serves many variants, each as if it were alone", "[apps][pipeline]") {
  const Workplace place;
  const MorphJob job = box_job(place);
  const CadModel same = read_step(place.folder() / "box.step");
  const CadModel longer = read_step(place.folder() / "box_moved.step");
  const MorphResult first = job.morph(longer);
  const MorphResult identity = job.morph(same);
  const MorphResult again = job.morph(longer);
  CHECK(first.positions == again.positions);
  CHECK(first.positions.col(0).maxCoeff() == Approx(12));
  CHECK((identity.positions - job.base().mesh().points).cwiseAbs().maxCoeff() < 3.7e-8);
  CHECK(first.report.outcome == Outcome::Done);
}

TEST_CASE("A variant that names another unit for the same numbers is remarked on",
          "[apps][pipeline]") {
  const Workplace place;
  std::string text = place.read("box_moved.step");
  const std::string millimetre = "SI_UNIT(.MILLI.,.METRE.)";
  REQUIRE(text.find(millimetre) != std::string::npos);
  text.replace(text.find(millimetre), millimetre.size(), "SI_UNIT($,.METRE.)");
  place.write("metres.step", text);
  const MorphJob job = box_job(place);
  const auto warnings = [&](const char* name) {
    return job.morph(read_step(place.folder() / name)).report.run.warnings;
  };
  CHECK(warnings("box_moved.step").empty());
  REQUIRE(warnings("metres.step").size() == 1);
  CHECK(warnings("metres.step")[0].find("names the wrong unit") != std::string::npos);
}

TEST_CASE("A match that fits hardly better than another one is remarked on", "[apps][pipeline]") {
  const Workplace place;
  const MorphJob job = box_job(place);
  const std::shared_ptr<const BaseSide> base(std::shared_ptr<void>(), &job.base());
  const CadModel variant = read_step(place.folder() / "box_moved.step");
  TopologyMatch match = match_topology(*base->cad, variant);
  const auto warnings = [&](double ahead, int other = 3) {
    match.runner_up = ConsideredMatch{.how = "turned", .cost = match.cost, .faces = match.faces};
    match.runner_up->cost.turn += ahead;
    std::swap(match.runner_up->faces[FaceId(0)], match.runner_up->faces[FaceId(other)]);
    return begin_result(base, variant, match).report.run.warnings;
  };
  REQUIRE(warnings(0.9).size() == 1);
  CHECK_THAT(warnings(0.9)[0], Catch::Matchers::Contains("in one of two ways that fit alike"));
  CHECK_THAT(warnings(0.9)[0], Catch::Matchers::Contains("the other pairs faces 1, 4 of the base"));
  CHECK_THAT(warnings(0.9, 0)[0], Catch::Matchers::StartsWith("the edges of "));
  CHECK(warnings(1.1).empty());
}

TEST_CASE("Variants morphed together are to the last bit as if alone", "[apps][pipeline]") {
  const Workplace place;
  const MorphJob job = box_job(place);
  std::vector<CadModel> variants;
  for (const char* name : {"box_moved.step", "box_chamfer.step", "box.step", "box_moved.step"})
    variants.push_back(read_step(place.folder() / name));
  const std::vector<MorphAttempt> together = job.morph_each(variants);
  REQUIRE(together.size() == 4);
  CHECK_THROWS_AS(std::rethrow_exception(together[1].error), TopologyError);
  for (const std::size_t i : {0, 2, 3}) {
    const MorphResult alone = job.morph(variants[i]);
    REQUIRE(!together[i].error);
    CHECK(together[i].result.positions == alone.positions);
    CHECK(together[i].result.quality.min == alone.quality.min);
    CHECK(together[i].result.report.after.max_distance == alone.report.after.max_distance);
    CHECK(together[i].result.report.stepping.steps == alone.report.stepping.steps);
  }
  CHECK(job.morph_each({}).empty());
}

TEST_CASE("Where much inverts, the pairs of faces are named as a cause", "[apps][pipeline]") {
  const Workplace place;
  const std::string plate = source_file("models/shapes/plate_4_holes").string();
  place.write("swapped.csv", "7,8\n8,9\n9,7\n");  // three holes: no turn of the plate
  const RunResult run = place.run(plate + ".step " + plate + "_variant.step " + plate +
                                  ".vtu -o out.vtu --map swapped.csv");
  CHECK(run.exit_code == 5);
  CHECK_THAT(run.err, Catch::Matchers::Contains("look at the pairs of faces"));
}

TEST_CASE("A refused result names its worst cell and the face beside it", "[apps][pipeline]") {
  const Workplace place;
  // A cell of poor shape at the side x = 0, in the middle of y and z.
  Mesh mesh = box_mesh(3);
  const Index node = (4 * 7 + 3) * 4 + 1;
  mesh.points.row(node) << 0.4, mesh.points(node, 1) + 2.5, mesh.points(node, 2);
  write_mesh(place.folder() / "box.vtu", mesh);
  PipelineOptions options;
  options.min_scaled_jacobian = 0.5;
  const MorphJob job = box_job(place, options);
  const CadModel variant = read_step(place.folder() / "box_moved.step");
  const MorphResult result = job.morph(variant);
  REQUIRE(result.report.outcome != Outcome::Done);
  const Diagnosis& diagnosis = *result.report.diagnosis;
  CHECK(result.quality.values[diagnosis.worst_cell] == result.quality.min);
  CHECK(diagnosis.bad_cells > 0);
  // The CAD face at x = 0.
  REQUIRE(diagnosis.face >= 0);
  const CadModel base = read_step(place.folder() / "box.step");
  const CadFace& face = base.faces()[diagnosis.face];
  const auto at = base.evaluate(diagnosis.face, (face.lower + face.upper) / 2).point;
  CHECK(at[0] == Approx(0).margin(1e-9));
}

TEST_CASE("Elements inverted in the input are accepted where that is asked for, no others",
          "[apps][pipeline]") {
  const Workplace place;
  Mesh mesh = box_mesh(3);
  const auto at = [&](double z) {  // on the vertical edge at the origin
    for (Index n = 0; n < mesh.node_count(); ++n)
      if ((mesh.points.row(n) - Eigen::RowVector3d(0, 0, z)).norm() < 1e-9) return n;
    return Index(-1);
  };
  const Index low = at(10.0 / 3);
  REQUIRE(low >= 0);
  mesh.points(low, 2) = 8;  // past the next node of the edge
  write_mesh(place.folder() / "folded.vtu", mesh);
  const std::string command = "box.step box_moved.step folded.vtu -o out.vtu";
  const RunResult refused = place.run(command);
  CHECK(refused.exit_code == 5);
  CHECK_THAT(refused.err, Catch::Matchers::Contains("accept them by --accept-inverted-input"));
  const RunResult accepted = place.run(command + " --accept-inverted-input");
  CHECK(accepted.exit_code == 0);
  CHECK_THAT(accepted.err, Catch::Matchers::Contains("inverted, as in the input mesh"));

  write_mesh(place.folder() / "box.vtu", mesh);
  PipelineOptions options;
  options.accept_inverted_input = true;
  const MorphJob job = box_job(place, options);
  MorphResult result = job.morph(read_step(place.folder() / "box_moved.step"));
  REQUIRE(!result.validity.invalid_cells.empty());
  CHECK(bad_cells(result).empty());
  const Index other = mesh.cell_count() - 1;
  result.validity.invalid_cells.push_back(other);
  CHECK(bad_cells(result) == std::vector<Index>{other});
}

TEST_CASE("The progress of the whole trip is told", "[apps][pipeline]") {
  const Workplace place;
  std::vector<std::string> phases;
  PipelineOptions options;
  options.progress = [&](std::string_view phase, double fraction) {
    CHECK(fraction >= 0);
    CHECK(fraction <= 1);
    if (phases.empty() || phases.back() != phase) phases.emplace_back(phase);
  };
  const MorphFiles files{place.folder() / "box.step", place.folder() / "box_moved.step",
                         place.folder() / "box.vtu", place.folder() / "out.vtu", false};
  const PipelineReport report = morph_files(files, options);
  CHECK(report.run.written == place.folder() / "out.vtu");
  for (const char* phase : {"reading", "association", "volume morph", "writing"})
    CHECK(std::count(phases.begin(), phases.end(), phase) >= 1);
}

TEST_CASE("CAD entities have the numbers that match prints", "[apps][pipeline]") {
  const Workplace place;
  const std::string bore = source_file("models/bore/");
  const std::string cad = bore + "base.step " + bore + "step20.step ";
  REQUIRE(place.run(cad + bore + "hex.vtu -o out.vtu --diagnostics --quiet").exit_code == 0);
  const nlohmann::json match = nlohmann::json::parse(place.run("match " + cad + "--json -").out);
  const Points points = MeshFile(bore + "hex.vtu").mesh().points;
  const MeshFile result(place.folder() / "out.vtu");
  const auto arrays = result.arrays();
  const auto values = [&](const std::string& name) -> RowMatrix {
    return std::ranges::find(arrays, name, &DataArray::name)->values;
  };
  const RowMatrix dimension = values("cadmorph_cad_dimension");
  const RowMatrix entity = values("cadmorph_cad_entity");
  std::set<int> edges;
  std::size_t corners = 0;
  for (Index n = 0; n < points.rows(); ++n) {
    const int number = static_cast<int>(entity(n, 0));
    if (dimension(n, 0) == 1) edges.insert(number);
    if (dimension(n, 0) != 0) continue;
    ++corners;
    const nlohmann::json& at = match["vertices"].at(number - 1)["base_point"];
    for (int k = 0; k < 3; ++k) CHECK(points(n, k) == Approx(at[k].get<double>()).margin(1e-6));
  }
  CHECK(corners == match["vertices"].size());
  CHECK(edges.size() == match["edges"].size());
  CHECK(*edges.rbegin() == static_cast<int>(match["edges"].size()));
}

TEST_CASE("Poor cells that are not inverted are not called held inverted", "[apps][pipeline]") {
  const Workplace place;
  Mesh mesh = box_mesh(1);  // all its nodes lie on the surface
  REQUIRE(mesh.points.row(6) == Eigen::RowVector3d(0, 0, 10));
  mesh.points(6, 2) += 2;  // along its edge
  write_mesh(place.folder() / "box.vtu", mesh);
  PipelineOptions options;
  options.min_scaled_jacobian = 0.99;
  const MorphResult result =
      box_job(place, options).morph(read_step(place.folder() / "box_moved.step"));
  REQUIRE(result.report.outcome == Outcome::PoorQuality);
  CHECK(result.report.diagnosis->held_cells == 0);
}

}  // namespace cadmorph
