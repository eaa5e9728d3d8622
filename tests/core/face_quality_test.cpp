#include "core/face_quality.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>

#include "core/quality_checks.h"
#include "sample_meshes.h"

namespace cadmorph {
namespace {

using namespace testing;

double degrees(double cosine) { return std::acos(cosine) * 180 / std::numbers::pi; }

}  // namespace

TEST_CASE("The worst face of all cells is the worst that checkMesh tells of", "[core][checks]") {
  for (const CellType type : solid_types()) {
    const Mesh mesh = cube(type, 4);
    INFO(static_cast<int>(type));
    const CellNeighbours neighbours = find_cell_neighbours(mesh);
    const Orientation orientation = detect_orientation(mesh);
    const FiniteVolumes volumes(mesh, mesh.points, neighbours, orientation);
    for (const double amount : {0.01, 0.03, 0.06}) {
      const Points moved = shaken(mesh.points, amount, 3);
      const QualityChecks checks = check_quality(mesh, moved, neighbours, orientation);
      const std::vector<double> values = face_quality(volumes, moved);
      const auto worst = std::ranges::min_element(values);
      const double by_skewness =
          std::atan(checks.max_skewness / 4 * std::tan(70 * std::numbers::pi / 180)) * 180 /
          std::numbers::pi;
      CHECK(degrees(*worst) ==
            Approx(std::max(checks.max_non_orthogonality_deg, by_skewness)).epsilon(1e-9));
      CHECK(face_angle(*worst) == Approx(degrees(*worst)));
    }
  }
}

TEST_CASE("At the limits of checkMesh both figures of a face are the same", "[core][checks]") {
  CHECK(1 / std::sqrt(1 + std::pow(4 * finite_volume::kSkewnessSlope, 2)) ==
        Approx(std::cos(70 * std::numbers::pi / 180)));
}

TEST_CASE("After some cells moved the figures of faces are those measured anew", "[core][checks]") {
  for (const CellType type : solid_types()) {
    const Mesh mesh = cube(type, 4);
    const CellNeighbours neighbours = find_cell_neighbours(mesh);
    const Orientation orientation = detect_orientation(mesh);
    const FiniteVolumes volumes(mesh, mesh.points, neighbours, orientation);
    const Index node = mesh.cell(mesh.cell_count() / 2)[0];
    std::vector<Index> around;
    for (Index c = 0; c < mesh.cell_count(); ++c)
      if (std::ranges::count(mesh.cell(c), node) > 0) around.push_back(c);
    Points moved = mesh.points;
    moved.row(node) += Eigen::RowVector3d(0.03, 0.02, -0.01);
    const std::vector<double> before = face_quality(volumes, mesh.points);
    const std::vector<double> after = face_quality(volumes, moved);
    CHECK(after != before);
    CHECK(face_quality_again(before, volumes, moved, around) == after);
  }
}

TEST_CASE("A mesh in a plane has the figures of one layer of solid cells, edges have none",
          "[core][checks]") {
  // Two squares beside each other, the second one sheared by 45 degrees.
  Mesh mesh;
  mesh.points.resize(6, 3);
  mesh.points << 0, 0, 0, 1, 0, 0, 2, 1, 0, 0, 1, 0, 1, 1, 0, 2, 2, 0;
  add_cell(mesh, CellType::Quad, {{0, 1, 4, 3}});
  add_cell(mesh, CellType::Quad, {{1, 2, 5, 4}});
  add_cell(mesh, CellType::Line, {{0, 1}});
  const CellNeighbours none = find_cell_neighbours(mesh);
  const Orientation orientation = detect_orientation(mesh);
  const FiniteVolumes volumes(mesh, mesh.points, none, orientation);
  REQUIRE(volumes.is_layer());
  const std::vector<double> values = face_quality(volumes, mesh.points);
  REQUIRE(values.size() == 3);
  // From (0.5, 0.5) to (1.5, 1) through a face along y.
  CHECK(values[0] == Approx(2 / std::sqrt(5.0)));
  CHECK(values[1] <= values[0]);
  CHECK(std::isnan(values[2]));
}

}  // namespace cadmorph
