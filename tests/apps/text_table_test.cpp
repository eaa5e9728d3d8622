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

TEST_CASE("Poor elements are hinted at where the morph made them", "[apps][summary]") {
  PipelineReport report;
  report.outcome = Outcome::Done;
  report.can_repair = report.mesh.has_solids = true;
  const auto hint_of = [&](double before, double after) -> std::string {
    report.before.min_scaled_jacobian = before;
    report.after.min_scaled_jacobian = after;
    const std::vector<std::string> found = hints(report);
    return found.empty() ? "" : found[0];
  };
  const auto improve = Catch::Matchers::Contains("improve");
  CHECK_THAT(hint_of(0.3, 0.06), improve);
  CHECK_THAT(hint_of(0.06, 0.05), Catch::Matchers::Contains("poor already"));
  CHECK(hint_of(0.05, 0.06).empty());
  report.best_mesh.emplace().attempts.resize(1);
  CHECK_THAT(hint_of(0.3, 0.06), Catch::Matchers::Contains("mesh the variant anew") && !improve);
}

TEST_CASE("Layers whose heights halved or doubled are hinted at, and that lean",
          "[apps][summary]") {
  PipelineReport report;
  report.outcome = Outcome::Done;
  report.layers = {.cells = 10, .least = 0.6, .most = 1.8, .growth_before = 1.2};
  CHECK(hints(report).empty());
  report.layers.least = 0.45;
  REQUIRE(hints(report).size() == 1);
  CHECK_THAT(hints(report)[0], Catch::Matchers::Contains("0.45 to 1.8 times as high"));
  report.layers = {.cells = 10, .least = 0.9, .most = 2.1, .growth_before = 1.2};
  CHECK(hints(report).size() == 1);
  report.layers = {.cells = 10, .least = 0.9, .most = 1.1, .growth_before = 1.2};
  report.layers.lean_before = 2;
  report.layers.lean_after = 21;
  CHECK(hints(report).empty());
  report.layers.lean_after = 31;
  REQUIRE(hints(report).size() == 1);
  CHECK_THAT(hints(report)[0], Catch::Matchers::Contains("lean by 31 degrees") &&
                                   Catch::Matchers::Contains("in the input by 2"));
  report.layers.growth_before = 1;  // no layers: cells that happen to be there
  CHECK(hints(report).empty());
}

}  // namespace cadmorph
