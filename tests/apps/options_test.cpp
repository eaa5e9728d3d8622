#include <catch2/catch.hpp>

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

}  // namespace cadmorph
