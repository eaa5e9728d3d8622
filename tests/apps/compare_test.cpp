#include <catch2/catch.hpp>
#include <limits>
#include <nlohmann/json.hpp>

#include "command_line.h"
#include "core/mesh_file.h"

namespace cadmorph {

using namespace testing;

namespace {

// A box with one array of each kind, changed by `change` and written as `name`.
template <class Change>
void write_box(const Workplace& place, const std::string& name, Change&& change) {
  Mesh mesh = box_mesh(2);
  ExtraArrays extra;
  extra.point_arrays["heat"] = RowMatrix::Constant(mesh.node_count(), 1, 100.0);
  extra.cell_integers["part"] = std::vector<int>(mesh.cell_count(), 7);
  change(mesh, extra);
  write_mesh(place.folder() / name, mesh, extra);
}

void unchanged(Mesh&, ExtraArrays&) {}

nlohmann::json compare(const Workplace& place, const std::string& arguments, int exit_code) {
  const RunResult run = place.run("compare a.vtu b.vtu --json - " + arguments);
  REQUIRE(run.exit_code == exit_code);
  return nlohmann::json::parse(run.out);
}

}  // namespace

TEST_CASE("A mesh is the same as itself", "[apps][compare]") {
  const Workplace place;
  write_box(place, "a.vtu", unchanged);
  write_box(place, "b.vtu", unchanged);
  const RunResult run = place.run("compare a.vtu b.vtu");
  CHECK(run.exit_code == 0);
  CHECK(run.out.starts_with("same: b.vtu and the reference a.vtu\n"));
}

// The box has cells of 5 mm: the shortest edge at every node.
TEST_CASE("A moved node is found, named and measured in edges", "[apps][compare]") {
  const Workplace place;
  write_box(place, "a.vtu", unchanged);
  write_box(place, "b.vtu", [](Mesh& mesh, ExtraArrays&) {
    mesh.points.row(17) += Eigen::RowVector3d(0.003, 0, 0.004);
    mesh.points.row(3) += Eigen::RowVector3d(0.001, 0, 0);
  });
  auto json = compare(place, "", 7);
  CHECK(json["moved_nodes"] == 2);
  CHECK(json["nodes"][0]["node"] == 17);
  CHECK(json["nodes"][0]["distance"].get<double>() == Approx(0.005).epsilon(1e-10));
  CHECK(json["nodes"][0]["shortest_edge"].get<double>() == Approx(5));
  CHECK(compare(place, "--tolerance 0.00099", 7)["moved_nodes"] == 1);
  CHECK(compare(place, "--tolerance 0.00101", 0)["is_same"] == true);
  CHECK(compare(place, "--absolute 0.0049", 7)["moved_nodes"] == 1);
  compare(place, "--absolute 0.0051", 0);
}

TEST_CASE("The worst nodes are shown in the order of the first figure", "[apps][compare]") {
  const Workplace place;
  // Of two nodes that moved alike, the one with the shorter edge moved farther in edges.
  const auto squeeze = [](Mesh& mesh, ExtraArrays&) { mesh.points(0, 0) += 4; };
  write_box(place, "a.vtu", squeeze);
  write_box(place, "b.vtu", [&](Mesh& mesh, ExtraArrays& extra) {
    squeeze(mesh, extra);
    mesh.points(0, 1) += 0.1;
    mesh.points(mesh.node_count() - 1, 1) -= 0.2;
  });
  const std::string out = place.run("compare a.vtu b.vtu").out;
  CHECK_THAT(out, Catch::Contains("of the shortest edge"));
  const auto first = out.find("\n0 "), second = out.find("\n" + std::to_string(44) + " ");
  CAPTURE(out);
  REQUIRE(first != std::string::npos);
  CHECK(first < second);
}

TEST_CASE("The differences of positions can be written as an array", "[apps][compare]") {
  const Workplace place;
  write_box(place, "a.vtu", unchanged);
  write_box(place, "b.vtu", [](Mesh& mesh, ExtraArrays&) { mesh.points(17, 1) += 0.25; });
  REQUIRE(place.run("compare a.vtu b.vtu --difference d.vtu").exit_code == 7);
  const auto arrays = MeshFile(place.folder() / "d.vtu").arrays();
  const auto found = std::ranges::find(arrays, "cadmorph_difference", &DataArray::name);
  REQUIRE(found != arrays.end());
  CHECK(found->values(17, 1) == Approx(0.25));
  CHECK(found->values.cwiseAbs().sum() == Approx(0.25));
}

TEST_CASE("Other cells, counts and node orders are told", "[apps][compare]") {
  const Workplace place;
  write_box(place, "a.vtu", unchanged);
  SECTION("a cell turned about") {
    write_box(place, "b.vtu", [](Mesh& mesh, ExtraArrays&) {
      std::swap(mesh.connectivity[8], mesh.connectivity[9]);
    });
    const auto json = compare(place, "", 7);
    CHECK(json["structure"][0] == "1 cell of other type or nodes, the first is cell 1");
    CHECK(json["moved_nodes"] == 0);
  }
  SECTION("a finer mesh") {
    write_mesh(place.folder() / "b.vtu", box_mesh(3));
    const auto json = compare(place, "", 7);
    CHECK(json["structure"].size() == 2);
    const RunResult run = place.run("compare a.vtu b.vtu --difference d.vtu");
    CHECK(run.exit_code == 7);
    CHECK(run.out.starts_with("different: "));
    CHECK_THAT(run.err, Catch::Matchers::Contains("there is no d.vtu"));
    CHECK(!place.has("d.vtu"));
  }
}

TEST_CASE("Arrays are compared by name, type and value", "[apps][compare]") {
  const Workplace place;
  write_box(place, "a.vtu", unchanged);
  SECTION("missing and new") {
    write_box(place, "b.vtu", [](Mesh&, ExtraArrays& extra) {
      extra.point_arrays.erase("heat");
      extra.point_integers["heat2"] = std::vector<int>(box_mesh(2).node_count(), 1);
    });
    const auto json = compare(place, "", 7);
    CHECK(json["arrays"][0]["what"] == "missing");
    CHECK(json["arrays"][1]["what"] == "not in the reference");
    compare(place, "--ignore heat --ignore heat2", 0);
  }
  SECTION("type") {
    write_box(place, "b.vtu", [](Mesh& mesh, ExtraArrays& extra) {
      extra.point_arrays.erase("heat");
      extra.point_integers["heat"] = std::vector<int>(mesh.node_count(), 100);
    });
    CHECK(compare(place, "", 7)["arrays"][0]["what"] == "of type int, not double");
  }
  SECTION("floating-point values within the tolerance") {
    write_box(place, "b.vtu", [](Mesh&, ExtraArrays& extra) {
      extra.point_arrays["heat"](5, 0) += 1e-3;  // 1e-5 of the largest
    });
    const auto json = compare(place, "", 7);
    CHECK(json["arrays"][0]["differing_rows"] == 1);
    CHECK(json["arrays"][0]["worst_row"] == 5);
    compare(place, "--tolerance 1.01e-5", 0);
  }
  SECTION("integers exactly") {
    write_box(place, "b.vtu",
              [](Mesh&, ExtraArrays& extra) { extra.cell_integers["part"][2] = 8; });
    CHECK(compare(place, "--tolerance 1", 7)["arrays"][0]["worst_row"] == 2);
  }
  SECTION("not a number equals itself alone") {
    const auto with_nan = [](Mesh&, ExtraArrays& extra) {
      extra.point_arrays["heat"](5, 0) = std::numeric_limits<double>::quiet_NaN();
    };
    write_box(place, "b.vtu", with_nan);
    CHECK(compare(place, "--tolerance 1", 7)["arrays"][0]["worst_row"] == 5);
    write_box(place, "a.vtu", with_nan);
    compare(place, "", 0);
  }
}

TEST_CASE("Meshes that can't be compared have their exit codes", "[apps][compare]") {
  const Workplace place;
  CHECK(place.run("compare box.vtu missing.vtu").exit_code == 2);
  CHECK(place.run("compare box.vtu").exit_code == 1);
  CHECK(place.run("compare box.vtu box.vtu --tolerance 1 --absolute 1").exit_code == 1);
  CHECK(place.run("compare box.vtu box.vtu --difference box.vtu").exit_code == 1);
  CHECK(place.run("compare box.vtu box.vtu --difference no/d.vtu").exit_code == 6);
}

}  // namespace cadmorph
