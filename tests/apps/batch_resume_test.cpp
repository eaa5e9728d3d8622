#include <catch2/catch.hpp>

#include "batch_folder.h"

namespace cadmorph {
namespace {

using namespace testing;
using Catch::Matchers::Contains;

// The rows without what tells of earlier runs.
std::map<std::string, nlohmann::json> results_of(const Workplace& place,
                                                 const std::string& folder) {
  auto rows = rows_of(place, folder);
  for (auto& [id, row] : rows) row.erase("revision");
  return rows;
}

void check_same_results(const Workplace& place, const std::string& a, const std::string& b) {
  CHECK(results_of(place, a) == results_of(place, b));
  CHECK(meshes_of(place, a) == meshes_of(place, b));
}

void run_shards(const Workplace& place, const std::string& command, int count, int exit_code = 0) {
  for (int i = 1; i <= count; ++i) {
    const RunResult run = place.run(command + " -o out --resume --shard " + std::to_string(i) +
                                    "/" + std::to_string(count));
    INFO(run.err);
    CHECK((run.exit_code == 0 || run.exit_code == exit_code));
  }
}

// Refused by its quality: the mesh goes to <id>.failed.vtu.
const std::string kHighQuality = " --min-scaled-jacobian 0.9";

}  // namespace

TEST_CASE("Only --resume goes on in a folder, and only with the same batch", "[apps][batch]") {
  const Workplace place;
  const std::string start = "batch box.step box.vtu ";
  REQUIRE(place.run(start + "box_moved.step -o out").exit_code == 0);
  const auto check = [&](const std::string& arguments, const std::string& word) {
    const auto before = meshes_of(place, "out");
    const RunResult result = place.run(arguments);
    INFO(arguments << result.err);
    CHECK(result.exit_code == 1);
    CHECK_THAT(result.err, Contains(word));
    CHECK(meshes_of(place, "out") == before);
  };
  check(start + "box_moved.step -o out", "--resume");
  check(start + "box_moved.step -o out --resume --snap", "--snap");
  check("batch box_moved.step box.vtu box_moved.step -o out --resume", "base CAD");
  // Another number of threads is the same batch, and more variants may join.
  const RunResult more = place.run(start + "box_moved.step box.step -o out --resume --threads 1");
  CHECK(more.exit_code == 0);
  CHECK_THAT(more.out, Contains("2 of 2") && Contains("1 kept"));
}

TEST_CASE("Results without a plan are not taken for this batch's, nor replaced", "[apps][batch]") {
  const Workplace place;
  const std::string command = "batch box.step box.vtu box_moved.step -o out";
  REQUIRE(place.run(command).exit_code == 0);
  const auto meshes = meshes_of(place, "out");
  const std::string rows = place.read("out/results.csv");
  std::filesystem::remove(place.folder() / "out/batch.json");
  for (const std::string& again : {command, command + " --resume --kernel biharmonic"}) {
    const RunResult result = place.run(again);
    CHECK(result.exit_code == 1);
    CHECK_THAT(result.err, Contains("results.csv but no batch.json"));
    CHECK(meshes_of(place, "out") == meshes);
    CHECK(place.read("out/results.csv") == rows);
  }
}

TEST_CASE("A resumed batch does what has changed again", "[apps][batch]") {
  const Workplace place;
  const std::string command = "batch box.step box.vtu " + place.make_boxes(4);
  REQUIRE(place.run(command + " -o out").exit_code == 0);
  place.write("v1.step", place.read("box_moved.step"));
  std::filesystem::remove(place.folder() / "out/v2.vtu");
  std::filesystem::resize_file(place.folder() / "out/v3.vtu", 1000);
  const RunResult resumed = place.run(command + " -o out --resume");
  CHECK(resumed.exit_code == 0);
  CHECK_THAT(resumed.out, Contains("1 kept"));
  REQUIRE(place.run(command + " -o whole").exit_code == 0);
  check_same_results(place, "out", "whole");
}

TEST_CASE("The newest row of a variant counts, whatever file it is in", "[apps][batch]") {
  const Workplace place;
  const std::string command = "batch box.step box.vtu " + place.make_boxes(4);
  run_shards(place, command, 2);
  REQUIRE(place.run("batch --collect out").exit_code == 0);
  for (const int shards : {2, 3}) {
    INFO(shards);
    place.write("v1.step", place.read("box_moved.step"));
    place.write("v2.step", place.read("v3.step"));
    run_shards(place, command, shards);
    REQUIRE(place.run("batch --collect out").exit_code == 0);
    REQUIRE(place.run(command + " -o whole").exit_code == 0);
    check_same_results(place, "out", "whole");
    std::filesystem::remove_all(place.folder() / "whole");
    const RunResult again = place.run(command + " -o out --resume --shard 1/1");
    CHECK_THAT(again.out, Contains("4 kept"));
    place.make_boxes(4);
    run_shards(place, command, shards);
    REQUIRE(place.run("batch --collect out").exit_code == 0);
  }
}

TEST_CASE("A variant that fails when it is done again is no longer done", "[apps][batch]") {
  const Workplace place;
  const std::string command = "batch box.step box.vtu " + place.make_boxes(4);
  run_shards(place, command, 2);
  REQUIRE(place.run("batch --collect out").exit_code == 0);
  place.write("v1.step", place.read("box_chamfer.step"));  // of another topology
  run_shards(place, command, 2, 8);
  const RunResult collected = place.run("batch --collect out");
  CHECK(collected.exit_code == 8);
  CHECK_THAT(collected.out, Contains("3 of 4 variants done"));
  CHECK_THAT(collected.err, Contains("v1 (3): "));
  CHECK(rows_of(place, "out").at("v1")["status"] == "failed");
  // A solver that takes all meshes must not find one of the part as it was.
  CHECK_FALSE(place.has("out/v1.vtu"));
}

TEST_CASE("A variant that was begun again and not finished is not done", "[apps][batch]") {
  const Workplace place;
  const std::string command = "batch box.step box.vtu " + place.make_boxes(2);
  run_shards(place, command, 2);
  REQUIRE(place.run("batch --collect out").exit_code == 0);
  place.write("v1.step", place.read("box_moved.step"));
  // Stopped by a full disk, with the new mesh or without.
  CHECK(place.run(command + " -o out --resume --shard 2/2", "ulimit -f 2;").exit_code == 6);
  const RunResult collected = place.run("batch --collect out");
  CHECK(collected.exit_code == 8);
  CHECK_THAT(collected.err, Contains("v1 (6): ") && Contains("--resume"));
  run_shards(place, command, 2);
  CHECK(place.run("batch --collect out").exit_code == 0);
}

TEST_CASE("A batch is not resumed with fewer variants", "[apps][batch]") {
  const Workplace place;
  place.make_boxes(3);
  const std::string start = "batch box.step box.vtu ";
  REQUIRE(place.run(start + "v0.step v1.step -o out").exit_code == 0);
  const std::string plan = place.read("out/batch.json"), rows = place.read("out/results.csv");
  const RunResult fewer = place.run(start + "v2.step -o out --resume");
  CHECK(fewer.exit_code == 1);
  CHECK_THAT(fewer.err, Contains("v0") && Contains("v1") && Contains("-o"));
  CHECK(place.read("out/batch.json") == plan);
  CHECK(place.read("out/results.csv") == rows);
  CHECK_FALSE(place.has("out/v2.vtu"));
  const RunResult all = place.run(start + "v2.step v0.step v1.step -o out --resume");
  CHECK(all.exit_code == 0);
  CHECK_THAT(all.out, Contains("3 of 3") && Contains("2 kept"));
}

TEST_CASE("No input is taken for a mesh of an earlier run", "[apps][batch]") {
  const Workplace place;
  const std::string bore = source_file("models/bore/").string();
  std::filesystem::create_directory(place.folder() / "out");
  for (const std::string mesh : {"step10.failed.vtu", "step10.vtu"}) {
    std::filesystem::copy_file(bore + "hex.vtu", place.folder() / "out" / mesh);
    const std::string before = place.read("out/" + mesh);
    for (const std::string resume : {"", " --resume"}) {
      const RunResult run = place.run("batch " + bore + "base.step out/" + mesh + " " + bore +
                                      "step10.step -o out" + kHighQuality + resume);
      INFO(mesh << resume << run.err);
      CHECK(run.exit_code == 2);
      CHECK_THAT(run.err, Contains("out/" + mesh) && Contains("one of the inputs"));
      CHECK((place.read("out/" + mesh) == before));
    }
    std::filesystem::remove(place.folder() / "out" / mesh);
  }
}

}  // namespace cadmorph
