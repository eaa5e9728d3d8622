#include <catch2/catch.hpp>
#include <cstdlib>
#include <fstream>
#include <limits>
#include <sstream>

#include "../core/sample_meshes.h"
#include "apps/bench/rbf_warps.h"
#include "command_line.h"
#include "core/errors.h"

namespace cadmorph {
namespace {

using namespace testing;
namespace fs = std::filesystem;

// Rows of fields of a CSV file without quotes.
std::vector<std::vector<std::string>> read_rows(const fs::path& path) {
  std::ifstream file(path);
  std::vector<std::vector<std::string>> rows;
  for (std::string line; std::getline(file, line);) {
    rows.emplace_back();
    std::istringstream fields(line + ",");
    for (std::string field; std::getline(fields, field, ',');) rows.back().push_back(field);
  }
  return rows;
}

int run_bench(const Workplace& place, const std::string& arguments) {
  const std::string command =
      "cd '" + place.folder().string() + "' && '" CADMORPH_BENCH "' " + arguments + " 2>bench.err";
  return WEXITSTATUS(std::system(command.c_str()));
}

// A family of a box that is stretched at its first step and then stays.
void make_family(const Workplace& place) {
  const fs::path family = place.folder() / "families" / "box";
  fs::create_directories(family);
  fs::copy_file(place.folder() / "box.step", family / "base.step");
  fs::copy_file(place.folder() / "box.vtu", family / "hex.vtu");
  for (int step = 1; step <= 20; ++step)
    fs::copy_file(place.folder() / "box_moved.step",
                  family / (step < 10 ? "step0" + std::to_string(step) + ".step"
                                      : "step" + std::to_string(step) + ".step"));
}

}  // namespace

TEST_CASE("The evaluation has a row for each step, and goes on where it was", "[apps][bench]") {
  const Workplace place;
  make_family(place);
  const std::string command = "evaluate families -o results.csv --method RBF-S FEMWARP";
  REQUIRE(run_bench(place, command) == 0);
  const auto rows = read_rows(place.folder() / "results.csv");
  // RBF-S on its own surface, FEMWARP on both; absolute and relative.
  REQUIRE(rows.size() == 1 + 3 * 2 * 20);
  for (std::size_t i = 1; i < rows.size(); ++i) {
    REQUIRE(rows[i].size() == rows[0].size());
    CHECK(rows[i][0] == "box");
    CHECK(rows[i][5] == std::to_string((i - 1) % 20 + 1));
    CHECK(std::stod(rows[i][10]) == Approx(1).epsilon(1e-6));  // a stretched box of boxes
    CHECK(rows[i][13] == "0");
    CHECK(rows[i].back().empty());
  }
  const std::string before = place.read("results.csv");
  REQUIRE(run_bench(place, command) == 0);
  CHECK(place.read("results.csv") == before);
  REQUIRE(run_bench(place, "evaluate families -o results.csv --method LBWARP") == 0);
  CHECK(read_rows(place.folder() / "results.csv").size() == 1 + 5 * 2 * 20);
}

TEST_CASE("A relative route ends where its warp fails, an absolute one goes on", "[apps][bench]") {
  bench::Series series;
  series.mesh = cube(CellType::Hexahedron, 2);
  for (Index node = 0; node < series.mesh.node_count(); ++node)
    if (series.mesh.points.row(node) != Eigen::RowVector3d::Constant(0.5))
      series.surface_nodes.push_back(node);
  Points start(series.surface_nodes.size(), 3);
  for (Index i = 0; i < start.rows(); ++i)
    start.row(i) = series.mesh.points.row(series.surface_nodes[i]);
  Points nowhere = start;
  nowhere(1, 0) = std::numeric_limits<double>::quiet_NaN();
  const bench::Route absolute{bench::Surface::RbfS, bench::Mode::Absolute};
  const bench::Route relative{bench::Surface::RbfS, bench::Mode::Relative};
  series.paths = {{absolute, {start, start, nowhere, start}},
                  {relative, {start, start, nowhere, start}}};
  bench::RbfWarps warps(series);
  for (const auto& route : {absolute, relative}) {
    for (const int step : {1, 2})
      CHECK(warps.at(route, step).positions.row(series.surface_nodes[2]) == start.row(2));
    CHECK_THROWS_AS(warps.at(route, 3), Error);
  }
  CHECK(warps.at(absolute, 4).positions.row(series.surface_nodes[2]) == start.row(2));
  CHECK_THROWS_AS(warps.at(relative, 4), Error);
}

TEST_CASE("Each solver gives the same mesh in its own process", "[apps][bench]") {
  const Workplace place;
  make_family(place);
  REQUIRE(run_bench(place, "solvers families -o solvers.csv") == 0);
  const auto rows = read_rows(place.folder() / "solvers.csv");
  REQUIRE(rows.size() > 5);
  for (std::size_t i = 1; i < rows.size(); ++i) {
    CAPTURE(rows[i][2], rows[i].back());
    if (rows[i].back() == "not run: the reference LAPACK is not installed") continue;
    CHECK(std::stod(rows[i][9]) == Approx(1).epsilon(1e-6));
    const bool is_netlib = rows[i][2].starts_with("netlib");
    CHECK((rows[i][10].find("openblas") == std::string::npos) == is_netlib);
  }
}

TEST_CASE("The evaluation refuses what it can't use", "[apps][bench]") {
  const Workplace place;
  make_family(place);
  CHECK(run_bench(place, "evaluate") == 1);
  CHECK(run_bench(place, "evaluate nowhere -o results.csv") == 2);
  CHECK(run_bench(place, "evaluate families -o results.csv --family wing") == 2);
  place.write("other.csv", "a,b\n");
  CHECK(run_bench(place, "evaluate families -o other.csv") == 2);
  CHECK(place.read("other.csv") == "a,b\n");
}

}  // namespace cadmorph
