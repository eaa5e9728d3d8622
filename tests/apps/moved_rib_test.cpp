#include <BRepAlgoAPI_Fuse.hxx>
#include <BRepPrimAPI_MakeBox.hxx>
#include <array>
#include <catch2/catch.hpp>
#include <map>
#include <memory>
#include <utility>

#include "apps/pipeline/morph_job.h"
#include "cad_variants.h"
#include "core/quality_checks.h"
#include "volume/mid_nodes.h"

namespace cadmorph {
namespace {

using namespace testing;

constexpr int kWidth = 8, kRibWide = 2, kRibFrom = 2, kRibTo = 6, kRibTop = 5;

// A plate one thick with a rib on it that ends before the plate's sides.
struct Plate {
  int length, rib_at;
};

CadModel cad_of(const Plate& plate, double by) {
  const auto box = [](double x, double y, double z, double dx, double dy, double dz) {
    return BRepPrimAPI_MakeBox(gp_Pnt(x, y, z), dx, dy, dz).Shape();
  };
  return to_model(BRepAlgoAPI_Fuse(
                      box(0, 0, 0, plate.length, kWidth, 1),
                      box(plate.rib_at + by, kRibFrom, 1, kRibWide, kRibTo - kRibFrom, kRibTop - 1))
                      .Shape());
}

// Cubes, of 8 nodes or 20.
Mesh mesh_of(const Plate& plate, bool is_second_order) {
  Mesh mesh;
  std::map<std::array<int, 3>, Index> numbers;  // by twice the coordinates
  std::vector<Eigen::RowVector3d> points;
  const auto add_cube = [&](int x, int y, int z) {
    const std::array corners{std::array{0, 0, 0}, std::array{2, 0, 0}, std::array{2, 2, 0},
                             std::array{0, 2, 0}, std::array{0, 0, 2}, std::array{2, 0, 2},
                             std::array{2, 2, 2}, std::array{0, 2, 2}};
    constexpr std::array edges{std::pair{0, 1}, std::pair{1, 2}, std::pair{2, 3}, std::pair{3, 0},
                               std::pair{4, 5}, std::pair{5, 6}, std::pair{6, 7}, std::pair{7, 4},
                               std::pair{0, 4}, std::pair{1, 5}, std::pair{2, 6}, std::pair{3, 7}};
    std::vector<Index> nodes;
    const auto add = [&](int i, int j, int k) {
      const auto [found, is_new] =
          numbers.try_emplace({2 * x + i, 2 * y + j, 2 * z + k}, std::ssize(points));
      if (is_new) points.emplace_back(x + i / 2.0, y + j / 2.0, z + k / 2.0);
      nodes.push_back(found->second);
    };
    for (const auto& [i, j, k] : corners) add(i, j, k);
    if (is_second_order)
      for (const auto& [a, b] : edges)
        add((corners[a][0] + corners[b][0]) / 2, (corners[a][1] + corners[b][1]) / 2,
            (corners[a][2] + corners[b][2]) / 2);
    add_cell(mesh, is_second_order ? CellType::QuadraticHexahedron : CellType::Hexahedron, nodes);
  };
  for (int x = 0; x < plate.length; ++x)
    for (int y = 0; y < kWidth; ++y)
      for (int z = 0; z < kRibTop; ++z) {
        const bool is_rib =
            x >= plate.rib_at && x < plate.rib_at + kRibWide && y >= kRibFrom && y < kRibTo;
        if (z == 0 || is_rib) add_cube(x, y, z);
      }
  mesh.points.resize(std::ssize(points), 3);
  for (Index n = 0; n < mesh.points.rows(); ++n) mesh.points.row(n) = points[n];
  return mesh;
}

MorphResult moved(const Plate& plate, double by, Mesh mesh, QualityMode quality,
                  MeshUse use = MeshUse::OfFormat) {
  PipelineOptions options;
  options.quality = quality;
  options.mesh_use = use;
  return MorphJob(std::make_shared<const CadModel>(cad_of(plate, 0)),
                  std::make_shared<const MeshFile>(std::move(mesh), "plate"), options)
      .morph(cad_of(plate, by));
}

MorphResult moved(const Plate& plate, double by, bool is_second_order = false,
                  QualityMode quality = QualityMode::Best) {
  return moved(plate, by, mesh_of(plate, is_second_order), quality);
}

}  // namespace

TEST_CASE("Where a rib moves far, the plate's edges and both its sides follow", "[apps][rib]") {
  // By 12 of the plate's cells, beside sides of two cells.
  const MorphResult result = moved({60, 28}, 12);
  CHECK(result.report.outcome == Outcome::Done);
  CHECK(result.report.followed_nodes > 0);
  CHECK(result.quality.min > 0.7);
}

TEST_CASE("Where one step inverts many, the surface follows before further steps", "[apps][rib]") {
  const MorphResult plain = moved({80, 28}, 20, false, QualityMode::Fast),
                    result = moved({80, 28}, 20);
  REQUIRE(plain.report.stepping.steps == 2);
  CHECK(result.report.outcome == Outcome::Done);
  CHECK(result.report.followed_nodes > 0);
  CHECK(result.report.stepping.steps == 1);
  CHECK(result.quality.min > 0.7);
}

TEST_CASE("Finite volumes follow a rib as finite elements do", "[apps][rib]") {
  const Plate plate{60, 28};
  const MorphResult result =
      moved(plate, 12, mesh_of(plate, false), QualityMode::Best, MeshUse::FiniteVolumes);
  CHECK(result.report.outcome == Outcome::Done);
  CHECK(result.report.followed_nodes > 0);
  CHECK(check_quality(result.base->mesh(), result.positions, result.base->neighbours,
                      result.base->orientation)
            .max_non_orthogonality_deg < 45);
}

TEST_CASE("On the way of a series, elements are raised where half of their shape is lost",
          "[apps][rib][series]") {
  const auto moved_by = [](double by, QualityMode quality) {
    return moved({60, 28}, by, false, quality);
  };
  CHECK(moved_by(12, QualityMode::Fast).quality.min < 0.5);
  CHECK(moved_by(12, QualityMode::WhereHalfIsLost).quality.min > 0.7);
  const Points near = moved_by(1, QualityMode::WhereHalfIsLost).positions;
  CHECK(near == moved_by(1, QualityMode::Fast).positions);
  CHECK(near != moved_by(1, QualityMode::Best).positions);
}

TEST_CASE("Cells of second order follow a rib as those of first order do", "[apps][rib]") {
  const MorphResult first = moved({40, 16}, 8), second = moved({40, 16}, 8, true);
  CHECK(second.report.outcome == Outcome::Done);
  CHECK(second.report.followed_nodes > 0);
  CHECK(second.quality.min > 0.9 * first.quality.min);
}

// Where one step does not do; nothing is raised.
TEST_CASE("Cells of second order are repaired as those at their corners", "[apps][rib]") {
  const double by = 20;
  const MorphResult first = moved({60, 28}, by, false, QualityMode::Fast),
                    second = moved({60, 28}, by, true, QualityMode::Fast);
  REQUIRE(first.report.stepping.attempts.front().inverted > 0);
  CHECK(second.report.outcome == Outcome::Done);
  const auto &tried = second.report.stepping.attempts, &of_corners = first.report.stepping.attempts;
  REQUIRE(tried.size() == of_corners.size());
  for (std::size_t i = 0; i < tried.size(); ++i) CHECK(tried[i].inverted == of_corners[i].inverted);
  const MidNodes mid_nodes(second.base->mesh(), second.positions);
  for (Index i = 0; i < mid_nodes.count(); ++i)
    CHECK((second.positions.row(mid_nodes.node(i)) - mid_nodes.middle(i, second.positions)).norm() <
          1e-9);
}

TEST_CASE("Cells of second order that are inverted in the input are repaired", "[apps][rib]") {
  const Plate plate{40, 16};
  Mesh mesh = mesh_of(plate, true);
  const Eigen::RowVector3d inside(plate.rib_at + 1, kRibFrom + 2, 3);
  Index node = 0;
  REQUIRE((mesh.points.rowwise() - inside).rowwise().norm().minCoeff(&node) < 1e-9);
  mesh.points(node, 2) += 1.2;
  const MidNodes mid_nodes(mesh, mesh.points);
  for (Index i = 0; i < mid_nodes.count(); ++i)
    mesh.points.row(mid_nodes.node(i)) = mid_nodes.middle(i, mesh.points);
  for (const double by : {0.5, 8.0}) {
    INFO("by " << by);
    const MorphResult result = moved(plate, by, mesh, QualityMode::Fast);
    CHECK(result.base->validity.invalid > 0);
    CHECK(result.report.outcome == Outcome::Done);
    CHECK(result.validity.invalid == 0);
  }
}

}  // namespace cadmorph
