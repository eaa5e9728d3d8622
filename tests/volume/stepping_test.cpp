#include "volume/stepping.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>

#include "../core/sample_meshes.h"
#include "core/boundary.h"
#include "core/errors.h"
#include "core/mesh_file.h"
#include "volume/held_cells.h"
#include "volume_meshes.h"

namespace cadmorph {
namespace {

using namespace testing;
using Eigen::Vector3d;

// A layer of n x n hexahedra over the unit square with a square of it held as a block: the sides of
// the square and the block are prescribed (Sieger et al. 2013, fig. 8, top).
struct BlockInPlane {
  explicit BlockInPlane(int n) : mesh(cube(CellType::Hexahedron, n)) {
    Mesh layer;
    std::vector<Index> id(mesh.node_count(), -1);
    for (Index c = 0; c < mesh.cell_count(); ++c) {
      double top = 0;
      for (const Index node : mesh.cell(c)) top = std::max(top, mesh.points(node, 2));
      if (top > 1.5 / n) continue;
      layer.types.push_back(CellType::Hexahedron);
      for (const Index node : mesh.cell(c)) layer.connectivity.push_back(node);
    }
    Index used = 0;
    for (Index& node : layer.connectivity) {
      if (id[node] < 0) id[node] = used++;
      node = id[node];
    }
    layer.points.resize(used, 3);
    for (Index node = 0; node < mesh.node_count(); ++node)
      if (id[node] >= 0) layer.points.row(id[node]) = mesh.points.row(node);
    for (std::size_t c = 0; c <= layer.types.size(); ++c)
      layer.offsets.push_back(8 * static_cast<Index>(c));
    mesh = layer;
    for (Index node = 0; node < used; ++node) {
      const double x = mesh.points(node, 0), y = mesh.points(node, 1);
      const bool is_side = std::max(std::abs(x - 0.5), std::abs(y - 0.5)) > 0.5 - 1e-9;
      const bool is_block = std::max(std::abs(x - 0.5), std::abs(y - 0.5)) < 0.1 + 1e-9;
      if (is_side || is_block) prescribed.push_back(node);
      if (is_block) block.push_back(static_cast<Index>(prescribed.size()) - 1);
    }
  }

  Points moved(const std::function<Vector3d(const Vector3d&)>& map) const {
    Points result = rows_of(mesh.points, prescribed);
    for (const Index row : block) result.row(row) = map(result.row(row).transpose()).transpose();
    return result;
  }

  Mesh mesh;
  std::vector<Index> prescribed;
  std::vector<Index> block;  ///< rows of `prescribed`
};

Vector3d turned(const Vector3d& x, double angle) {
  const Vector3d centre(0.5, 0.5, 0);
  return centre + Eigen::AngleAxisd(angle, Vector3d::UnitZ()) * (x - centre);
}

}  // namespace

TEST_CASE("A small move takes one step", "[volume][stepping]") {
  const BlockInPlane plane(20);
  const VolumeMorph morph(plane.mesh, plane.prescribed);
  const Points target =
      plane.moved([](const Vector3d& x) -> Vector3d { return x + Vector3d(0.05, 0.02, 0); });
  const auto result = morph_in_steps(plane.mesh, morph, target, detect_orientation(plane.mesh));
  CHECK(result.report.steps == 1);
  CHECK(result.report.attempts.size() == 1);
  CHECK(result.report.validity.invalid == 0);
  CHECK(result.positions == morph.morph(target));
}

TEST_CASE("A block moved far in a plane inverts in one step and not in several",
          "[volume][stepping]") {
  const BlockInPlane plane(20);
  const Orientation orientation = detect_orientation(plane.mesh);
  const VolumeMorph morph(plane.mesh, plane.prescribed);
  const Points target =
      plane.moved([](const Vector3d& x) -> Vector3d { return x + Vector3d(0.34, 0, 0); });
  const auto one = morph_in_steps(plane.mesh, morph, target, orientation, {.steps = 1});
  CHECK(one.report.validity.invalid > 0);
  const auto stepped = morph_in_steps(plane.mesh, morph, target, orientation);
  CHECK(stepped.report.validity.invalid == 0);
  CHECK(stepped.report.steps > 1);
  CHECK(measure_quality(plane.mesh, stepped.positions, orientation).inverted == 0);
  CHECK(rows_of(stepped.positions, plane.prescribed) == target);
  // One attempt for each number of steps.
  for (std::size_t i = 0; i < stepped.report.attempts.size(); ++i)
    CHECK(stepped.report.attempts[i].steps == static_cast<int>(i) + 1);
}

TEST_CASE("A sphere moved in a box of tetrahedra inverts in one step and not in several",
          "[volume][stepping]") {
  const MeshFile file(std::filesystem::path(CADMORPH_SOURCE_DIR) /
                      "models/shapes/sphere_in_box.vtu");
  const Mesh& mesh = file.mesh();
  const Orientation orientation = detect_orientation(mesh);
  const std::vector<Index> surface = extract_boundary(mesh).nodes;
  const Vector3d lower = mesh.points.colwise().minCoeff(), upper = mesh.points.colwise().maxCoeff();
  const double diagonal = (upper - lower).norm();
  Points target = rows_of(mesh.points, surface);
  std::vector<Index> sphere;
  for (Index i = 0; i < target.rows(); ++i) {
    const Vector3d x = target.row(i).transpose();
    const double to_box = std::min((x - lower).minCoeff(), (upper - x).minCoeff());
    if (to_box > 1e-6 * diagonal) sphere.push_back(i);
  }
  REQUIRE(sphere.size() > 20);
  const Points ball = rows_of(target, sphere);
  const double gap = upper[0] - ball.col(0).maxCoeff();
  for (const Index row : sphere) target(row, 0) += 0.93 * gap;

  const VolumeMorph morph(mesh, surface);
  const auto one = morph_in_steps(mesh, morph, target, orientation, {.steps = 1});
  CHECK(one.report.validity.invalid > 0);
  const auto stepped = morph_in_steps(mesh, morph, target, orientation, {.max_steps = 12});
  CHECK(stepped.report.validity.invalid == 0);
  CHECK(stepped.report.steps > 1);
  CHECK(rows_of(stepped.positions, surface) == target);
}

TEST_CASE("A path is followed instead of the chord", "[volume][stepping]") {
  const BlockInPlane plane(20);
  const Orientation orientation = detect_orientation(plane.mesh);
  const VolumeMorph morph(plane.mesh, plane.prescribed);
  const double angle = std::numbers::pi / 2;
  const auto at = [&](double s) {
    return plane.moved([&](const Vector3d& x) { return turned(x, s * angle); });
  };
  std::vector<double> asked;
  const auto path = [&](double s) {
    asked.push_back(s);
    return at(s);
  };
  const auto result = morph_in_steps(plane.mesh, morph, {at(1), path}, orientation, {.steps = 4});
  CHECK(asked == std::vector<double>{0.25, 0.5, 0.75});
  CHECK(rows_of(result.positions, plane.prescribed) == at(1));
  CHECK(result.report.validity.invalid == 0);
}

TEST_CASE("When no number of steps helps, the best attempt is kept", "[volume][stepping]") {
  const BlockInPlane plane(20);
  const Orientation orientation = detect_orientation(plane.mesh);
  const VolumeMorph morph(plane.mesh, plane.prescribed);
  // Out of the square: no valid mesh exists.
  const Points target =
      plane.moved([](const Vector3d& x) -> Vector3d { return x + Vector3d(0.7, 0, 0); });
  const auto result = morph_in_steps(plane.mesh, morph, target, orientation,
                                     {.max_steps = 3, .least_gain_share = 1});
  REQUIRE(result.report.attempts.size() == 3);
  Index fewest = result.report.attempts.front().inverted;
  for (const SteppingAttempt& attempt : result.report.attempts)
    fewest = std::min(fewest, attempt.inverted);
  CHECK(result.report.validity.invalid == fewest);
  CHECK(result.report.attempts[result.report.steps - 1].inverted == fewest);
  CHECK(check_validity(plane.mesh, result.positions, orientation).invalid == fewest);
}

TEST_CASE("Attempts end when one more step gains little, or few elements are left",
          "[volume][stepping]") {
  const BlockInPlane plane(20);
  const Orientation orientation = detect_orientation(plane.mesh);
  const VolumeMorph morph(plane.mesh, plane.prescribed);
  const auto moved = [&](double way) {
    return plane.moved([&](const Vector3d& x) -> Vector3d { return x + Vector3d(way, 0, 0); });
  };
  // Out of the square: steps can't help.
  const auto out = morph_in_steps(plane.mesh, morph, moved(0.7), orientation, {.max_steps = 20});
  const auto& tried = out.report.attempts;
  REQUIRE(tried.size() > 1);
  CHECK(tried.size() < 20);
  CHECK(tried.back().inverted - tried.back().held >
        0.75 * (tried[tried.size() - 2].inverted - tried[tried.size() - 2].held));
  const auto one = morph_in_steps(plane.mesh, morph, moved(0.34), orientation, {.steps = 1});
  const Index left = one.report.validity.invalid;
  REQUIRE(left > 1);
  const auto enough = morph_in_steps(plane.mesh, morph, moved(0.34), orientation, {.few = left});
  CHECK(enough.report.attempts.size() == 1);
  const auto more = morph_in_steps(plane.mesh, morph, moved(0.34), orientation, {.few = left - 1});
  CHECK(more.report.attempts.size() > 1);
}

TEST_CASE("Cells that the surface holds inverted cause no further steps", "[volume][stepping]") {
  Mesh mesh = cube(CellType::Hexahedron, 4);
  const Orientation orientation = detect_orientation(mesh);
  const std::vector<Index> surface = cube_surface(mesh);
  const VolumeMorph morph(mesh, surface);
  Points target = rows_of(mesh.points, surface);
  // In the plane z = 0 the node (0.5, 0.5) goes past the diagonal of one of its four facets.
  for (Index i = 0; i < target.rows(); ++i)
    if ((target.row(i) - Eigen::RowVector3d(0.5, 0.5, 0)).norm() < 1e-9)
      target.row(i) += Eigen::RowVector3d(0.2, 0.2, 0);
  const auto result = morph_in_steps(mesh, morph, target, orientation);
  REQUIRE(result.report.attempts.size() == 1);
  CHECK(result.report.attempts[0].inverted == 1);
  CHECK(result.report.attempts[0].held == 1);
  const Index bad = result.report.validity.invalid_cells.front();
  std::vector<char> is_fixed(mesh.node_count(), 0);
  for (const Index node : surface) is_fixed[node] = 1;
  CHECK(is_held(mesh, result.positions, is_fixed, orientation, bad));
  // Not so when a node of the facet may move, or the facet is convex.
  is_fixed.assign(mesh.node_count(), 0);
  CHECK_FALSE(is_held(mesh, result.positions, is_fixed, orientation, bad));
  for (const Index node : surface) is_fixed[node] = 1;
  CHECK_FALSE(is_held(mesh, mesh.points, is_fixed, orientation, bad));
  // Whatever the free corner of the cell does.
  for (unsigned seed = 0; seed < 20; ++seed) {
    Points points = shaken(mesh.points, 1, seed);
    for (std::size_t i = 0; i < surface.size(); ++i) points.row(surface[i]) = target.row(i);
    const auto invalid = check_validity(mesh, points, orientation).invalid_cells;
    CHECK(std::ranges::binary_search(invalid, bad));
  }
}

TEST_CASE("Cells inverted in the input cause no further steps", "[volume][stepping]") {
  BlockInPlane plane(10);
  const Orientation orientation = detect_orientation(plane.mesh);
  std::swap(plane.mesh.connectivity[0], plane.mesh.connectivity[6]);
  REQUIRE(check_validity(plane.mesh, plane.mesh.points, orientation).invalid == 1);
  const VolumeMorph morph(plane.mesh, plane.prescribed);
  const Points target = rows_of(plane.mesh.points, plane.prescribed);
  const auto result = morph_in_steps(plane.mesh, morph, target, orientation);
  CHECK(result.report.attempts.size() == 1);
  CHECK(result.positions == plane.mesh.points);
}

TEST_CASE("Nodes that meet on the way do not cost the morph", "[volume][stepping]") {
  const Mesh mesh = cube(CellType::Hexahedron, 3);
  const VolumeMorph morph(mesh, cube_surface(mesh));
  // Reflected at its centre, where half-way all nodes meet.
  const Points target =
      Points::Ones(morph.surface_nodes().size(), 3) - rows_of(mesh.points, morph.surface_nodes());
  const auto result = morph_in_steps(mesh, morph, target, detect_orientation(mesh));
  CHECK(result.report.validity.invalid == mesh.cell_count());
  CHECK(rows_of(result.positions, morph.surface_nodes()) == target);
}

TEST_CASE("Fewer than one step is refused", "[volume][stepping]") {
  const BlockInPlane plane(10);
  const VolumeMorph morph(plane.mesh, plane.prescribed);
  const Points target = rows_of(plane.mesh.points, plane.prescribed);
  const Orientation orientation = detect_orientation(plane.mesh);
  CHECK_THROWS_AS(morph_in_steps(plane.mesh, morph, target, orientation, {.steps = -1}),
                  InvalidInputError);
  CHECK_THROWS_AS(morph_in_steps(plane.mesh, morph, target, orientation, {.max_steps = 0}),
                  InvalidInputError);
}

}  // namespace cadmorph
