#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>

#include "apps/pipeline/morph_files.h"
#include "cad/step_reader.h"
#include "cad_variants.h"
#include "command_line.h"
#include "core/boundary.h"
#include "family_steps.h"
#include "models/pipe.h"

namespace cadmorph {
namespace {

using namespace testing;
namespace fs = std::filesystem;

// Steps of a family in a folder of their own, gone with the object.
class Series {
 public:
  Series(const std::string& family, const std::string& mesh, const std::vector<int>& steps)
      : family_(family), mesh_(mesh), folder_(mark_.path().string() + ".d") {
    fs::create_directories(folder_);
    for (const int step : steps) {
      const fs::path path = folder_ / (std::to_string(step) + ".step");
      write_family_step(path, family, step / 20.0);
      paths_.push_back(path);
    }
  }
  ~Series() {
    std::error_code ignored;
    fs::remove_all(folder_, ignored);
  }

  MorphFiles files() const {
    return {.base_cad = model_file(family_ + "/base.step"),
            .variant_cad = paths_.back(),
            .mesh = model_file(family_ + "/" + mesh_ + ".vtu"),
            .output = folder_ / "out.vtu",
            .via = {paths_.begin(), paths_.end() - 1}};
  }
  PipelineReport run(const PipelineOptions& options = {}) const {
    return morph_files(files(), options);
  }
  const std::vector<fs::path>& paths() const { return paths_; }
  fs::path output() const { return folder_ / "out.vtu"; }

 private:
  std::string family_, mesh_;
  TemporaryFile mark_{".series"};
  fs::path folder_;
  std::vector<fs::path> paths_;
};

// Largest distance of a surface node to the nearest face.
double off_cad(const MeshFile& mesh, const fs::path& step) {
  const FaceOracle oracle(read_shape(step));
  double worst = 0;
  for (const Index node : extract_boundary(mesh.mesh()).nodes)
    worst = std::max(worst, oracle.nearest(mesh.mesh().points.row(node).transpose()).second);
  return worst;
}

}  // namespace

TEST_CASE("The bore goes through three CAD models and ends valid on the last", "[apps][series]") {
  for (const std::string mesh : {"hex", "tet"}) {
    INFO(mesh);
    const Series series("bore", mesh, {5, 10, 15, 20});
    const PipelineReport report = series.run();
    REQUIRE(report.outcome == Outcome::Done);
    REQUIRE(report.legs.size() == 4);
    for (std::size_t i = 0; i < 4; ++i) {
      CHECK(report.legs[i].cad.file == series.paths()[i]);
      CHECK(report.legs[i].after.invalid == 0);
    }
    const MeshFile written(series.output());
    CHECK(invalid_cells(written.mesh(), written.mesh().points) == 0);
    // gmsh's own nodes are within 1e-6 mm of the CAD (models/generate.cpp), and keep that offset.
    CHECK(off_cad(written, series.paths().back()) < 2e-6);
    // The whole move, from the file's mesh.
    const MeshFile input(series.files().mesh);
    const Points moves = written.mesh().points - input.mesh().points;
    CHECK(report.max_displacement == moves.rowwise().norm().maxCoeff());
    CHECK(report.before.min_scaled_jacobian ==
          measure_quality(input.mesh(), input.mesh().points, detect_orientation(input.mesh())).min);
  }
}

TEST_CASE("Each leg starts from the mesh and the CAD of the one before", "[apps][series]") {
  const Series series("pipe", "tet_quadratic", {5, 10, 20});
  REQUIRE(series.run().outcome == Outcome::Done);
  const auto mesh = std::make_shared<const MeshFile>(series.files().mesh);
  auto base = std::make_shared<const CadModel>(read_step(series.files().base_cad));
  PipelineOptions options;
  options.surface.association.mesh_unit_mm = 1;
  Points positions;
  for (const fs::path& path : series.paths()) {
    // Cells are raised at the end alone.
    options.quality = path == series.paths().back() ? QualityMode::Best : QualityMode::Fast;
    const MorphJob job(base, mesh, options, positions);
    base = std::make_shared<const CadModel>(read_step(path));
    positions = job.morph(*base).positions;
  }
  CHECK(MeshFile(series.output()).mesh().points == positions);
}

TEST_CASE("A pipe's wall gets to the same places by one leg or many", "[apps][series]") {
  // The generator's mesh at the full change is the truth on the walls: they stretch evenly in angle
  // and length, so that the places do not depend on the way.
  const Series series("pipe", "hex", {5, 10, 15, 20});
  const PipelineReport report = series.run();
  REQUIRE(report.outcome == Outcome::Done);
  const MorphJob job = family_job("pipe", "hex");
  const Points direct = job.morph(family_cad("pipe", 1)).positions;
  const MeshFile written(series.output());
  const Association& association = job.base().association();
  const CadModel base = read_step(series.files().base_cad);
  double worst = 0;
  Index compared = 0;
  for (const RowId i : association.dimension.ids()) {
    const bool is_on_end = association.dimension[i] == CadDimension::Face &&
                           base.faces()[association.face(i)].type == SurfaceType::Plane;
    if (is_on_end) continue;
    ++compared;
    const Index node = job.base().boundary.nodes[i];
    worst = std::max(worst, (written.mesh().points.row(node) - direct.row(node)).norm());
  }
  CHECK(worst < 1e-8 * report.cad.variant.diagonal);
  CHECK(compared == 4240);
}

TEST_CASE("A leg that inverts ends the trip, and nothing is handed back", "[apps][series]") {
  // The far model is no way for elements that nothing may repair.
  const Series series("bore", "hex", {30, 20});
  PipelineOptions options;
  options.stepping.steps = 1;
  options.untangle = UntangleMode::Never;
  const PipelineReport report = series.run(options);
  REQUIRE(report.outcome == Outcome::Inverted);
  CHECK(report.legs.size() == 1);
  CHECK(report.legs[0].after.invalid > 0);
  CHECK_FALSE(fs::exists(series.output()));
  CHECK(report.run.written.filename() == "out.failed.vtu");
  CHECK(report.cad.variant.file == series.paths()[0]);
}

TEST_CASE("Quality asked for is asked of the last mesh alone", "[apps][series]") {
  // There and back: poor on the way, as good as ever in the end.
  const Series series("bore", "hex", {20, 1});
  PipelineOptions options;
  options.quality = QualityMode::Fast;
  const PipelineReport plain = series.run(options);
  const double on_the_way = plain.legs[0].after.min_scaled_jacobian;
  REQUIRE(plain.after.min_scaled_jacobian > on_the_way);
  options.min_scaled_jacobian = (on_the_way + plain.after.min_scaled_jacobian) / 2;
  const PipelineReport report = series.run(options);
  CHECK(report.outcome == Outcome::Done);
  CHECK(report.after.min_scaled_jacobian > options.min_scaled_jacobian);
}

TEST_CASE("What makes no sense in a series is refused", "[apps][series]") {
  const Series series("bore", "hex", {5, 10});
  PipelineOptions options;
  options.face_map = {{1, 1}};
  CHECK_THROWS_AS(series.run(options), InvalidInputError);
  MorphFiles files = series.files();
  files.output = files.via.front();
  CHECK_THROWS_AS(morph_files(files), InvalidInputError);
  const auto base = std::make_shared<const CadModel>(read_step(files.base_cad));
  const auto mesh = std::make_shared<const MeshFile>(files.mesh);
  CHECK_THROWS_AS(MorphJob(base, mesh, {}, Points::Zero(3, 3)), InvalidInputError);
}

TEST_CASE("The command line takes --via once for each model", "[apps][series]") {
  const Series series("bore", "hex", {5, 10, 20});
  const MorphFiles files = series.files();
  const fs::path folder = series.output().parent_path();
  const std::string before_files = "--via 5.step --via 10.step ";
  const std::string trip = files.base_cad.string() + " 20.step " + files.mesh.string();
  const RunResult result = run_cadmorph(folder, before_files + trip + " -o cli.vtu --json -");
  INFO(result.err);
  REQUIRE(result.exit_code == 0);
  const auto report = nlohmann::json::parse(result.out);
  REQUIRE(report["legs"].size() == 3);
  CHECK(report["legs"][1]["cad"]["file"] == "10.step");
  REQUIRE(series.run().outcome == Outcome::Done);
  CHECK(MeshFile(folder / "cli.vtu").mesh().points == MeshFile(series.output()).mesh().points);

  CHECK(run_cadmorph(folder, trip + " -o x.vtu --via none.step").exit_code == 2);
  CHECK(run_cadmorph(folder, trip + " -o 5.step --via 5.step").exit_code == 1);
  CHECK(run_cadmorph(folder, trip + " -o x.vtu --via 5.step --map faces.csv").exit_code == 1);
  const fs::path pipe = model_file("pipe/step05.step");
  CHECK(run_cadmorph(folder, trip + " -o x.vtu --via " + pipe.string()).exit_code == 3);
  CHECK_FALSE(fs::exists(folder / "x.vtu"));
}

}  // namespace cadmorph
