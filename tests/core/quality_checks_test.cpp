#include "core/quality_checks.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include "core/errors.h"
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

// A row of hexahedra of width 1 along x, whose sides are shifted in y by `shifts`.
Mesh stack(const std::vector<double>& shifts) {
  const Index sides = std::ssize(shifts), cells = sides - 1;
  Mesh mesh;
  mesh.points.resize(4 * sides, 3);
  for (Index i = 0; i < sides; ++i)
    for (int k = 0; k < 2; ++k)
      for (int j = 0; j < 2; ++j)
        mesh.points.row(4 * i + 2 * k + j) = Eigen::RowVector3d(i, j + shifts[i], k);
  mesh.types.assign(cells, CellType::Hexahedron);
  mesh.offsets = {0};
  for (Index i = 0; i < cells; ++i) {
    for (const Index node : {0, 4, 5, 1, 2, 6, 7, 3}) mesh.connectivity.push_back(4 * i + node);
    mesh.offsets.push_back(8 * (i + 1));
  }
  return mesh;
}

// The mesh with its cells 0, `every`, 2 `every`, ... written as hexahedra.
Mesh with_collapsed_hexahedra(const Mesh& wedges, int every) {
  Mesh mesh = wedges;
  mesh.connectivity.clear();
  mesh.offsets = {0};
  for (Index c = 0; c < wedges.cell_count(); ++c) {
    const auto w = wedges.cell(c);
    if (c % every == 0) {
      mesh.types[c] = CellType::Hexahedron;
      for (const int i : {0, 2, 1, 1, 3, 5, 4, 4}) mesh.connectivity.push_back(w[i]);
    } else {
      mesh.connectivity.insert(mesh.connectivity.end(), w.begin(), w.end());
    }
    mesh.offsets.push_back(std::ssize(mesh.connectivity));
  }
  return mesh;
}

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
  // The second cell's far side is shifted in y by two.
  const QualityChecks checks = check(stack({0, 0, 2}));
  // Centres (0.5, 0.5, 0.5) and (1.5, 1.5, 0.5): 45 degrees. The normal of the far side through the
  // second centre meets it at y = 1.5, twice its half width from its centre at 2.5.
  CHECK(checks.max_non_orthogonality_deg == Approx(45));
  CHECK(checks.mean_non_orthogonality_deg == Approx(45));
  CHECK(checks.max_skewness == Approx(2));
  CHECK(checks.worst_skew_cell == 1);
  CHECK(checks.severely_non_orthogonal == 0);
}

TEST_CASE("The mean angle is that of the mean cosine, as in checkMesh", "[core][checks]") {
  const double mean = (std::cos(std::numbers::pi / 4) + 1) / 2;  // of 45 and 0 degrees
  CHECK(check(stack({0, 0, 2, 0})).mean_non_orthogonality_deg ==
        Approx(std::acos(mean) * 180 / std::numbers::pi));
}

TEST_CASE("On the outside a skewed line counts in 0.4 of its way from the centre to the face",
          "[core][checks]") {
  // A column of height 10 whose top is shifted by 8: its ends lie 4 beside the centre's normal,
  // of length 5; their half width is 0.5 only.
  Mesh mesh = cube(CellType::Hexahedron, 1);
  mesh.points.col(0) += 8 * mesh.points.col(2);
  mesh.points.col(2) *= 10;
  CHECK(check(mesh).max_skewness == Approx(4 / (0.4 * 5)));
}

TEST_CASE("A neighbour's centre behind the face they share is more than 90 degrees off",
          "[core][checks]") {
  Points points(5, 3);
  points << 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 2, 0, 3;
  Mesh mesh = single_cell(CellType::Tetra, points);
  mesh.types.assign(2, CellType::Tetra);
  mesh.connectivity = {0, 1, 2, 3, 0, 2, 1, 4};  // the second stands on its head
  mesh.offsets = {0, 4, 8};
  for (const int orientation : {1, -1}) {
    mesh.points.col(2) = orientation * points.col(2);
    const QualityChecks checks =
        check_quality(mesh, mesh.points, find_cell_neighbours(mesh), Orientation(256, orientation));
    // From (1, 1, 1) / 4 to (3, 1, 3) / 4, against the normal (0, 0, -1) of the first cell.
    CHECK(checks.max_non_orthogonality_deg == Approx(135));
    CHECK(checks.mean_non_orthogonality_deg == Approx(135));
    CHECK(checks.severely_non_orthogonal == 1);
  }
}

TEST_CASE("Wedges written as hexahedra that name two nodes twice have the figures of wedges",
          "[core][checks]") {
  Mesh wedges = cube(CellType::Wedge, 3);
  wedges.points = shaken(wedges.points, 0.05, 1);
  const QualityChecks expected = check(wedges);
  for (const int every : {1, 2}) {  // all of them, every second one
    const Mesh mesh = with_collapsed_hexahedra(wedges, every);
    const QualityChecks checks = check(mesh);
    INFO("one in " << every);
    CHECK(checks.max_non_orthogonality_deg == Approx(expected.max_non_orthogonality_deg));
    CHECK(checks.mean_non_orthogonality_deg == Approx(expected.mean_non_orthogonality_deg));
    CHECK(checks.max_skewness == Approx(expected.max_skewness));
    CHECK(checks.highly_skew == expected.highly_skew);
    CHECK(checks.max_aspect_ratio == Approx(expected.max_aspect_ratio));
    CHECK(checks.min_volume == Approx(expected.min_volume));
    CHECK(checks.worst_skew_cell == expected.worst_skew_cell);
    // As many faces are open as in the mesh of wedges.
    const CellNeighbours faces = find_cell_neighbours(mesh);
    CHECK(std::ranges::count(faces.neighbour, -1) ==
          std::ranges::count(find_cell_neighbours(wedges).neighbour, -1));
  }
}

TEST_CASE("A cell without extent leaves the figures of the others", "[core][checks]") {
  Mesh mesh = cube(CellType::Hexahedron, 2);
  const QualityChecks expected = check(mesh);
  Points points = mesh.points;
  // One more cell, of eight nodes in one place.
  points.conservativeResize(points.rows() + 8, 3);
  points.bottomRows(8).setConstant(0.5);
  for (Index n = mesh.node_count(); n < points.rows(); ++n) mesh.connectivity.push_back(n);
  mesh.points = points;
  mesh.types.push_back(CellType::Hexahedron);
  mesh.offsets.push_back(std::ssize(mesh.connectivity));
  const QualityChecks checks = check(mesh);
  CHECK(checks.max_skewness == expected.max_skewness);
  CHECK(checks.highly_skew == 0);
  CHECK(checks.mean_non_orthogonality_deg == expected.mean_non_orthogonality_deg);
  CHECK(checks.min_volume == 0);
  CHECK(checks.max_aspect_ratio == std::numeric_limits<double>::infinity());
  CHECK(checks.worst_aspect_cell == 8);
  CHECK(checks.high_aspect == 1);
}

TEST_CASE("Checks of positions that do not fit the mesh are refused", "[core][checks]") {
  const Mesh mesh = cube(CellType::Hexahedron, 1);
  const auto checked = [&](const Points& points) {
    return check_quality(mesh, points, find_cell_neighbours(mesh), detect_orientation(mesh));
  };
  REQUIRE_THROWS_AS(checked(mesh.points.topRows(7)), InvalidInputError);
  Points points = mesh.points;
  points(3, 1) = std::numeric_limits<double>::quiet_NaN();
  REQUIRE_THROWS_WITH(checked(points), Catch::Contains("node 3"));
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
