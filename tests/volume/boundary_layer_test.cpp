#include <Eigen/Geometry>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <random>

#include "../core/sample_meshes.h"
#include "core/layer_heights.h"
#include "core/validity.h"
#include "volume/volume_morph.h"
#include "volume_meshes.h"

namespace cadmorph {
namespace {

using namespace testing;
using Eigen::Vector3d;

}  // namespace

TEST_CASE("Layers of 1e-6 of the part survive a move by the iterative solver", "[volume][layers]") {
  const Mesh mesh = graded_layers(14, 1e-6);
  const Orientation orientation = detect_orientation(mesh);
  REQUIRE(check_validity(mesh, mesh.points, orientation).invalid == 0);
  const auto surface = cube_surface(mesh);
  const Points target = mapped(rows_of(mesh.points, surface), wave);
  RbfReport report;
  const VolumeMorph morph(mesh, surface, {.rbf = {.solver = SolverKind::Fast}});
  const Points result = morph.morph(target, &report);
  CHECK(report.solver == SolverKind::Fast);
  CHECK(check_validity(mesh, result, orientation).invalid == 0);
  // What a tolerance of 1e-6 of the part admits would not do.
  CHECK(check_validity(mesh, shaken(result, 1e-6, 1), orientation).invalid > 0);
  // Nor would an interpolant whose residuals on the floor are up to that, though these nodes are
  // then put where they belong: the nodes above them, 1e-6 away, keep the error.
  const Points noisy = shaken(target, 1e-6, 1);
  Points inexact = target;
  for (std::size_t i = 0; i < surface.size(); ++i) {
    const Vector3d x = mesh.points.row(surface[i]).transpose();
    const bool is_wall = (x.head<2>().array() - 0.5).abs().maxCoeff() > 0.49;
    if (x[2] == 0 && !is_wall) inexact.row(i) = noisy.row(i);
  }
  Points loose = morph.morph(inexact);
  for (std::size_t i = 0; i < surface.size(); ++i) loose.row(surface[i]) = target.row(i);
  CHECK(check_validity(mesh, loose, orientation).invalid > 0);
}

TEST_CASE("Heights and growth of layers are compared", "[volume][layers]") {
  const Mesh mesh = graded_layers(6, 1e-3);
  const CellNeighbours neighbours = find_cell_neighbours(mesh);
  std::vector<char> is_floor(static_cast<std::size_t>(mesh.node_count()), 0);
  for (Index n = 0; n < mesh.node_count(); ++n) is_floor[n] = mesh.points(n, 2) == 0;
  const auto measured = [&](const std::function<Vector3d(const Vector3d&)>& map) {
    return measure_layers(mesh, neighbours, is_floor, mesh.points, mapped(mesh.points, map));
  };
  const LayerFigures still = measured([](const Vector3d& x) { return x; });
  CHECK(still.cells == 0);
  const Eigen::AngleAxisd turn(1, Vector3d(1, 2, 3).normalized());
  const LayerFigures turned = measured([&](const Vector3d& x) -> Vector3d { return turn * x; });
  CHECK(turned.cells > 0);
  CHECK(turned.share_kept == 1);
  CHECK(turned.growth_after == Approx(turned.growth_before));
  const LayerFigures high = measured([](const Vector3d& x) -> Vector3d {
    return {x[0] + 1, x[1], 1.5 * x[2]};
  });
  CHECK(high.cells == turned.cells);
  CHECK(high.share_kept == 0);
  CHECK(high.least == Approx(1.5));
  CHECK(high.most == Approx(1.5));
  CHECK(high.growth_after == Approx(high.growth_before));
  CHECK(high.lean_before == Approx(0).margin(1e-9));
  CHECK(high.lean_after == Approx(0).margin(1e-9));
  const LayerFigures sheared = measured([](const Vector3d& x) -> Vector3d {
    return {x[0] + x[2] + 1, x[1], x[2]};
  });
  CHECK(sheared.share_kept == 1);
  CHECK(sheared.lean_after == Approx(45));
  // Six layers from 1e-3 to 1, each 1000^(1/5) times as high, from the floor, as the one before.
  const double factor = std::pow(1000, 0.2);
  CHECK(high.growth_before == Approx(factor - 1));
}

TEST_CASE("Layers stand on the border between regions, too", "[volume][layers]") {
  const std::vector<double> levels = {-3, -2, -1, 0, 0.1, 0.22, 0.364, 0.537, 0.744};
  constexpr Index kSide = 4, kLevel = kSide * kSide;
  Mesh mesh;
  mesh.points.resize(kLevel * std::ssize(levels), 3);
  std::vector<char> is_border(mesh.points.rows(), 0);
  std::vector<Index> expected;
  for (std::size_t k = 0; k < levels.size(); ++k)
    for (Index i = 0; i < kLevel; ++i) {
      const Index node = Index(k) * kLevel + i;
      mesh.points.row(node) << double(i % kSide), double(i / kSide), levels[k];
      is_border[node] = levels[k] == 0;
      if (levels[k] >= 0) expected.push_back(node);
    }
  for (std::size_t k = 0; k + 1 < levels.size(); ++k)
    for (Index j = 0; j + 1 < kSide; ++j)
      for (Index i = 0; i + 1 < kSide; ++i) {
        const Index a = Index(k) * kLevel + j * kSide + i, b = a + kLevel;
        add_cell(
            mesh, CellType::Hexahedron,
            std::array{a, a + 1, a + kSide + 1, a + kSide, b, b + 1, b + kSide + 1, b + kSide});
        mesh.regions.push_back(levels[k] < 0 ? 1 : 2);
      }
  const CellNeighbours neighbours = find_cell_neighbours(mesh);
  CHECK(nodes_of_layers(mesh, neighbours, is_border, mesh.points).all == expected);
  const LayerColumns layers = find_layer_columns(mesh, neighbours, is_border, mesh.points);
  CHECK(layers.columns.size() == kLevel);
  for (const LayerColumn& column : layers.columns) CHECK(column.nodes.size() == 5);
  Points higher = mesh.points;
  higher.col(2) *= 2;
  const auto measured = [&] {
    return measure_layers(mesh, neighbours, is_border, mesh.points, higher);
  };
  // The border rests, the cells on it do not.
  CHECK(measured().cells == (kSide - 1) * (kSide - 1));
  CHECK(measured().least == Approx(2));
  CHECK(measured().most == Approx(2));
  CHECK(change_of_heights(mesh, neighbours, is_border, mesh.points, higher) == Approx(std::log(2)));
  higher.col(2) *= 0.504;
  CHECK(change_of_heights(mesh, neighbours, is_border, mesh.points, higher) == 0);
  CHECK(measured().cells == 0);
  higher.col(2) /= 0.504;
  higher.col(2).array() += 1;
  CHECK(measured().cells == (kSide - 1) * (kSide - 1));
  CHECK(measured().most == Approx(2));
  mesh.regions.clear();
  CHECK(nodes_of_layers(mesh, neighbours, is_border, mesh.points).all.empty());
}

TEST_CASE("Layers are told by their growth", "[volume][layers]") {
  // Heights of the six cells on the floor: 1, g, g^2, ... of a thousandth, the last two three
  // times as high.
  const auto on_floor = [](double growth) {
    Mesh mesh = graded_layers(6, 1e-3);
    std::vector<char> is_floor(static_cast<std::size_t>(mesh.node_count()), 0);
    const double factor = std::pow(1000, 0.2);
    for (Index n = 0; n < mesh.node_count(); ++n) {
      is_floor[n] = mesh.points(n, 2) == 0;
      if (is_floor[n]) continue;
      const double layer = std::round(std::log(mesh.points(n, 2) / 1e-3) / std::log(factor));
      double height = 0;
      for (int k = 0; k <= int(layer); ++k) height += (k < 4 ? 1e-3 : 3e-3) * std::pow(growth, k);
      mesh.points(n, 2) = height;
    }
    double top = 0;
    for (int k = 0; k < 4; ++k) top += 1e-3 * std::pow(growth, k);
    std::vector<Index> expected;
    for (Index n = 0; n < mesh.node_count(); ++n)
      if (mesh.points(n, 2) < 1.001 * top) expected.push_back(n);
    return std::pair(nodes_of_layers(mesh, find_cell_neighbours(mesh), is_floor, mesh.points).all,
                     expected);
  };
  for (const double growth : {1.2, 1.5}) {
    const auto [found, expected] = on_floor(growth);
    CHECK(found.size() > 10);
    CHECK(found == expected);
  }
  CHECK(on_floor(1.05).first.empty());
  CHECK(on_floor(1.0).first.empty());
  CHECK(on_floor(0.8).first.empty());
}

namespace {

// Columns of cells 1 wide on a floor of kSide x kSide squares, higher from one to the next by the
// growth of their part of the floor; nodes are shaken by `noise` of their cells' heights.
struct Columns {
  static constexpr Index kSide = 8, kRow = kSide + 1;
  double first = 0.01, noise = 0;
  int cells = 12;

  Mesh mesh(double growth, double growth_beyond) const {
    Mesh mesh;
    mesh.points.resize(kRow * kRow * (cells + 1), 3);
    std::mt19937 random(1);
    std::uniform_real_distribution<double> shake(-noise, noise);
    for (Index n = 0; n < kRow * kRow; ++n) {
      const double rate = n % kRow <= kSide / 2 ? growth : growth_beyond;
      double z = 0, height = first;
      for (int k = 0; k <= cells; ++k, height *= rate) {
        mesh.points.row(k * kRow * kRow + n) << double(n % kRow), double(n / kRow),
            z + (k == 0 ? 0 : shake(random) * height);
        z += height;
      }
    }
    for (int k = 0; k < cells; ++k)
      for (Index j = 0; j < kSide; ++j)
        for (Index i = 0; i < kSide; ++i) {
          const Index a = (k * kRow + j) * kRow + i, b = a + kRow * kRow;
          add_cell(mesh, CellType::Hexahedron,
                   std::array{a, a + 1, a + kRow + 1, a + kRow, b, b + 1, b + kRow + 1, b + kRow});
        }
    return mesh;
  }

  static LayerColumns found(const Mesh& mesh) {
    std::vector<char> is_floor(mesh.node_count(), 0);
    for (Index n = 0; n < kRow * kRow; ++n) is_floor[n] = 1;
    return find_layer_columns(mesh, find_cell_neighbours(mesh), is_floor, mesh.points);
  }
};

}  // namespace

TEST_CASE("Layers that grow by less are told by what they grow in all", "[volume][layers]") {
  constexpr std::size_t kAll = Columns::kRow * Columns::kRow;
  const auto found = [](const Columns& columns, double growth, double growth_beyond) {
    return Columns::found(columns.mesh(growth, growth_beyond)).columns.size();
  };
  CHECK(found({.cells = 20}, 1.05, 1.05) == kAll);  // 1.05^15 = 2.08
  CHECK(found({.cells = 12}, 1.08, 1.08) == kAll);
  CHECK(found({.cells = 12}, 1.03, 1.03) == 0);  // 1.03^11 = 1.38
  CHECK(found({.cells = 3}, 1.08, 1.08) == 0);
  // Uniform cells, thin as they are, and shaken ones.
  CHECK(found({.cells = 60}, 1, 1) == 0);
  CHECK(found({.noise = 0.02, .cells = 60}, 1, 1) == 0);
  // Rounding of heights at the limit parts no wall.
  CHECK(found({.noise = 1e-3, .cells = 3}, 1.1, 1.1) == kAll);
  CHECK(found({.noise = 1e-3, .cells = 12}, 1.1, 1.1) == kAll);
  // A wall whose cells grow less goes on from one that is sure, but not where they don't grow.
  CHECK(found({.cells = 3}, 1.15, 1.07) == kAll);
  // Between the two parts of the floor the mean of both: one row more.
  CHECK(found({.cells = 12}, 1.15, 1) == (Columns::kSide / 2 + 2) * Columns::kRow);
}

TEST_CASE("Layers that grow by less end where their cells do no longer", "[volume][layers]") {
  // From both walls of a channel to its middle.
  Columns half{.cells = 24};
  Mesh mesh = half.mesh(1.08, 1.08);
  constexpr Index kLevel = Columns::kRow * Columns::kRow;
  const double middle = mesh.points(kLevel * 12, 2);
  for (int k = 13; k <= 24; ++k)
    for (Index n = 0; n < kLevel; ++n)
      mesh.points(k * kLevel + n, 2) = 2 * middle - mesh.points((24 - k) * kLevel + n, 2);
  const LayerColumns layers = Columns::found(mesh);
  CHECK(layers.columns.size() == std::size_t(kLevel));
  for (const LayerColumn& column : layers.columns) CHECK(column.nodes.size() == 12);
}

}  // namespace cadmorph
