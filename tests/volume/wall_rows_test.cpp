#include "volume/wall_rows.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <iterator>
#include <map>
#include <numbers>
#include <set>
#include <utility>
#include <vector>

#include "../core/sample_meshes.h"
#include "volume/best_mesh.h"
#include "volume/volume_morph.h"
#include "volume_meshes.h"

namespace cadmorph {
namespace {

using namespace testing;
using Eigen::Vector3d;

constexpr double kThickness = 0.2;

// A wall n cells thick.
Mesh wall(CellType type, int n) {
  Mesh mesh = cube(type, n);
  mesh.points.col(2) *= kThickness;
  return mesh;
}

std::vector<NodeRow> rows_of_mesh(const Mesh& mesh) {
  return find_wall_rows(mesh, find_cell_neighbours(mesh), mesh.points);
}

// Bends the wall, and makes it up to twice as thick.
Vector3d bend(const Vector3d& x) {
  const double thicker = 1 + x.x() * x.x();
  const double height = 0.5 * kThickness + (x.z() - 0.5 * kThickness) * thicker;
  return {x.x(), x.y() * (1 + 0.2 * x.x()), height + 0.2 * std::sin(3 * x.x())};
}

double largest_deviation(const std::vector<NodeRow>& rows, const Points& before,
                         const Points& after) {
  double largest = 0;
  for (const NodeRow& row : rows) largest = std::max(largest, deviation(row, before, after));
  return largest;
}

TEST_CASE("Rows go across a wall") {
  for (const CellType type :
       {CellType::Hexahedron, CellType::Voxel, CellType::Wedge, CellType::QuadraticHexahedron,
        CellType::QuadraticWedge, CellType::TriquadraticHexahedron}) {
    CAPTURE(static_cast<int>(type));
    const int n = 4;
    const Mesh mesh = wall(type, n);
    const std::vector<NodeRow> rows = rows_of_mesh(mesh);
    CHECK(std::ssize(rows) == (n + 1) * (n + 1));
    std::set<Index> nodes;
    for (const NodeRow& row : rows) {
      REQUIRE(std::ssize(row) == n + 1);
      const double end = mesh.points(row.front(), 2);
      CHECK(std::min(end, kThickness - end) == Approx(0).margin(1e-15));
      for (int i = 0; i <= n; ++i) {
        const double height = std::abs(mesh.points(row[i], 2) - end);
        CHECK(height == Approx(kThickness * i / n).margin(1e-15));
        CHECK(mesh.points.row(row[i]).head(2) == mesh.points.row(row[0]).head(2));
        nodes.insert(row[i]);
      }
    }
    CHECK(std::ssize(nodes) == (n + 1) * (n + 1) * (n + 1));
  }
}

TEST_CASE("What is no wall of a few cells has no rows") {
  const auto has_rows = [](const Mesh& mesh) { return !rows_of_mesh(mesh).empty(); };
  CHECK_FALSE(has_rows(cube(CellType::Hexahedron, 4)));
  CHECK_FALSE(has_rows(wall(CellType::Hexahedron, 1)));  // no node between
  CHECK_FALSE(has_rows(wall(CellType::Hexahedron, 17)));
  CHECK_FALSE(has_rows(wall(CellType::Tetra, 4)));
  CHECK_FALSE(has_rows(wall(CellType::Pyramid, 3)));
  CHECK_FALSE(has_rows(wall(CellType::Polyhedron, 3)));
  Mesh bent = wall(CellType::Hexahedron, 4);
  bent.points.col(0).array() += 0.1 * (15 * bent.points.col(2).array()).sin().eval();
  CHECK_FALSE(has_rows(bent));
}

// Of the lowest and the highest plane across an axis: images of each other.
void add_ends(const Mesh& mesh, int axis, Index family, std::vector<SheetNode>& sheets) {
  const double high = mesh.points.col(axis).maxCoeff();
  std::map<std::pair<double, double>, Index> place;
  for (const double end : {0.0, high})
    for (Index n = 0; n < mesh.node_count(); ++n)
      if (mesh.points(n, axis) == end) {
        const std::pair at(mesh.points(n, (axis + 1) % 3), mesh.points(n, (axis + 2) % 3));
        sheets.push_back({n, family, place.try_emplace(at, n).first->second});
      }
}

TEST_CASE("Rows of a sweep go from image to image, however long") {
  const int n = 6;
  Mesh column = cube(CellType::Hexahedron, n);
  column.points.col(2) *= 10;
  const auto rows = [&](const std::vector<SheetNode>& sheets) {
    return find_swept_rows(column, find_cell_neighbours(column), column.points, sheets);
  };
  std::vector<SheetNode> along;
  add_ends(column, 2, 0, along);
  const std::vector<NodeRow> swept = rows(along);
  REQUIRE(std::ssize(swept) == (n + 1) * (n + 1));
  for (const NodeRow& row : swept) {
    CHECK(std::ssize(row) == n + 1);
    CHECK(column.points.row(row.front()).head(2) == column.points.row(row.back()).head(2));
  }
  // No others go across them; of two sweeps of all nodes the one much the shorter counts.
  CHECK(find_wall_rows(column, find_cell_neighbours(column), column.points, swept).empty());
  std::vector<SheetNode> both = along;
  add_ends(column, 0, 1, both);
  const std::vector<NodeRow> shorter = rows(both);
  REQUIRE(std::ssize(shorter) == (n + 1) * (n + 1));
  for (const NodeRow& row : shorter)
    CHECK(column.points(row.front(), 0) != column.points(row.back(), 0));
  // Where one place has no row, nothing is swept.
  for (SheetNode& node : along)
    if (node.node == along.back().node) node.place = -1;
  CHECK(rows(along).empty());
  CHECK(rows({}).empty());
}

// A strip of cells across one end, and a sweep of all.
TEST_CASE("The sweep of more nodes keeps its rows where two cross") {
  const int n = 6;
  Mesh block = cube(CellType::Hexahedron, n);
  block.points.col(0) /= 10;
  std::vector<SheetNode> sheets, across;
  add_ends(block, 2, 0, sheets);
  add_ends(block, 0, 1, across);
  std::ranges::copy_if(across, std::back_inserter(sheets),
                       [&](const SheetNode& one) { return block.points(one.node, 2) <= 1.0 / n; });
  const std::vector<NodeRow> rows =
      find_swept_rows(block, find_cell_neighbours(block), block.points, sheets);
  REQUIRE(std::ssize(rows) == (n + 1) * (n + 1));
  for (const NodeRow& row : rows)
    CHECK(block.points(row.front(), 2) != block.points(row.back(), 2));
}

TEST_CASE("Cells of a row may be of unlike heights") {
  const Mesh even = wall(CellType::Wedge, 4);
  Mesh layers = even;
  layers.points.col(2) = layers.points.col(2).array().square().eval();
  CHECK(rows_of_mesh(layers) == rows_of_mesh(even));
}

TEST_CASE("Rows keep their places under affine maps and between ends that move") {
  const Mesh mesh = wall(CellType::Hexahedron, 3);
  const std::vector<NodeRow> rows = rows_of_mesh(mesh);
  REQUIRE(rows.size() == 16);
  const Points stretched = mapped(mesh.points, [](const Vector3d& x) {
    return Vector3d(2 * x.x() + 0.3 * x.z(), x.y() - 0.1 * x.x(), 1.5 * x.z() + 4);
  });
  CHECK(largest_deviation(rows, mesh.points, stretched) < 1e-14);
  // Rows bend by what the map is not linear in the height.
  const Points bowed = mapped(mesh.points, [](const Vector3d& x) {
    const double t = x.z() / kThickness;
    return Vector3d(x.x() + 0.1 * kThickness * t * (1 - t), x.y(), x.z());
  });
  for (const NodeRow& row : rows) CHECK(deviation(row, mesh.points, bowed) == Approx(0.1 * 2 / 9));
  const Points places = straight_places(rows[0], mesh.points, bowed);
  CHECK((places - mesh.points({rows[0][1], rows[0][2]}, Eigen::all)).norm() < 1e-15);
}

TEST_CASE("The best mesh has straight rows through walls") {
  int by_rows_alone = 0;
  for (const CellType type :
       {CellType::Hexahedron, CellType::Wedge, CellType::QuadraticHexahedron}) {
    CAPTURE(static_cast<int>(type));
    const Mesh mesh = wall(type, 4);
    std::vector<char> is_fixed(mesh.node_count(), 0);
    const std::vector<Index> surface = cube_surface(cube(type, 4));
    for (const Index node : surface) is_fixed[node] = 1;
    const VolumeMorph warp(mesh, surface);
    const Points moved = warp.morph(rows_of(mapped(mesh.points, bend), surface));
    const Orientation orientation = detect_orientation(mesh);
    BestMeshOptions options;
    options.wall_rows = rows_of_mesh(mesh);
    REQUIRE(largest_deviation(options.wall_rows, mesh.points, moved) > 0.003);
    const BestMeshResult best = find_best_mesh(
        mesh, {mesh.points, measure_quality(mesh, mesh.points, orientation)},
        {moved, measure_quality(mesh, moved, orientation)}, is_fixed, orientation, options);
    const auto& attempts = best.report.attempts;
    const auto of_rows = std::ranges::find(attempts, RaiseBy::WallRows, &RaiseAttempt::by);
    REQUIRE(of_rows != attempts.end());
    CHECK(of_rows->is_taken);
    CHECK(of_rows->cells > 0);
    CHECK(best.report.best.min >= best.report.plain.min);
    CHECK(best.report.best.worst_twentieth >= best.report.plain.worst_twentieth);
    for (const Index node : surface) CHECK(best.positions.row(node) == moved.row(node));
    if (std::ranges::any_of(attempts, [](const RaiseAttempt& a) { return a.power > 0; })) continue;
    ++by_rows_alone;
    CHECK(largest_deviation(options.wall_rows, mesh.points, best.positions) < 1e-3);
  }
  CHECK(by_rows_alone >= 1);  // two of them, unless rounding says otherwise
}

TEST_CASE("Rows go back between ends at rest, those of fixed nodes stay") {
  const Mesh mesh = wall(CellType::Hexahedron, 4);
  std::vector<char> is_fixed(mesh.node_count(), 0);
  for (const Index node : cube_surface(cube(CellType::Hexahedron, 4))) is_fixed[node] = 1;
  Points moved = mesh.points;
  for (Index n = 0; n < mesh.node_count(); ++n)
    if (!is_fixed[n]) moved(n, 0) += 0.02;
  const Orientation orientation = detect_orientation(mesh);
  BestMeshOptions options;
  options.wall_rows = rows_of_mesh(mesh);
  std::vector<char> all_fixed(mesh.node_count(), 1);
  const BestMeshResult held = find_best_mesh(
      mesh, {mesh.points, measure_quality(mesh, mesh.points, orientation)},
      {moved, measure_quality(mesh, moved, orientation)}, all_fixed, orientation, options);
  CHECK(held.positions == moved);
  const BestMeshResult free = find_best_mesh(
      mesh, {mesh.points, measure_quality(mesh, mesh.points, orientation)},
      {moved, measure_quality(mesh, moved, orientation)}, is_fixed, orientation, options);
  CHECK((free.positions - mesh.points).norm() < 1e-14);
}

// Layers a thousandth high bulge by 0.8 of that, at no loss that a scaled Jacobian shows. One row
// along them, straight, would leave a fifth of a layer below the next.
TEST_CASE("No row is made straight through layers that bulge beside it") {
  Mesh mesh = cube(CellType::Hexahedron, 4);
  mesh.points.col(2) *= 0.004;
  BestMeshOptions options;
  options.wall_rows.emplace_back();
  std::vector<char> is_fixed(mesh.node_count(), 0);
  for (Index n = 0; n < mesh.node_count(); ++n) {
    const Vector3d x = mesh.points.row(n);
    is_fixed[n] = x.x() == 0 || x.x() == 1;
    if (x.y() == 0.5 && x.z() == 0.002) options.wall_rows[0].push_back(n);
  }
  std::ranges::sort(options.wall_rows[0], {}, [&](Index n) { return mesh.points(n, 0); });
  REQUIRE(options.wall_rows[0].size() == 5);
  const Points moved = mapped(mesh.points, [](const Vector3d& x) {
    return Vector3d(x.x(), x.y(), x.z() + 0.0008 * std::sin(std::numbers::pi * x.x()));
  });
  REQUIRE(largest_deviation(options.wall_rows, mesh.points, moved) > 5e-4);
  const Orientation orientation = detect_orientation(mesh);
  const BestMeshResult best = find_best_mesh(
      mesh, {mesh.points, measure_quality(mesh, mesh.points, orientation)},
      {moved, measure_quality(mesh, moved, orientation)}, is_fixed, orientation, options);
  CHECK(best.positions == moved);
}

}  // namespace
}  // namespace cadmorph
