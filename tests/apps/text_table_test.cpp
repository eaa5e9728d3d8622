#include "apps/summary/text_table.h"

#include <catch2/catch.hpp>

#include "apps/summary/summary.h"

namespace cadmorph {

TEST_CASE("Counts get separators of thousands", "[apps][text]") {
  CHECK(with_commas(0) == "0");
  CHECK(with_commas(999) == "999");
  CHECK(with_commas(1000) == "1,000");
  CHECK(with_commas(-1234567) == "-1,234,567");
}

TEST_CASE("Columns are as wide as their widest cell", "[apps][text]") {
  CHECK(align({{"a", "1"}, {"long", "22", "x"}, {}}) == "a      1\nlong  22  x\n\n");
}

TEST_CASE("Layers whose heights halved or doubled are hinted at", "[apps][summary]") {
  PipelineReport report;
  report.outcome = Outcome::Done;
  report.layers = {.cells = 10, .least = 0.6, .most = 1.8, .growth_before = 1.2};
  CHECK(hints(report).empty());
  report.layers.least = 0.45;
  REQUIRE(hints(report).size() == 1);
  CHECK_THAT(hints(report)[0], Catch::Matchers::Contains("0.45 to 1.8 times as high"));
  report.layers = {.cells = 10, .least = 0.9, .most = 2.1, .growth_before = 1.2};
  CHECK(hints(report).size() == 1);
  report.layers.growth_before = 1;  // no layers: cells that happen to be there
  CHECK(hints(report).empty());
}

}  // namespace cadmorph
