#include "core/quality_checks.h"

#include <algorithm>
#include <array>
#include <catch2/catch.hpp>

#include "sample_meshes.h"

namespace cadmorph {
namespace {

using namespace testing;

QualityChecks check(const Mesh& mesh) {
  const Orientation orientation = detect_orientation(mesh);
  return check_quality(mesh, mesh.points, find_cell_neighbours(mesh), orientation);
}

// Rounding of the unit cube's coordinates in angles of degrees.
constexpr double kRounding = 1e-6;

}  // namespace

TEST_CASE("A regular grid has no skewness, right angles and aspect one", "[core][checks]") {
  for (const CellType type : {CellType::Hexahedron, CellType::Voxel, CellType::Polyhedron}) {
    const QualityChecks checks = check(cube(type, 3));
    CHECK(checks.max_non_orthogonality_deg == Approx(0).margin(kRounding));
    CHECK(checks.max_skewness == Approx(0).margin(1e-9));
    CHECK(checks.max_aspect_ratio == Approx(1));
    CHECK(checks.min_volume == Approx(1.0 / 27));
  }
}

TEST_CASE("A sheared stack has the shear's angle, and its faces lie beside the line of centres",
          "[core][checks]") {
  Mesh mesh = cube(CellType::Hexahedron, 1);
  // Two cells along x: the second one's far side is shifted in y by two.
  mesh.points.resize(12, 3);
  for (int i = 0; i < 3; ++i)
    for (int k = 0; k < 2; ++k)
      for (int j = 0; j < 2; ++j)
        mesh.points.row(4 * i + 2 * k + j) = Eigen::RowVector3d(i, j + (i == 2 ? 2 : 0), k);
  const auto id = [](Index i, Index j, Index k) { return 4 * i + 2 * k + j; };
  mesh.connectivity.clear();
  for (Index i = 0; i < 2; ++i)
    for (const auto& [di, j, k] : {std::array<Index, 3>{0, 0, 0},
                                   {1, 0, 0},
                                   {1, 1, 0},
                                   {0, 1, 0},
                                   {0, 0, 1},
                                   {1, 0, 1},
                                   {1, 1, 1},
                                   {0, 1, 1}})
      mesh.connectivity.push_back(id(i + di, j, k));
  mesh.types.assign(2, CellType::Hexahedron);
  mesh.offsets = {0, 8, 16};
  mesh.regions.clear();
  const QualityChecks checks = check(mesh);
  // Centres (0.5, 0.5, 0.5) and (1.5, 1.5, 0.5): 45 degrees. The normal of the far side through the
  // second centre meets it at y = 1.5, twice its half width from its centre at 2.5.
  CHECK(checks.max_non_orthogonality_deg == Approx(45));
  CHECK(checks.mean_non_orthogonality_deg == Approx(45));
  CHECK(checks.max_skewness == Approx(2));
  CHECK(checks.worst_skew_cell == 1);
  CHECK(checks.severely_non_orthogonal == 0);
}

TEST_CASE("A box of 2 x 1 x 1 has aspect ratio 2", "[core][checks]") {
  Mesh mesh = cube(CellType::Hexahedron, 2);
  mesh.points.col(0) *= 2;
  CHECK(check(mesh).max_aspect_ratio == Approx(2));
  mesh.points.col(0) *= 1000;
  CHECK(check(mesh).high_aspect == mesh.cell_count());
}

TEST_CASE("The cells of every type fill the cube, in either node order", "[core][checks]") {
  for (const CellType type : solid_types()) {
    Mesh mesh = cube(type, 1);
    const double cells = static_cast<double>(mesh.cell_count());
    INFO("type " << static_cast<int>(type));
    CHECK(check(mesh).min_volume * cells == Approx(1));
    mesh.points.col(1) *= -1;
    CHECK(check(mesh).min_volume * cells == Approx(1));
  }
}

TEST_CASE("Each inner face has the cell on its other side as neighbour", "[core][checks]") {
  const Mesh mesh = cube(CellType::Hexahedron, 3);
  const CellNeighbours faces = find_cell_neighbours(mesh);
  REQUIRE(faces.neighbour.size() == 27 * 6);
  CHECK(std::count(faces.neighbour.begin(), faces.neighbour.end(), -1) == 54);
  // Cells i and j are neighbours when their centres are a third apart.
  for (Index c = 0; c < mesh.cell_count(); ++c)
    for (int local = 0; local < 6; ++local) {
      const Index other = faces.neighbour[6 * c + local];
      if (other < 0) continue;
      Eigen::RowVector3d gap = Eigen::RowVector3d::Zero();
      for (int i = 0; i < 8; ++i)
        gap += (mesh.points.row(mesh.cell(other)[i]) - mesh.points.row(mesh.cell(c)[i])) / 8;
      CHECK(gap.norm() == Approx(1.0 / 3));
      const auto facet = cell_facets(mesh, c)[local];
      for (const Index node : facet.nodes) CHECK(std::ranges::count(mesh.cell(other), node) == 1);
    }
}

}  // namespace cadmorph
