#include "apps/pipeline/output_file.h"

#include <catch2/catch.hpp>

#include "command_line.h"

namespace cadmorph {

using namespace testing;

TEST_CASE("The failed mesh lies beside the output", "[apps][output]") {
  CHECK(failed_path("a/b.vtu") == std::filesystem::path("a/b.failed.vtu"));
  CHECK(failed_path("b.c.vtk").filename() == "b.c.failed.vtk");
}

TEST_CASE("A text is written whole and replaces the old one", "[apps][output]") {
  const Workplace place;
  place.write("x.txt", "old and longer");
  write_text(place.folder() / "x.txt", "new");
  CHECK(place.read("x.txt") == "new");
  CHECK_THROWS_AS(write_text(place.folder() / "none/x.txt", "new"), OutputError);
}

TEST_CASE("Outputs that can't be are refused", "[apps][output]") {
  const Workplace place;
  const auto box = place.folder() / "box.vtu";
  CHECK_THROWS_AS(check_output(box, {box}), InvalidInputError);
  CHECK_THROWS_AS(check_output(place.folder() / "none/x.vtu", {box}), OutputError);
  CHECK_THROWS_AS(check_output(place.folder(), {box}), OutputError);
  CHECK_NOTHROW(check_output(place.folder() / "x.vtu", {box}));
  const auto failed = place.folder() / "x.failed.vtu";
  CHECK_NOTHROW(check_mesh_output(place.folder() / "x.vtu", {box}));
  CHECK_THROWS_AS(check_mesh_output(place.folder() / "x.vtu", {failed}), InvalidInputError);
}

TEST_CASE("Paths to one file are known as such, though it is not there yet", "[apps][output]") {
  CHECK(is_same_file("x.vtu", "./x.vtu"));
  CHECK(is_same_file("none/../x.vtu", std::filesystem::absolute("x.vtu")));
  CHECK_FALSE(is_same_file("x.vtu", "y.vtu"));
  CHECK_FALSE(is_same_file("", "x.vtu"));
}

}  // namespace cadmorph
