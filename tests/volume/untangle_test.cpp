#include "volume/untangle.h"

#include <Eigen/Geometry>
#include <catch2/catch.hpp>
#include <cmath>
#include <random>

#include "../core/sample_meshes.h"
#include "core/cell_topology.h"
#include "core/errors.h"
#include "volume/held_cells.h"
#include "volume/mid_nodes.h"
#include "volume_meshes.h"

namespace cadmorph {
namespace {

using namespace testing;
using Eigen::Vector3d;

// A diffeomorphism of space: shears along one axis by a smooth function of the two others, one
// after the other (each has Jacobian determinant 1).
class RandomMotion {
 public:
  explicit RandomMotion(unsigned seed) : random_(seed) {
    for (auto& shear : shears_)
      for (double& value : shear) value = uniform_(random_);
  }

  Vector3d operator()(Vector3d x) const {
    for (std::size_t i = 0; i < std::size(shears_); ++i) {
      const auto& s = shears_[i];
      const int axis = static_cast<int>(i % 3);
      const double a = x[(axis + 1) % 3], b = x[(axis + 2) % 3];
      x[axis] +=
          0.45 * s[0] * std::sin(3 * a + 2 * s[1]) + 0.35 * s[2] * std::cos(3 * b + 2 * s[3]);
    }
    return x;
  }

 private:
  std::mt19937 random_;
  std::uniform_real_distribution<double> uniform_{-1, 1};
  double shears_[6][4];
};

std::vector<char> marks(const Mesh& mesh, const std::vector<Index>& nodes) {
  std::vector<char> is_fixed(mesh.node_count(), 0);
  for (const Index node : nodes) is_fixed[node] = 1;
  return is_fixed;
}

// The surface moved, the inside left behind.
struct Tangle {
  Tangle(CellType type, int n, unsigned seed)
      : mesh(cube(type, n)),
        orientation(detect_orientation(mesh)),
        surface(cube_surface(mesh)),
        known(mapped(mesh.points, RandomMotion(seed))),
        positions(mesh.points) {
    for (const Index node : surface) positions.row(node) = known.row(node);
  }
  bool has_answer() const { return check_validity(mesh, known, orientation).invalid == 0; }

  Mesh mesh;
  Orientation orientation;
  std::vector<Index> surface;
  Points known;
  Points positions;
};

}  // namespace

TEST_CASE("Random boundary motions that admit a valid mesh are untangled", "[volume][untangle]") {
  for (const CellType type : {CellType::Tetra, CellType::Hexahedron, CellType::Wedge}) {
    int tangled = 0, recovered = 0;
    for (unsigned seed = 1; tangled < 34 && seed < 400; ++seed) {
      const Tangle tangle(type, 5, seed);
      if (!tangle.has_answer()) continue;
      if (check_validity(tangle.mesh, tangle.positions, tangle.orientation).invalid == 0) continue;
      ++tangled;
      const auto result = untangle(tangle.mesh, tangle.positions,
                                   marks(tangle.mesh, tangle.surface), tangle.orientation);
      const Index left = check_validity(tangle.mesh, result.positions, tangle.orientation).invalid;
      CHECK(result.report.after == left);
      CHECK(result.report.before > 0);
      CHECK(rows_of(result.positions, tangle.surface) == rows_of(tangle.known, tangle.surface));
      if (left == 0) ++recovered;
    }
    INFO("type " << static_cast<int>(type));
    REQUIRE(tangled == 34);
    CHECK(recovered >= tangled - (type == CellType::Tetra ? 1 : 0));
  }
}

TEST_CASE("Pyramids, quadratic tetrahedra and polyhedra are untangled", "[volume][untangle]") {
  for (const CellType type : {CellType::Pyramid, CellType::QuadraticTetra, CellType::Polyhedron}) {
    Mesh mesh = cube(type, 3);
    const Orientation orientation = detect_orientation(mesh);
    const auto surface = cube_surface(mesh);
    // Polyhedra bear more before they are invalid.
    Points positions = shaken(mesh.points, type == CellType::Polyhedron ? 0.4 : 0.3, 11);
    for (const Index node : surface) positions.row(node) = mesh.points.row(node);
    INFO("type " << static_cast<int>(type));
    REQUIRE(check_validity(mesh, positions, orientation).invalid > 0);
    const auto result = untangle(mesh, positions, marks(mesh, surface), orientation);
    CHECK(check_validity(mesh, result.positions, orientation).invalid == 0);
    CHECK(result.report.after == 0);
  }
}

TEST_CASE("Repaired cells of second order keep straight edges where these do",
          "[volume][untangle]") {
  for (const CellType type :
       {CellType::QuadraticTetra, CellType::QuadraticHexahedron, CellType::TriquadraticHexahedron,
        CellType::QuadraticWedge, CellType::BiquadraticQuadraticWedge}) {
    INFO(static_cast<int>(type));
    const Mesh mesh = cube(type, 4);
    const Orientation orientation = detect_orientation(mesh);
    const auto surface = cube_surface(mesh);
    Points positions = shaken(mesh.points, 0.3, 11);
    for (const Index node : surface) positions.row(node) = mesh.points.row(node);
    REQUIRE(check_validity(mesh, positions, orientation).invalid > 0);
    UntangleOptions options;
    options.may_bend_all = false;
    const auto result = untangle(mesh, positions, marks(mesh, surface), orientation, options);
    REQUIRE(result.report.after == 0);
    CHECK(check_validity(mesh, result.positions, orientation).invalid == 0);
    const MidNodes mid_nodes(mesh, result.positions);
    double most = 0;
    for (Index i = 0; i < mid_nodes.count(); ++i)
      most = std::max(
          most,
          (result.positions.row(mid_nodes.node(i)) - mid_nodes.middle(i, result.positions)).norm());
    CHECK(most < 1e-12);
  }
}

TEST_CASE("Polyhedra follow random boundary motions", "[volume][untangle]") {
  int tangled = 0, recovered = 0;
  for (unsigned seed = 1; tangled < 10 && seed < 200; ++seed) {
    const Tangle tangle(CellType::Polyhedron, 5, seed);
    if (!tangle.has_answer()) continue;
    if (check_validity(tangle.mesh, tangle.positions, tangle.orientation).invalid == 0) continue;
    ++tangled;
    const auto result = untangle(tangle.mesh, tangle.positions, marks(tangle.mesh, tangle.surface),
                                 tangle.orientation);
    recovered += check_validity(tangle.mesh, result.positions, tangle.orientation).invalid == 0;
  }
  REQUIRE(tangled == 10);
  // All tetrahedra of a polyhedron positive is more than valid asks: one finds no such way.
  CHECK(recovered >= 9);
}

TEST_CASE("Untangling moves nothing in a valid mesh, and only near the bad cells in others",
          "[volume][untangle]") {
  const Mesh mesh = cube(CellType::Hexahedron, 12);
  const Orientation orientation = detect_orientation(mesh);
  const auto is_fixed = marks(mesh, cube_surface(mesh));
  CHECK(untangle(mesh, mesh.points, is_fixed, orientation).positions == mesh.points);
  Points positions = mesh.points;
  const Vector3d spot(0.25, 0.25, 0.25);
  Index nearest;
  (mesh.points.rowwise() - spot.transpose()).rowwise().norm().minCoeff(&nearest);
  positions.row(nearest) += Eigen::RowVector3d(0.15, 0.15, 0.15);
  const auto result = untangle(mesh, positions, is_fixed, orientation);
  CHECK(result.report.before > 0);
  CHECK(result.report.after == 0);
  Index far = 0;
  for (Index n = 0; n < mesh.node_count(); ++n) {
    if ((mesh.points.row(n) - spot.transpose()).norm() <= 0.7) continue;
    far += !is_fixed[n];
    CHECK(result.positions.row(n) == positions.row(n));
  }
  CHECK(far == 436);  // inner nodes of the grid
}

TEST_CASE("What can't be untangled is told", "[volume][untangle]") {
  const Mesh mesh = cube(CellType::Hexahedron, 3);
  const Orientation orientation = detect_orientation(mesh);
  const auto surface = cube_surface(mesh);
  Points positions = mesh.points;
  for (const Index node : surface) positions(node, 0) *= -1;  // inside out
  const auto result = untangle(mesh, positions, marks(mesh, surface), orientation,
                               {.attempts = 2, .outer_iterations = 10});
  CHECK(result.report.after > 0);
  CHECK(result.report.after == check_validity(mesh, result.positions, orientation).invalid);
  CHECK(result.report.after <= result.report.before);
}

TEST_CASE("Untangling refuses marks of another size", "[volume][untangle]") {
  const Mesh mesh = cube(CellType::Hexahedron, 2);
  const Orientation orientation = detect_orientation(mesh);
  CHECK_THROWS_AS(untangle(mesh, mesh.points, {}, orientation), InvalidInputError);
  CHECK_THROWS_AS(
      untangle(mesh, mesh.points.topRows(3), std::vector<char>(mesh.node_count(), 0), orientation),
      InvalidInputError);
}

TEST_CASE("A polyhedron with a dented plane facet on the surface is repaired",
          "[volume][untangle]") {
  const Mesh mesh = cube(CellType::Polyhedron, 2);
  const Orientation orientation = detect_orientation(mesh);
  const std::vector<char> is_fixed = marks(mesh, cube_surface(mesh));
  Points positions = mesh.points;
  const auto move = [&](const Eigen::RowVector3d& from, const Eigen::RowVector3d& to) {
    for (Index n = 0; n < mesh.node_count(); ++n)
      if ((mesh.points.row(n) - from).norm() < 1e-9) positions.row(n) = to;
  };
  // Past the diagonal of one of the floor's facets; the pyramid on it keeps a positive volume.
  move({0.5, 0.5, 0}, {0.2, 0.2, 0});
  CHECK(check_validity(mesh, positions, orientation).invalid == 0);
  move({0.5, 0.5, 0.5}, {0.5, 0.5, -1});
  REQUIRE(check_validity(mesh, positions, orientation).invalid_cells.front() == 0);
  CHECK_FALSE(is_held(mesh, positions, is_fixed, orientation, 0));
  CHECK(is_held(mesh, positions, std::vector<char>(mesh.node_count(), 1), orientation, 0));
  CHECK(untangle(mesh, positions, is_fixed, orientation).report.after == 0);
}

TEST_CASE("Cells whose Jacobian the surface sets inverted are held", "[volume][untangle]") {
  // Two facets of a curved tetrahedron are on the surface; its last node, opposite their edge, is
  // free.
  Mesh mesh = parametric_cell(CellType::QuadraticTetra);
  const Orientation orientation = detect_orientation(mesh);
  std::vector<char> is_fixed(10, 1);
  is_fixed[9] = 0;
  CHECK_FALSE(is_held(mesh, mesh.points, is_fixed, orientation, 0));
  Points positions = mesh.points;
  // Before a quarter of its edge: the edge sets out backwards (slope 4 * 0.2 - 1).
  positions.row(6) = 0.8 * mesh.points.row(0) + 0.2 * mesh.points.row(2);
  CHECK(is_held(mesh, positions, is_fixed, orientation, 0));
  for (unsigned seed = 0; seed < 20; ++seed) {
    Points points = positions;
    points.row(9) = shaken(mesh.points, 3, seed).row(9);
    CHECK(check_validity(mesh, points, orientation).invalid == 1);
  }
  is_fixed[6] = 0;
  CHECK_FALSE(is_held(mesh, positions, is_fixed, orientation, 0));
  CHECK(untangle(mesh, positions, is_fixed, orientation).report.after == 0);
}

}  // namespace cadmorph
