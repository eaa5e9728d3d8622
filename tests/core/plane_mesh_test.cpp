#include "core/plane_mesh.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <numeric>
#include <optional>
#include <vector>

#include "core/layer_heights.h"
#include "core/quality.h"
#include "core/quality_checks.h"
#include "sample_meshes.h"

namespace cadmorph {
namespace {

using namespace testing;

// A row of cells of width 1 along u whose sides are shifted along v by `shifts`, in the plane that
// is left of `axis` and at a height off the origin; clockwise or not.
Mesh strip(const std::vector<double>& shifts, int axis, bool is_clockwise, CellType type) {
  const Index sides = std::ssize(shifts);
  Mesh mesh;
  mesh.points.setConstant(2 * sides, 3, 0.3);
  for (Index i = 0; i < sides; ++i)
    for (int j = 0; j < 2; ++j) {
      mesh.points(2 * i + j, (axis + 1) % 3) = double(i);
      mesh.points(2 * i + j, (axis + 2) % 3) = j + shifts[i];
    }
  for (Index i = 0; i + 1 < sides; ++i) {
    std::vector<Index> nodes{2 * i, 2 * i + 2, 2 * i + 3, 2 * i + 1};
    if (is_clockwise) std::ranges::reverse(nodes);
    add_cell(mesh, type, nodes);
  }
  return mesh;
}

QualityChecks check(const Mesh& mesh) {
  return check_quality(mesh, mesh.points, find_cell_neighbours(mesh), detect_orientation(mesh));
}

}  // namespace

TEST_CASE("A plane mesh has the figures of one layer of cells", "[core][checks]") {
  const int axis = GENERATE(0, 1, 2);
  const bool is_clockwise = GENERATE(false, true);
  const CellType type = GENERATE(CellType::Quad, CellType::Polygon);
  // As the stack of hexahedra in quality_checks_test.cpp.
  const QualityChecks checks = check(strip({0, 0, 2}, axis, is_clockwise, type));
  CHECK(checks.max_non_orthogonality_deg == Approx(45));
  CHECK(checks.max_skewness == Approx(2));
  CHECK(checks.worst_skew_cell == 1);
  CHECK(checks.min_volume == Approx(1));
}

TEST_CASE("The aspect ratio of a plane cell is that of its sides", "[core][checks]") {
  Mesh mesh = strip({0, 0, 0}, 2, false, CellType::Quad);
  mesh.points.col(0) *= 250;
  const QualityChecks checks = check(mesh);
  CHECK(checks.max_aspect_ratio == Approx(250));
  CHECK(checks.min_volume == Approx(250));
}

TEST_CASE("Triangles and pentagons in a plane are measured by their areas", "[core][checks]") {
  Mesh mesh;
  mesh.points.resize(6, 3);
  mesh.points << 0, 0, 0, 2, 0, 0, 2, 1, 0, 1, 2, 0, 0, 1, 0, 3, 0.5, 0;
  add_cell(mesh, CellType::Polygon, std::vector<Index>{0, 1, 2, 3, 4});
  add_cell(mesh, CellType::Triangle, std::vector<Index>{1, 5, 2});
  add_cell(mesh, CellType::Line, std::vector<Index>{1, 5});
  REQUIRE(check(mesh).has_cells());
  CHECK(check(mesh).min_volume == Approx(0.5));
}

TEST_CASE("Nothing is measured of shells that leave the plane", "[core][checks]") {
  Mesh mesh = strip({0, 0, 0}, 2, false, CellType::Quad);
  mesh.points(5, 2) += 1e-3;
  CHECK(flat_axis(mesh, mesh.points) == -1);
  CHECK_FALSE(check(mesh).has_cells());
}

TEST_CASE("Heights of the first cells in a plane, and in a mesh one cell thick",
          "[core][checks][layers]") {
  // Columns of two cells on a floor that rises by a tenth; the upper cells stay.
  Mesh plane;
  constexpr Index kColumns = 4;
  for (Index i = 0; i <= kColumns; ++i)
    for (const double y : {0.0, 0.2, 1.0}) {
      plane.points.conservativeResize(plane.points.rows() + 1, 3);
      plane.points.bottomRows(1) << double(i), y, 0;
    }
  for (Index i = 0; i < kColumns; ++i)
    for (Index k = 0; k < 2; ++k) {
      const Index a = 3 * i + k;
      add_cell(plane, CellType::Quad, std::vector<Index>{a, a + 3, a + 4, a + 1});
    }
  const auto check_layers = [&](const Mesh& mesh) {
    Points after = mesh.points;
    for (Index n = 0; n < after.rows(); ++n)
      if (after(n, 1) == 0) after(n, 1) = 0.1;
    const LayerFigures layers =
        measure_layers(mesh, find_cell_neighbours(mesh), std::vector<char>(mesh.node_count(), 1),
                       mesh.points, after);
    CHECK(layers.cells == kColumns);
    CHECK(layers.least == Approx(0.5));
    CHECK(layers.most == Approx(0.5));
    CHECK(layers.growth_before == Approx(4));
    CHECK(layers.growth_after == Approx(8));
  };
  check_layers(plane);
  check_layers(one_layer(plane, plane.points));
}

TEST_CASE("First cells of layers count on a floor at rest, too, where they change",
          "[core][checks][layers]") {
  Mesh plane;
  constexpr Index kColumns = 6, kLayers = 5, kRaised = 3;
  for (Index i = 0; i <= kColumns; ++i)
    for (Index k = 0; k <= kLayers; ++k) {
      plane.points.conservativeResize(plane.points.rows() + 1, 3);
      plane.points.bottomRows(1) << double(i), std::pow(1.3, double(k)) / 3 - 1.0 / 3, 0;
    }
  const auto node = [](Index i, Index k) { return (kLayers + 1) * i + k; };
  for (Index i = 0; i < kColumns; ++i)
    for (Index k = 0; k < kLayers; ++k)
      add_cell(plane, CellType::Quad,
               std::vector<Index>{node(i, k), node(i + 1, k), node(i + 1, k + 1), node(i, k + 1)});
  Points after = plane.points;
  for (Index k = 1; k <= kLayers; ++k) {
    after(node(kRaised, k), 1) *= 1.5;
    after(node(0, k), 1) *= 1.001;  // no other cell by that
  }
  std::vector<char> is_floor(plane.node_count(), 0);
  for (Index i = 0; i <= kColumns; ++i) is_floor[node(i, 0)] = 1;
  const LayerFigures layers =
      measure_layers(plane, find_cell_neighbours(plane), is_floor, plane.points, after);
  CHECK(layers.are_growing());
  CHECK(layers.cells == 2);  // on both sides of the raised nodes
  CHECK(layers.share_kept == 0);
  CHECK(layers.least == Approx(1.25));
  CHECK(layers.most == Approx(1.25));
}

TEST_CASE("Patches of a plane mesh that go round the other way are no turned cells",
          "[core][plane]") {
  Mesh mesh = strip(std::vector<double>(9, 0), 2, false, CellType::Quad);
  const auto turn = [&](Index c) {
    std::reverse(mesh.connectivity.begin() + mesh.offsets[c],
                 mesh.connectivity.begin() + mesh.offsets[c + 1]);
  };
  CHECK_FALSE(in_one_sense(mesh));
  for (const Index c : {2, 3, 6}) turn(c);  // patches of two cells and of one
  const std::optional<Mesh> one = in_one_sense(mesh);
  REQUIRE(one);
  CHECK(turned_cells(*one, one->points).empty());
  CHECK(measure_quality(*one, one->points, detect_orientation(*one)).inverted == 0);
  for (const Index c : {0, 1, 4, 5, 7}) {
    const auto cell = one->cell(c), before = mesh.cell(c);
    CHECK(std::vector(cell.begin(), cell.end()) == std::vector(before.begin(), before.end()));
  }
  // A cell that a node turns over stays so: it goes round as its neighbours do.
  Points moved = mesh.points;
  moved(2 * 2, 0) = moved(2 * 2 + 1, 0) = 3.5;
  CHECK(turned_cells(*one, moved) == std::vector<Index>{2});
  mesh.points = moved;
  const std::optional<Mesh> folded = in_one_sense(mesh);
  REQUIRE(folded);
  CHECK(turned_cells(*folded, moved) == std::vector<Index>{2});
}

TEST_CASE("Cells of every type in a plane are the same the other way round", "[core][plane]") {
  const auto nodes_of = [](CellType type) -> Points {
    Points p(9, 3);
    p << 0, 0, 0, 2, 0.1, 0, 2.2, 2, 0, -0.1, 1.8, 0, 1, -0.1, 0, 2.2, 1, 0, 1.1, 2, 0, -0.2, 0.9,
        0, 1, 1, 0;
    if (type == CellType::Pixel) p.row(2).swap(p.row(3));
    if (type == CellType::QuadraticTriangle || type == CellType::BiquadraticTriangle)
      p.topRows(7) << 0, 0, 0, 2, 0.1, 0, 0.1, 1.8, 0, 1, -0.1, 0, 1.2, 1.1, 0, -0.1, 0.9, 0, 0.7,
          0.6, 0;
    if (type == CellType::QuadraticLinearQuad) p.row(5) = p.row(6).eval();
    return p;
  };
  for (const auto& [type, count] :
       std::vector<std::pair<CellType, Index>>{{CellType::Triangle, 3},
                                               {CellType::Polygon, 4},
                                               {CellType::Pixel, 4},
                                               {CellType::Quad, 4},
                                               {CellType::QuadraticTriangle, 6},
                                               {CellType::BiquadraticTriangle, 7},
                                               {CellType::QuadraticQuad, 8},
                                               {CellType::BiquadraticQuad, 9},
                                               {CellType::QuadraticLinearQuad, 6}}) {
    INFO(static_cast<int>(type));
    // Beside a cell of the other sense that is larger.
    Mesh mesh;
    mesh.points.resize(13, 3);
    mesh.points << nodes_of(type), 10, 0, 0, 10, 9, 0, 20, 9, 0, 20, 0, 0;
    std::vector<Index> nodes(static_cast<std::size_t>(count));
    std::iota(nodes.begin(), nodes.end(), Index{0});
    add_cell(mesh, type, nodes);
    add_cell(mesh, CellType::Quad, std::vector<Index>{9, 10, 11, 12});
    const std::optional<Mesh> turned = in_one_sense(mesh);
    REQUIRE(turned);
    CHECK_FALSE(in_one_sense(*turned));
    const auto cell = turned->cell(0);
    std::vector<Index> same(cell.begin(), cell.end());
    CHECK(same != nodes);
    std::ranges::sort(same);
    CHECK(same == nodes);
    CHECK(scaled_jacobian(*turned, turned->points, 0) ==
          Approx(scaled_jacobian(mesh, mesh.points, 0)));
    CHECK(measure_quality(*turned, turned->points, detect_orientation(*turned)).inverted == 0);
  }
}

}  // namespace cadmorph
