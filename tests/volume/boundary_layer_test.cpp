#include <Eigen/Geometry>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>

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
  const LayerFigures none = measure_layers(mesh, neighbours, is_border, mesh.points, higher);
  CHECK(none.cells == 0);  // the border rests
  CHECK(change_of_heights(mesh, neighbours, is_border, mesh.points, higher) == Approx(std::log(2)));
  higher.col(2) *= 0.504;
  CHECK(change_of_heights(mesh, neighbours, is_border, mesh.points, higher) == 0);
  higher.col(2) /= 0.504;
  higher.col(2).array() += 1;
  const LayerFigures moved = measure_layers(mesh, neighbours, is_border, mesh.points, higher);
  CHECK(moved.cells == (kSide - 1) * (kSide - 1));
  CHECK(moved.most == Approx(2));
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
  CHECK(on_floor(1.0).first.empty());
  CHECK(on_floor(0.8).first.empty());
}

}  // namespace cadmorph
