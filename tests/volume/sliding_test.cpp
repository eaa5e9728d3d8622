#include <Eigen/Geometry>
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <random>

#include "../core/sample_meshes.h"
#include "core/quality.h"
#include "volume/distortion.h"
#include "volume/untangle.h"
#include "volume_meshes.h"

namespace cadmorph {
namespace {

using namespace testing;
using Eigen::Vector2d;
using Eigen::Vector3d;

// A wavy roof over the unit square.
Vector3d roof(double x, double y) { return {x, y, 1 + 0.1 * std::sin(3 * x) * std::cos(2 * y)}; }

// The cube under that roof, whose nodes within the roof may slide on it.
struct RoofedCube {
  RoofedCube(CellType type, int n) : mesh(cube(type, n)), is_fixed(mesh.node_count(), 0) {
    mesh.points = mapped(mesh.points, [](const Vector3d& x) {
      return Vector3d(x[0], x[1], x[2] * roof(x[0], x[1])[2]);
    });
    orientation = detect_orientation(mesh);
    const Mesh flat = cube(type, n);
    for (const Index node : cube_surface(flat)) {
      is_fixed[node] = 1;
      const auto& x = flat.points;
      const double inside = std::min({x(node, 0), 1 - x(node, 0), x(node, 1), 1 - x(node, 1)});
      if (x(node, 2) > 1 - 1e-9 && inside > 1e-9) roof_nodes.push_back(node);
    }
  }

  // Shakes the roof's nodes along it by up to `amount`.
  Points shaken_roof(double amount, unsigned seed) const {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> shift(-amount, amount);
    Points positions = mesh.points;
    for (const Index node : roof_nodes) {
      const double x = positions(node, 0) + shift(random), y = positions(node, 1) + shift(random);
      positions.row(node) = roof(std::clamp(x, 0.01, 0.99), std::clamp(y, 0.01, 0.99)).transpose();
    }
    return positions;
  }

  SlidingNodes sliding(const Points& start) const {
    SlidingNodes result;
    result.nodes = roof_nodes;
    result.slides = RowMatrix::Zero(static_cast<Index>(roof_nodes.size()), 2);
    const auto at = [this, start](Index i, const Vector2d& slide) -> Vector2d {
      return start.row(roof_nodes[i]).head<2>().transpose() + slide;
    };
    result.at = [at](Index i, const Vector2d& slide) {
      const Vector2d x = at(i, slide);
      SlidePlace place{roof(x[0], x[1]), {}};
      place.tangents << 1, 0, 0, 1, 0.3 * std::cos(3 * x[0]) * std::cos(2 * x[1]),
          -0.2 * std::sin(3 * x[0]) * std::sin(2 * x[1]);
      return place;
    };
    result.is_within = [at](Index i, const Vector2d& slide) {
      const Vector2d x = at(i, slide);
      return x.minCoeff() >= 0 && x.maxCoeff() <= 1;
    };
    return result;
  }

  Mesh mesh;
  std::vector<char> is_fixed;
  Orientation orientation;
  std::vector<Index> roof_nodes;
};

}  // namespace

TEST_CASE("Facets that a surface folds are mended by nodes that slide on it",
          "[volume][untangle]") {
  for (const CellType type : {CellType::Tetra, CellType::Hexahedron, CellType::Wedge,
                              CellType::QuadraticTetra, CellType::Polyhedron})
    for (unsigned seed = 1; seed <= 2; ++seed) {
      INFO("type " << static_cast<int>(type) << " seed " << seed);
      const RoofedCube c(type, 4);
      const Points start = c.shaken_roof(0.3, seed);
      REQUIRE(check_validity(c.mesh, start, c.orientation).invalid > 0);
      if (type == CellType::Tetra)  // by inner nodes alone
        REQUIRE(untangle(c.mesh, start, c.is_fixed, c.orientation).report.after > 0);
      const SlidingNodes sliding = c.sliding(start);
      UntangleOptions options;
      options.sliding = &sliding;
      const UntangleResult result = untangle(c.mesh, start, c.is_fixed, c.orientation, options);
      CHECK(result.report.after == 0);
      CHECK(check_validity(c.mesh, result.positions, c.orientation).invalid == 0);
      CHECK(result.report.slid_nodes > 0);
      std::size_t on_roof = 0;
      Index fixed = 0;
      for (Index n = 0; n < c.mesh.node_count(); ++n) {
        const auto x = result.positions.row(n);
        if (std::ranges::binary_search(c.roof_nodes, n)) {
          ++on_roof;
          CHECK((x.transpose() - roof(x[0], x[1])).norm() < 1e-14);
        } else if (c.is_fixed[n]) {
          ++fixed;
          CHECK(x == start.row(n));
        }
      }
      CHECK(on_roof == c.roof_nodes.size());
      CHECK(fixed >= 98 - 9);  // the surface of 4 x 4 x 4 cells without the roof's inner nodes
    }
}

TEST_CASE("A further repair goes on from where nodes have slid", "[volume][untangle]") {
  const RoofedCube c(CellType::Tetra, 4);
  const Points start = c.shaken_roof(0.3, 1);
  SlidingNodes sliding = c.sliding(start);
  UntangleOptions options;
  options.sliding = &sliding;
  const UntangleResult first = untangle(c.mesh, start, c.is_fixed, c.orientation, options);
  REQUIRE(first.report.after == 0);
  sliding.slides = first.slides;
  const auto least = [&](const Points& positions) {
    return measure_quality(c.mesh, positions, c.orientation).min;
  };
  for (Index cell = 0; cell < c.mesh.cell_count(); ++cell) options.poor_cells.push_back(cell);
  options.attempts = 1;
  const UntangleResult second =
      untangle(c.mesh, first.positions, c.is_fixed, c.orientation, options);
  // What falls is the distortion of all cells, not that of the worst.
  CHECK(least(second.positions) >= 0.99 * least(first.positions));
  for (std::size_t i = 0; i < c.roof_nodes.size(); ++i) {
    const Vector3d x = second.positions.row(c.roof_nodes[i]);
    CHECK((x - roof(x[0], x[1])).norm() < 1e-14);
    const Vector2d from = start.row(c.roof_nodes[i]).head<2>();
    CHECK((x.head<2>() - from - second.slides.row(i).transpose()).norm() < 1e-12);
  }
}

TEST_CASE("Nodes do not slide beyond their surface", "[volume][untangle]") {
  const RoofedCube c(CellType::Tetra, 5);
  const Points start = c.shaken_roof(0.2, 1);
  SlidingNodes sliding = c.sliding(start);
  UntangleOptions options;
  options.sliding = &sliding;
  // Half of the roof's nodes have nowhere to go.
  sliding.is_within = [](Index i, const Vector2d&) { return i % 2 == 0; };
  const UntangleResult result = untangle(c.mesh, start, c.is_fixed, c.orientation, options);
  CHECK(result.report.after <= result.report.before);
  for (std::size_t i = 1; i < c.roof_nodes.size(); i += 2)
    CHECK(result.positions.row(c.roof_nodes[i]) == start.row(c.roof_nodes[i]));
}

TEST_CASE("The distortion's gradient is its derivative, along the surface too",
          "[volume][untangle]") {
  const RoofedCube c(CellType::Tetra, 3);
  const Points start = c.shaken_roof(0.1, 3);
  const SlidingNodes sliding = c.sliding(start);
  std::vector<Index> nodes, cells;
  for (Index n = 0; n < c.mesh.node_count(); ++n)
    if (!c.is_fixed[n] || std::ranges::binary_search(c.roof_nodes, n)) nodes.push_back(n);
  for (Index cell = 0; cell < c.mesh.cell_count(); ++cell) cells.push_back(cell);
  const FreeNodes free(c.mesh.node_count(), nodes, &sliding);
  const RowMatrix slides = RowMatrix::Zero(static_cast<Index>(sliding.nodes.size()), 2);
  Eigen::VectorXd x = free.start(start, slides);
  REQUIRE(x.size() == 3 * 8 + 2 * 4);
  Distortion distortion(c.mesh, start, free, cells, c.orientation);
  x.array() += 0.01;  // off the start, where the tangents are others
  const double epsilon = 0.1, step = 1e-6;
  Eigen::VectorXd gradient, unused;
  distortion(x, epsilon, gradient);
  for (Index i = 0; i < x.size(); ++i) {
    Eigen::VectorXd there = x, back = x;
    there[i] += step;
    back[i] -= step;
    const double slope =
        (distortion(there, epsilon, unused) - distortion(back, epsilon, unused)) / (2 * step);
    CHECK(gradient[i] == Approx(slope).epsilon(1e-5).margin(1e-4));
  }
}

}  // namespace cadmorph
