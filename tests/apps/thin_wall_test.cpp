#include <BRepAlgoAPI_Fuse.hxx>
#include <BRepPrimAPI_MakeBox.hxx>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <map>
#include <vector>

#include "apps/pipeline/morph_job.h"
#include "cad_variants.h"
#include "volume/best_mesh.h"

namespace cadmorph {
namespace {

using namespace testing;

// A plate, 2 thick, with a rib in its middle, 2 wide and 8 high; hexahedra with edges of about 1.
struct RibbedPlate {
  static constexpr double kLength = 60, kWidth = 16, kThickness = 2, kRib = 2, kHeight = 8;
  static constexpr int kFirst = 4, kLast = 12;  // the rib from side to side
  double at;                                    // the rib's left side

  CadModel cad() const {
    const gp_Pnt foot(at, kFirst, kThickness / 2);
    return to_model(
        BRepAlgoAPI_Fuse(
            BRepPrimAPI_MakeBox(kLength, kWidth, kThickness).Shape(),
            BRepPrimAPI_MakeBox(foot, kRib, kLast - kFirst, kThickness / 2 + kHeight).Shape())
            .Shape());
  }
  Mesh mesh() const {
    std::vector<double> columns;
    for (int i = 0; i <= int(at); ++i) columns.push_back(i * at / int(at));
    for (int i = 1; i <= 2; ++i) columns.push_back(at + i * kRib / 2);
    const int rest = int(kLength - at - kRib);
    for (int i = 1; i <= rest; ++i) columns.push_back(at + kRib + i * (kLength - at - kRib) / rest);
    Mesh mesh;
    std::map<std::array<int, 3>, Index> nodes;
    std::vector<Eigen::RowVector3d> points;
    const auto node = [&](int i, int j, int k) {
      const auto [place, is_new] = nodes.try_emplace({i, j, k}, std::ssize(points));
      if (is_new) points.emplace_back(columns[i], j, k);
      return place->second;
    };
    for (int i = 0; i + 1 < int(columns.size()); ++i)
      for (int j = 0; j < int(kWidth); ++j) {
        const bool is_rib = (i == int(at) || i == int(at) + 1) && j >= kFirst && j < kLast;
        for (int k = 0; k < int(kThickness + (is_rib ? kHeight : 0)); ++k)
          add_cell(mesh, CellType::Hexahedron,
                   std::array{node(i, j, k), node(i + 1, j, k), node(i + 1, j + 1, k),
                              node(i, j + 1, k), node(i, j, k + 1), node(i + 1, j, k + 1),
                              node(i + 1, j + 1, k + 1), node(i, j + 1, k + 1)});
      }
    mesh.points.resize(std::ssize(points), 3);
    for (Index n = 0; n < mesh.points.rows(); ++n) mesh.points.row(n) = points[n];
    return mesh;
  }
  static MorphResult moved(double by, QualityMode quality) {
    const RibbedPlate from{20}, to{20 + by};
    PipelineOptions options;
    options.quality = quality;
    return MorphJob(std::make_shared<const CadModel>(from.cad()),
                    std::make_shared<const MeshFile>(from.mesh(), "plate"), options)
        .morph(to.cad());
  }
};

}  // namespace

TEST_CASE("The other side of a thin wall follows a rib that moves along it", "[apps][families]") {
  constexpr double kWay = 6;
  const MorphResult fast = RibbedPlate::moved(kWay, QualityMode::Fast),
                    best = RibbedPlate::moved(kWay, QualityMode::Best);
  CHECK(fast.report.followed_nodes == 0);
  CHECK(best.report.followed_nodes > 0);
  REQUIRE(best.report.outcome == Outcome::Done);
  const Points& before = best.base->mesh().points;
  int under_rib = 0;
  double by_parameters = 0;
  for (Index n = 0; n < before.rows(); ++n) {
    if (before(n, 2) > 0) continue;
    CHECK(std::abs(best.positions(n, 2)) < 1e-12);
    const double middle = RibbedPlate::kWidth / 2;
    if (std::abs(before(n, 0) - 21) > 1.5 || std::abs(before(n, 1) - middle) > 3) continue;
    ++under_rib;
    by_parameters = std::max(by_parameters, fast.positions(n, 0) - before(n, 0));
    CHECK(best.positions(n, 0) - before(n, 0) > 0.75 * kWay);
  }
  CHECK(under_rib > 6);
  CHECK(by_parameters < 1e-9);
  const WorstCells kept = worst_cells(best.quality);
  CHECK(kept.worst_twentieth > 1.5 * worst_cells(fast.quality).worst_twentieth);
  CHECK(kept.min > fast.quality.min);
}

TEST_CASE("Where little is lost, a wall's other side stays", "[apps][families]") {
  const MorphResult result = RibbedPlate::moved(0.5, QualityMode::Best);
  CHECK(result.report.followed_nodes == 0);
  const Points& before = result.base->mesh().points;
  int on_other_side = 0;
  for (Index n = 0; n < before.rows(); ++n) {
    if (before(n, 2) != 0) continue;
    ++on_other_side;
    CHECK(result.positions.row(n) == before.row(n));
  }
  CHECK(on_other_side == 61 * 17);
}

}  // namespace cadmorph
