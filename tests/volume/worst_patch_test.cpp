#include "volume/worst_patch.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <vector>

#include "../core/sample_meshes.h"

namespace cadmorph {
namespace {

using namespace testing;

QualityReport report_of(std::vector<double> values) {
  QualityReport report;
  report.cells =
      std::count_if(values.begin(), values.end(), [](double q) { return !std::isnan(q); });
  report.min = 1;
  for (const double q : values)
    if (q < report.min) report.min = q;
  report.values = std::move(values);
  return report;
}

TEST_CASE("A twentieth of the cells is raised, the worst first, of those that lost") {
  std::vector<double> now(200), before(200, 0.9);
  for (std::size_t c = 0; c < now.size(); ++c) now[c] = 0.01 + 0.004 * double(c * 37 % 200);
  now[3] = before[3] = 0.001;         // lost nothing
  now[4] = before[4] = std::nan("");  // not measured
  const std::vector<Index> worst = worst_that_lost(report_of(now), report_of(before));
  REQUIRE(worst.size() == 10);  // 0.05 of 199, rounded up
  CHECK(std::ranges::is_sorted(worst, {}, [&](Index c) { return now[c]; }));
  for (const Index c : worst) CHECK((c != 3 && c != 4));
  const double largest = now[worst.back()];
  for (Index c = 0; c < 200; ++c)
    if (now[c] < largest && c != 3) CHECK(std::ranges::count(worst, c) == 1);
}

TEST_CASE("Cells that are alike to a thousandth are raised together") {
  std::vector<double> now(200, 0.5);
  for (Index c = 0; c < 15; ++c) now[c] = 0.1 + 1e-7 * double(c);
  CHECK(worst_that_lost(report_of(now), report_of(std::vector(200, 0.9))).size() == 15);
  // Up to twice a twentieth.
  for (Index c = 15; c < 40; ++c) now[c] = 0.1;
  CHECK(worst_that_lost(report_of(now), report_of(std::vector(200, 0.9))).size() == 20);
}

class Cube {
 public:
  explicit Cube(const std::vector<Index>& fixed) : cells_at_(mesh_) {
    std::vector<char> is_fixed(mesh_.node_count(), 0);
    for (const Index n : fixed) is_fixed[n] = 1;
    moving_.emplace(mesh_, mesh_.points, is_fixed, how_);
  }
  const Mesh& mesh() const { return mesh_; }
  Patch round(std::vector<Index> seeds, int layers, double most) const {
    return patch_round(std::move(seeds), layers, most,
                       report_of(std::vector<double>(mesh_.cell_count(), 0.5)), cells_at_,
                       *moving_);
  }

 private:
  const Mesh mesh_ = cube(CellType::Hexahedron, 5);
  const NodeCells cells_at_;
  const BestMeshOptions how_;
  std::optional<MovingNodes> moving_;
};

TEST_CASE("The nodes of a cell move with all cells at them, but those that are fixed") {
  const Cube cube({});
  const Index middle = 2 + 5 * 2 + 25 * 2;
  const Patch one = cube.round({middle}, 1, 1e9);
  CHECK(one.nodes.size() == 8);
  CHECK(one.cells.size() == 27);
  const Patch two = cube.round({middle}, 2, 1e9);
  CHECK(two.nodes.size() == 64);
  CHECK(two.cells.size() == 125);
  // No more cells are taken when so many change.
  CHECK(cube.round({0, middle}, 1, 1).cells.size() == 8);

  std::vector<Index> nodes(cube.mesh().cell(middle).begin(), cube.mesh().cell(middle).end());
  const Patch none = Cube(nodes).round({middle}, 1, 1e9);
  CHECK(none.nodes.empty());
  nodes.pop_back();
  CHECK(Cube(nodes).round({middle}, 1, 1e9).nodes ==
        std::vector(1, cube.mesh().cell(middle).back()));
}

}  // namespace
}  // namespace cadmorph
