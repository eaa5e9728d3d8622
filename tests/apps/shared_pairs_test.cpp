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

}  // namespace

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
