#include <algorithm>
#include <catch2/catch.hpp>
#include <charconv>
#include <nlohmann/json.hpp>

#include "command_line.h"
#include "core/formats/mesh_format.h"
#include "core/mesh_file.h"

namespace cadmorph {
namespace {

using namespace testing;
using Json = nlohmann::json;

std::string digits(double value) {
  char text[32];
  return {text, std::to_chars(text, text + sizeof text, value).ptr};
}

/// The hexahedra of `mesh` as SU2 text; markers of the planes x, y, z = 0 and z = 30.
std::string su2_text(const Mesh& mesh) {
  std::string text = "NDIME= 3\nNELEM= " + std::to_string(mesh.cell_count()) + "\n";
  for (Index c = 0; c < mesh.cell_count(); ++c) {
    text += "12";
    for (const Index node : mesh.cell(c)) text += " " + std::to_string(node);
    text += "\n";
  }
  text += "NPOIN= " + std::to_string(mesh.node_count()) + "\n";
  for (Index n = 0; n < mesh.node_count(); ++n)
    text += digits(mesh.points(n, 0)) + " " + digits(mesh.points(n, 1)) + "  " +
            digits(mesh.points(n, 2)) + " % " + std::to_string(n) + "\n";
  const auto add_marker = [&](const std::string& name, int axis, double at) {
    std::string nodes;
    Index count = 0;
    for (Index n = 0; n < mesh.node_count(); ++n)
      if (mesh.points(n, axis) == at) nodes += "1 " + std::to_string(n) + "\n", ++count;
    text += "MARKER_TAG= " + name + "\nMARKER_ELEMS= " + std::to_string(count) + "\n" + nodes;
  };
  text += "NMARK= 3\n";
  add_marker("inlet", 0, 0);
  add_marker("floor", 2, 0);
  add_marker("lid", 2, 30);
  return text;
}

/// Workplace with box.su2, the mesh of box.vtu.
class Su2Workplace : public Workplace {
 public:
  Su2Workplace() { write("box.su2", su2_text(box_mesh(3))); }
  Points points(const std::string& name) const { return MeshFile(folder() / name).mesh().points; }
};

}  // namespace

TEST_CASE("A morph of another format gives the nodes of the same mesh as VTK", "[apps][formats]") {
  const Su2Workplace place;
  const RunResult result = place.run("box.step box_moved.step box.su2 --json report.json");
  INFO(result.err);
  REQUIRE(result.exit_code == 0);
  REQUIRE(place.run("box.step box_moved.step box.vtu").exit_code == 0);
  CHECK(place.points("box.morphed.su2") == place.points("box.morphed.vtu"));
  CHECK_THAT(result.out, Catch::Contains("SU2") && Catch::Contains("inlet"));
  const Json report = Json::parse(place.read("report.json"));
  CHECK(report["mesh"]["format"] == "SU2");
  REQUIRE(report["groups"].size() == 3);
  CHECK(report["groups"][0]["name"] == "inlet");
  CHECK(report["groups"][0]["kind"] == "marker");
  CHECK(report["groups"][0]["nodes"] == 7 * 10);
  CHECK(report["groups"][0]["max_displacement_mm"].get<double>() == 0);
  CHECK(report["groups"][2]["max_displacement_mm"].get<double>() == Approx(2));
}

TEST_CASE("What is raised goes by the format, or as asked", "[apps][formats]") {
  const Su2Workplace place;
  const auto judged_by = [&](const std::string& rest) -> std::string {
    const RunResult result = place.run("box.step box_moved.step " + rest + " --json -");
    INFO(result.err);
    REQUIRE(result.exit_code == 0);
    return Json::parse(result.out)["best_mesh"]["judged_by"];
  };
  CHECK(judged_by("box.su2") == "scaled Jacobian");
  CHECK(judged_by("box.vtu --for fv") == "faces");
  std::vector<std::string_view> names;
  for (const MeshFormat& format : mesh_formats())
    if (format.is_of_finite_volumes) names.push_back(format.name);
  CHECK_THAT(names,
             Catch::UnorderedEquals<std::string_view>({"Fluent", "Fluent HDF5", "OpenFOAM"}));
}

TEST_CASE("An identity gives the bytes of the file back", "[apps][formats]") {
  const Su2Workplace place;
  REQUIRE(place.run("box.step box.step box.su2 -o same.su2").exit_code == 0);
  CHECK(place.read("same.su2") == place.read("box.su2"));
  REQUIRE(place.run("field box.step box.step box.su2 -o zero.cmf").exit_code == 0);
  const RunResult applied = place.run("apply zero.cmf box.su2 -o applied.su2");
  INFO(applied.err);
  REQUIRE(applied.exit_code == 0);
  CHECK(place.read("applied.su2") == place.read("box.su2"));
}

TEST_CASE("All commands take another format", "[apps][formats]") {
  const Su2Workplace place;
  REQUIRE(place.run("field box.step box_moved.step box.vtu -o f.cmf").exit_code == 0);
  REQUIRE(place.run("apply f.cmf box.su2").exit_code == 0);
  REQUIRE(place.run("box.step box_moved.step box.su2 -o main.su2").exit_code == 0);
  CHECK(place.run("compare main.su2 box.morphed.su2 --tolerance 1e-9").exit_code == 0);
  CHECK(place.run("compare main.su2 box.su2").exit_code == 7);
  const RunResult quality = place.run("quality main.su2");
  CHECK(quality.exit_code == 0);
  CHECK_THAT(quality.out, Catch::Contains("Scaled Jacobian"));
  REQUIRE(place.run("batch box.step box.su2 box_moved.step -o out").exit_code == 0);
  CHECK(place.read("out/box_moved.su2") == place.read("main.su2"));
}

TEST_CASE("A mesh can be written for VTK, and between its formats", "[apps][formats]") {
  const Su2Workplace place;
  REQUIRE(place.run("box.step box_moved.step box.su2 -o look.vtu").exit_code == 0);
  const MeshFile look(place.folder() / "look.vtu");
  const auto arrays = look.arrays();
  CHECK(std::ranges::count(arrays, "inlet", &DataArray::name) == 1);
  REQUIRE(place.run("box.step box_moved.step box.vtu -o box.vtk").exit_code == 0);
  CHECK(place.points("box.vtk") == look.mesh().points);
  const RunResult refused = place.run("box.step box_moved.step box.vtu -o box2.su2");
  CHECK(refused.exit_code == 1);
  CHECK_THAT(refused.err, Catch::Contains("box2.su2") && Catch::Contains("VTK"));
}

TEST_CASE("What a format can't hold goes into a file beside", "[apps][formats]") {
  const Su2Workplace place;
  REQUIRE(place.run("box.step box_moved.step box.su2 --diagnostics -o d.su2").exit_code == 0);
  CHECK(place.points("d.su2") == place.points("d.diagnostics.vtu"));
  const RunResult poor =
      place.run("box.step box_moved.step box.su2 --min-scaled-jacobian 1 -o poor.su2");
  CHECK(poor.exit_code == 5);
  CHECK(!place.has("poor.su2"));
  const auto arrays = MeshFile(place.folder() / "poor.failed.vtu").arrays();
  CHECK(std::ranges::count(arrays, "cadmorph_bad", &DataArray::name) == 1);
}

TEST_CASE("Named parts are held, and unknown names refused", "[apps][formats]") {
  const Su2Workplace place;
  const std::string job = "box.step box_moved.step box.su2 ";
  const RunResult result = place.run(job + "--hold floor -o held.su2");
  INFO(result.err);
  const Points before = box_mesh(3).points;
  // The floor's hexahedra shear by two of ten: valid.
  REQUIRE(result.exit_code == 0);
  const Points held = place.points("held.su2");
  int on_floor = 0, on_lid = 0;
  for (Index n = 0; n < before.rows(); ++n) {
    if (before(n, 2) == 0) {
      ++on_floor;
      CHECK(held.row(n) == before.row(n));
    } else if (before(n, 2) == 30) {
      ++on_lid;
      CHECK(held(n, 0) == Approx(1.2 * before(n, 0)).margin(1e-9));
    }
  }
  CHECK(on_floor == 4 * 7);
  CHECK(on_lid == 4 * 7);
  // What the CAD moves can't follow anything else.
  const RunResult idle = place.run(job + "--follow floor --slide lid -o idle.su2");
  CHECK(idle.exit_code == 0);
  CHECK_THAT(idle.err, Catch::Contains("'floor' is to follow the volume, but all of its nodes") &&
                           Catch::Contains("'lid' is to slide, but all of its nodes"));
  const RunResult unknown = place.run(job + "--hold ceiling");
  CHECK(unknown.exit_code == 2);
  CHECK_THAT(unknown.err, Catch::Contains("ceiling") && Catch::Contains("inlet, floor, lid"));
  const RunResult twice = place.run(job + "--hold floor --rigid floor");
  CHECK(twice.exit_code == 2);
  CHECK_THAT(twice.err, Catch::Contains("floor") && Catch::Contains("two things"));
  const RunResult rigid = place.run(job + "--rigid floor");
  CHECK(rigid.exit_code == 2);
  CHECK_THAT(rigid.err, Catch::Contains("'floor' lies on the CAD, which moves it"));
}

TEST_CASE("Periodic sides are named in every command that morphs", "[apps][formats]") {
  const Su2Workplace place;
  const std::string job = "box.step box_moved.step box.su2 ";
  const RunResult result =
      place.run(job + "--periodic floor,lid -o periodic.su2 --json report.json");
  INFO(result.err);
  REQUIRE(result.exit_code == 0);
  const Json report = Json::parse(place.read("report.json"));
  REQUIRE(report["notes"].size() == 1);
  CHECK_THAT(report["notes"][0].get<std::string>(),
             Catch::Contains("floor, lid") && Catch::Contains("shifted by (0 0 30) mm"));
  const Points before = box_mesh(3).points, after = place.points("periodic.su2");
  const Points moved = after - before;
  Index pairs = 0;
  for (Index i = 0; i < before.rows(); ++i)
    for (Index k = 0; k < before.rows(); ++k)
      if (before(i, 2) == 0 && before(k, 2) == 30 &&
          before.row(i).head<2>() == before.row(k).head<2>()) {
        ++pairs;
        CHECK((moved.row(k) - moved.row(i)).norm() <= 1e-12 * 30);
      }
  CHECK(pairs == report["groups"][1]["nodes"].get<Index>());
  CHECK(place.run("field " + job + "--periodic floor,lid -o f.cmf").exit_code == 0);
  CHECK(place.run("batch box.step box.su2 box_moved.step --periodic floor,lid -o out").exit_code ==
        0);
  CHECK(place.points("out/box_moved.su2") == after);

  const RunResult unknown = place.run(job + "--periodic floor,ceiling");
  CHECK(unknown.exit_code == 2);
  CHECK_THAT(unknown.err, Catch::Contains("ceiling") && Catch::Contains("inlet, floor, lid"));
  for (const std::string& command : {job, "field " + job + "-o no.cmf ",
                                     std::string("batch box.step box.su2 box_moved.step -o no ")}) {
    const RunResult others = place.run(command + "--periodic floor,inlet");
    CHECK(others.exit_code == 2);
    CHECK_THAT(others.err,
               Catch::Contains("'floor' and 'inlet'") && Catch::Contains("no periodic sides"));
  }
  for (const char* pair : {"floor", "floor,", "floor,lid,inlet"}) {
    const RunResult bad = place.run(job + "--periodic " + pair);
    CHECK(bad.exit_code == 1);
    CHECK_THAT(bad.err, Catch::Contains("with a comma between"));
  }
}

}  // namespace cadmorph
