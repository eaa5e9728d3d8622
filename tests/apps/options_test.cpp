#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>
#include <sstream>

#include "command_line.h"

namespace cadmorph {

using namespace testing;

TEST_CASE("The output's default lies beside the mesh", "[apps][options]") {
  const Workplace place;
  std::filesystem::create_directory(place.folder() / "sub");
  std::filesystem::copy(place.folder() / "box.vtu", place.folder() / "sub/part.v1.vtu");
  REQUIRE(place.run("box.step box_moved.step sub/part.v1.vtu --quiet").exit_code == 0);
  CHECK(place.has("sub/part.v1.morphed.vtu"));
}

TEST_CASE("Options may stand before the files", "[apps][options]") {
  const Workplace place;
  CHECK(place.run("--quiet -o x.vtu --steps 2 box.step box_moved.step box.vtu").exit_code == 0);
  CHECK(place.has("x.vtu"));
}

TEST_CASE("Names with spaces and umlauts are files like others", "[apps][options]") {
  const Workplace place;
  std::filesystem::rename(place.folder() / "box.step", place.folder() / "größe 1.step");
  CHECK(place.run("'größe 1.step' box_moved.step box.vtu -o 'neu ä.vtu' --quiet").exit_code == 0);
  CHECK(place.has("neu ä.vtu"));
}

TEST_CASE("Names that are not UTF-8 are files like others", "[apps][options]") {
  const Workplace place;
  const std::string name = "b\xff.vtu";
  std::filesystem::rename(place.folder() / "box.vtu", place.folder() / name);
  const std::string job = "box.step box_moved.step '" + name + "' ";
  CHECK(place.run(job + "-o 'x\xfe.vtu' --json -").exit_code == 0);
  CHECK(place.run("quality '" + name + "'").exit_code == 0);
  CHECK(place.run("compare '" + name + "' '" + name + "' --json -").exit_code == 0);
  REQUIRE(place.run("field " + job + "-o x.cmf").exit_code == 0);
  const RunResult applied = place.run("apply x.cmf '" + name + "' -o y.vtu --json -");
  CHECK(applied.exit_code == 0);
  CHECK(nlohmann::json::parse(applied.out)["mesh"]["file"] == "b\xef\xbf\xbd.vtu");
}

TEST_CASE("The incremental QR solver is there, with its tolerance", "[apps][options]") {
  const Workplace place;
  const auto found =
      place.run("box.step box_moved.step box.vtu -o x.vtu --solver iqr --tolerance 0.01");
  CHECK(found.exit_code == 0);
  CHECK(found.out.find("incremental QR") != std::string::npos);
  CHECK(place.run("box.step box_moved.step box.vtu --solver qr").exit_code == 1);
}

TEST_CASE("A solver that needs more than --memory allows is refused", "[apps][options]") {
  const Workplace place;
  const std::string call = "box.step box_moved.step box.vtu -o x.vtu --solver lu --memory ";
  const auto refused = place.run(call + "1kB");
  CHECK(refused.exit_code == 6);
  CHECK(refused.err.find("more than the 1.0e+03 allowed") != std::string::npos);
  CHECK_FALSE(place.has("x.vtu"));
  CHECK(place.run(call + "lots").exit_code == 1);
  CHECK(place.run(call + "-5").exit_code == 1);
  CHECK(place.run(call + "1GB --quiet").exit_code == 0);
}

TEST_CASE("The mesh may stand in any place among the STEP files", "[apps][options]") {
  const Workplace place;
  REQUIRE(place.run("box.step box_moved.step box.vtu -o usual.vtu").exit_code == 0);
  REQUIRE(place.run("box.step box.vtu box_moved.step -o other.vtu").exit_code == 0);
  CHECK(place.read("other.vtu") == place.read("usual.vtu"));
  REQUIRE(place.run("field box.vtu box.step box_moved.step -o f.cmf").exit_code == 0);
  REQUIRE(place.run("batch box.step box_moved.step box_chamfer.step box.vtu -o out").exit_code ==
          8);
  CHECK(place.read("out/box_moved.vtu") == place.read("usual.vtu"));
}

TEST_CASE("Slips of the pen are told from unknown words", "[apps][options]") {
  const Workplace place;
  CHECK_THAT(place.run("qualty box.vtu").err, Catch::Contains("did you mean 'quality'"));
  const RunResult option = place.run("box.step box_moved.step box.vtu --outptu x.vtu");
  CHECK(option.exit_code == 1);
  CHECK_THAT(option.err, Catch::Contains("did you mean '--output'"));
}

TEST_CASE("Numbers that must be above zero are asked for as that", "[apps][options]") {
  const Workplace place;
  for (const std::string option : {"--threads 0", "--tolerance 0", "--max-steps -2", "--memory 0",
                                   "--association-tolerance 0", "--tolerance nan"}) {
    const RunResult refused = place.run("a.step b.step c.vtu " + option);
    CHECK(refused.exit_code == 1);
    CHECK_THAT(refused.err, Catch::Contains("is not a number greater than 0"));
  }
}

TEST_CASE("What an exit code means is told without a file to look for", "[apps][options]") {
  const Workplace place;
  const RunResult one = place.run("help exit-codes 4");
  CHECK(one.exit_code == 0);
  CHECK_THAT(one.out, Catch::StartsWith("## Exit code 4: the mesh does not lie on the base CAD"));
  CHECK_THAT(one.out, !Catch::Contains("Exit code 5"));
  CHECK_THAT(place.run("help exit-codes").out, Catch::Contains("## Exit code 8"));
  CHECK_THAT(place.run("help exit-code").err, Catch::Contains("did you mean 'exit-codes'"));
  CHECK(place.run("help exit-codes 99").exit_code == 1);
  CHECK_THAT(place.run("help formats").out, Catch::StartsWith("# Mesh formats"));
  CHECK_THAT(place.run("help choosing").out, Catch::StartsWith("# Choosing"));
  CHECK_THAT(place.run("help limits").out, Catch::StartsWith("# Limits"));
  CHECK(place.run("help formats 2").exit_code == 1);
  CHECK(place.run("help quality").out == place.run("quality --help").out);
  CHECK(place.run("help").out == place.run("help --help").out);
  CHECK(place.run("help qualities").exit_code == 1);
}

TEST_CASE("Each command's help ends with its own examples and exit codes", "[apps][options]") {
  const Workplace place;
  for (const std::string command :
       {"", "quality", "match", "batch", "field", "apply", "compare", "help"}) {
    CAPTURE(command);
    const std::string help = place.run(command + " --help").out;
    CHECK_THAT(help, Catch::Contains("Example"));
    CHECK_THAT(help, Catch::Contains("Exit codes: 0 done; "));
    CHECK_THAT(help, Catch::Contains(command.empty() ? "  cadmorph wing.step"
                                                     : "  cadmorph " + command + " "));
    CHECK((help.find("the meshes differ") != std::string::npos) == (command == "compare"));
    CHECK((help.find("some variants failed") != std::string::npos) == (command == "batch"));
    CHECK_THAT(help, !Catch::Contains("kb(=1000b)"));
    std::istringstream lines(help);
    for (std::string line; std::getline(lines, line);) {
      CAPTURE(line);
      // The names of all kernels are one word.
      CHECK((line.size() <= 100 || line.starts_with("  --kernel")));
    }
  }
}

TEST_CASE("An output of another kind than its name is refused", "[apps][options]") {
  const Workplace place;
  const std::string job = "box.step box_moved.step box.vtu ";
  CHECK_THAT(place.run(job + "--picture k.jpg").err, Catch::Contains(".png"));
  CHECK_THAT(place.run(job + "--report k.pdf").err, Catch::Contains(".html"));
  CHECK_THAT(place.run("field " + job + "-o f.vtu").err, Catch::Contains("f.cmf"));
  place.write("map.csv", "base,variant\n");
  CHECK_THAT(place.run(job + "--map map.csv").err, Catch::Contains("no pair"));
  place.write("map.csv", "1 -> 1\n");
  CHECK_THAT(place.run(job + "--map map.csv").err, Catch::Contains("map.csv:1"));
  CHECK(place.files().size() == 6);  // of the workplace, and the map
}

TEST_CASE("A legacy surface is named as what it is", "[apps][options]") {
  const Workplace place;
  place.write(
      "surface.vtk",
      "# vtk DataFile Version 3.0\ntitle\nASCII\nDATASET POLYDATA\nPOINTS 1 float\n0 0 0\n");
  const RunResult result = place.run("quality surface.vtk");
  CHECK(result.exit_code == 2);
  CHECK_THAT(result.err, Catch::Contains("POLYDATA"));
}

}  // namespace cadmorph
