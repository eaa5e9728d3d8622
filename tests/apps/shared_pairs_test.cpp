// CAD and mesh by other people's tools, in a folder outside the project: CADMORPH_FORMATS names it.

#include <catch2/catch.hpp>
#include <cstdlib>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "cad_variants.h"
#include "command_line.h"
#include "core/mesh_file.h"

namespace cadmorph {
namespace {

using namespace testing;
namespace fs = std::filesystem;

struct Pair {
  const char *step, *mesh;
  /// Of the diagonal: how far the mesh lies off its CAD, as both were delivered.
  double off_cad;
};

constexpr Pair kPairs[] = {{"ugrid/cube-cylinder.step", "ugrid/cube-cylinder.ugrid", 1e-9},
                           {"ugrid/cube-cylinder.step", "ugrid/cube-cylinder.meshb", 1e-9},
                           {"calculix/cantilever.step", "calculix/cantilever.inp", 2e-6},
                           {"calculix/zbeam.step", "calculix/zbeam_shell.inp", 2e-6}};

// Real parts changed by their own parameters, in a folder that CADMORPH_CASES names, each with the
// smallest scaled Jacobian that a user can expect.
struct Change {
  const char *part, *variant;
  double least;
};

constexpr Change kChanges[] = {{"hole_seam", "stored", 0.1},
                               {"boss_height", "f1.1", 0.15},
                               {"boss_height", "f1.35", 0.07},
                               {"boss_height", "f2", 0.02},
                               {"boss_height", "f4", 0},
                               {"offset", "f1.5", 0.0066},  // half of the base's
                               {"offset", "f3", 0},
                               {"quadratic_close", "p10", 0.0006},  // half of the base's
                               {"quadratic_close", "multi", 0.0006}};

}  // namespace

TEST_CASE("Real parts come out valid after changes of their parameters", "[.][shared-parts]") {
  const char* named = std::getenv("CADMORPH_CASES");
  REQUIRE(named);
  const fs::path folder = fs::path(named) / "parametric";
  const Workplace place;
  for (const Change& change : kChanges) {
    INFO(change.part << ' ' << change.variant);
    const std::string part = (folder / change.part).string();
    const RunResult result = place.run(part + "/base.step " + part + "/" + change.variant +
                                       ".step " + part + "/base.vtu -o out.vtu --json -");
    INFO(result.err);
    REQUIRE(result.exit_code == 0);
    const auto after = nlohmann::json::parse(result.out)["after"];
    CHECK(after["min_scaled_jacobian"].get<double>() > change.least);
  }
}

// Of NURBS a STEP writer keeps the parameters, so that an affine image moves every node by the map.
TEST_CASE("CAD and meshes of others follow an affine change", "[.][shared-pairs]") {
  const char* named = std::getenv("CADMORPH_FORMATS");
  REQUIRE(named);
  const fs::path folder = named;
  const Workplace place;
  for (const Pair& pair : kPairs) {
    INFO(pair.mesh);
    const TopoDS_Shape base = to_nurbs(read_shape(folder / pair.step));
    write_step(place.folder() / "base.step", base);
    write_step(place.folder() / "variant.step", transformed(base, general_affine()));
    const std::string name = fs::path(pair.mesh).filename().string();
    const RunResult result = place.run("base.step variant.step " + (folder / pair.mesh).string() +
                                       " -o " + name + " --json report.json");
    INFO(result.err);
    REQUIRE(result.exit_code == 0);
    const double unit =
        nlohmann::json::parse(place.read("report.json"))["mesh"]["unit_mm"].get<double>();
    const Points before = unit * MeshFile(folder / pair.mesh).mesh().points;
    const Points after = unit * MeshFile(place.folder() / name).mesh().points;
    const double diagonal = (before.colwise().maxCoeff() - before.colwise().minCoeff()).norm();
    double farthest = 0;
    for (Index n = 0; n < before.rows(); ++n)
      farthest = std::max(
          farthest,
          (after.row(n).transpose() - apply(general_affine(), before.row(n).transpose())).norm());
    CHECK(farthest <= pair.off_cad * diagonal);
  }
}

}  // namespace cadmorph
