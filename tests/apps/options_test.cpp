#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>

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

}  // namespace cadmorph
