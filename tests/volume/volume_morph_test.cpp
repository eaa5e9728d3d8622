#include "volume/volume_morph.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <catch2/catch.hpp>
#include <limits>

#include "../core/sample_meshes.h"
#include "core/errors.h"
#include "volume_meshes.h"

namespace cadmorph {
namespace {

using namespace testing;
using Eigen::Vector3d;

// A mesh whose inner nodes lie at no regular places.
Mesh shaken_cube(CellType type) {
  Mesh mesh = cube(type, 5);
  const Points moved = shaken(mesh.points, 0.03, 7);
  const auto surface = cube_surface(mesh);
  const Points kept = rows_of(mesh.points, surface);
  mesh.points = moved;
  for (std::size_t i = 0; i < surface.size(); ++i) mesh.points.row(surface[i]) = kept.row(i);
  return mesh;
}

// The unit cube cut half-way through: cells above and below the cut have nodes of their own.
struct SlitCube {
  explicit SlitCube(double width)
      : mesh(cube(CellType::Hexahedron, 6)), first_copy(mesh.node_count()) {
    surface = cube_surface(mesh);
    std::vector<Index> copy(static_cast<std::size_t>(first_copy), -1);
    Points points = mesh.points;
    for (Index n = 0; n < first_copy; ++n) {
      if (mesh.points(n, 2) != 0.5 || mesh.points(n, 0) > 0.6) continue;
      const bool is_surface = std::find(surface.begin(), surface.end(), n) != surface.end();
      copy[n] = points.rows();
      points.conservativeResize(points.rows() + 1, 3);
      points.row(copy[n]) = points.row(n) + Eigen::RowVector3d(0, 0, width);
      surface.push_back(copy[n]);
      if (!is_surface) surface.push_back(n);
      ++copies;
    }
    for (Index c = 0; c < mesh.cell_count(); ++c) {
      double height = 0;
      for (const Index n : mesh.cell(c)) height += mesh.points(n, 2) / 8;
      for (Index i = mesh.offsets[c]; height > 0.5 && i < mesh.offsets[c + 1]; ++i)
        if (copy[mesh.connectivity[i]] >= 0) mesh.connectivity[i] = copy[mesh.connectivity[i]];
    }
    mesh.points = points;
  }

  Mesh mesh;
  Index first_copy;  ///< nodes from here on are copies
  Index copies = 0;
  std::vector<Index> surface;
};

}  // namespace

TEST_CASE("An affine motion of the surface moves every node by it", "[volume]") {
  Eigen::Matrix3d linear;
  linear << 1.3, 0.2, -0.1, 0.4, 0.8, 0.3, -0.2, 0.1, 1.1;
  const Vector3d shift(3, -2, 5);
  const auto affine = [&](const Vector3d& x) -> Vector3d { return linear * x + shift; };
  for (const CellType type : {CellType::Tetra, CellType::Hexahedron, CellType::QuadraticTetra})
    for (const Kernel& kernel : {Kernel::triharmonic_3d(), Kernel::biharmonic_3d()}) {
      const Mesh mesh = shaken_cube(type);
      const auto surface = cube_surface(mesh);
      const VolumeMorph morph(mesh, surface, {.kernel = kernel});
      const Points all = mapped(mesh.points, affine);
      const Points result = morph.morph(rows_of(all, surface));
      // The system's condition times rounding; the cube has size 1.
      CHECK((result - all).cwiseAbs().maxCoeff() < 1e-8);
      CHECK(rows_of(result, surface) == rows_of(all, surface));
    }
}

TEST_CASE("Cells of every type follow an affine motion of their surface", "[volume]") {
  Eigen::Matrix3d linear;
  linear << 1.3, 0.2, -0.1, 0.4, 0.8, 0.3, -0.2, 0.1, 1.1;
  for (const CellType type : solid_types()) {
    const Mesh mesh = cube(type, 2);
    const auto surface = cube_surface(mesh);
    INFO("type " << static_cast<int>(type));
    const Points all = mesh.points * linear.transpose();
    const Points result = VolumeMorph(mesh, surface).morph(rows_of(all, surface));
    CHECK((result - all).cwiseAbs().maxCoeff() < 1e-12);  // rounding, in a cube of size 1
  }
}

TEST_CASE("Surface nodes end exactly where they are told to", "[volume]") {
  const Mesh mesh = shaken_cube(CellType::Tetra);
  const auto surface = cube_surface(mesh);
  const VolumeMorph morph(mesh, surface);
  const Points target = shaken(rows_of(mesh.points, surface), 0.1, 3);
  RbfReport report;
  const Points result = morph.morph(target, &report);
  CHECK(rows_of(result, surface) == target);
  CHECK(report.centres == static_cast<Index>(surface.size()));
  CHECK((result - mesh.points).rowwise().norm().maxCoeff() > 0.05);
}

TEST_CASE("A surface at rest leaves the mesh as it is, bit by bit", "[volume]") {
  const Mesh mesh = shaken_cube(CellType::Hexahedron);
  const auto surface = cube_surface(mesh);
  const VolumeMorph morph(mesh, surface);
  CHECK(morph.morph(rows_of(mesh.points, surface)) == mesh.points);
}

TEST_CASE("The warp is the interpolant of the surface displacements", "[volume]") {
  // Away from the centres: a quadratic field on the surface, compared with the sum written out.
  const Mesh mesh = shaken_cube(CellType::Tetra);
  const auto surface = cube_surface(mesh);
  const auto bend = [](const Vector3d& x) -> Vector3d {
    return x + Vector3d(0.2 * x[1] * x[1], 0.1 * x[0] * x[2], -0.15 * x[0] * x[0]);
  };
  const Points target = mapped(rows_of(mesh.points, surface), bend);
  const Points result = VolumeMorph(mesh, surface).morph(target);
  const Index m = static_cast<Index>(surface.size());
  const Points centres = rows_of(mesh.points, surface);
  Eigen::MatrixXd system = Eigen::MatrixXd::Zero(m + 4, m + 4);
  Eigen::MatrixXd values = Eigen::MatrixXd::Zero(m + 4, 3);
  for (Index i = 0; i < m; ++i) {
    for (Index j = 0; j < m; ++j)
      system(i, j) = std::pow((centres.row(i) - centres.row(j)).norm(), 3);
    system.row(i).tail(4) << centres.row(i), 1;
    system.col(i).tail(4) = system.row(i).tail(4).transpose();
    values.row(i) = target.row(i) - centres.row(i);
  }
  const Eigen::MatrixXd weights = system.fullPivLu().solve(values);
  for (Index n = 0; n < mesh.node_count(); n += 7) {
    Eigen::RowVectorXd basis(m + 4);
    for (Index j = 0; j < m; ++j)
      basis[j] = std::pow((mesh.points.row(n) - centres.row(j)).norm(), 3);
    basis.tail(4) << mesh.points.row(n), 1;
    const Eigen::RowVector3d expected = mesh.points.row(n) + basis * weights;
    CHECK((result.row(n) - expected).norm() < 1e-9);  // two solvers at a condition of 1e6
  }
}

TEST_CASE("A mesh that is all surface needs no system", "[volume]") {
  const Mesh mesh = cube(CellType::Hexahedron, 1);
  const auto surface = cube_surface(mesh);
  REQUIRE(static_cast<Index>(surface.size()) == mesh.node_count());
  const VolumeMorph morph(mesh, surface);
  const Points target = shaken(mesh.points, 0.2, 1);
  CHECK(morph.morph(target) == target);
  CHECK(morph.report().centres == 0);
}

TEST_CASE("A slit narrower than rounding allows is morphed like its sides", "[volume]") {
  const SlitCube slit(1e-9);
  const auto bend = [](const Vector3d& x) -> Vector3d {
    return {1.2 * x[0] + 0.1 * x[2], 0.9 * x[1], 1.1 * x[2] - 0.2 * x[0]};
  };
  const Points all = mapped(slit.mesh.points, bend);
  for (const SolverKind solver : {SolverKind::Auto, SolverKind::Cholesky}) {
    const VolumeMorph morph(slit.mesh, slit.surface, {.rbf = {.solver = solver}});
    RbfReport report;
    const Points result = morph.morph(rows_of(all, slit.surface), &report);
    CHECK((result - all).cwiseAbs().maxCoeff() < 1e-8);  // as without a slit
    CHECK(rows_of(result, slit.surface) == rows_of(all, slit.surface));
    CHECK(report.reciprocal_condition > 1e-10);
    CHECK(report.merged == slit.copies);
    CHECK_THAT(report.reason, Catch::Contains("slit"));
  }
}

TEST_CASE("The sides of a crack of no width may part", "[volume]") {
  const SlitCube crack(0);
  Points target = rows_of(crack.mesh.points, crack.surface);
  for (Index i = 0; i < target.rows(); ++i)
    if (crack.surface[i] >= crack.first_copy) target(i, 2) += 1e-3;
  const Points result = VolumeMorph(crack.mesh, crack.surface).morph(target);
  CHECK(rows_of(result, crack.surface) == target);
  CHECK((result - crack.mesh.points).cwiseAbs().maxCoeff() < 2e-3);
}

TEST_CASE("Wrong surface nodes and positions are refused", "[volume]") {
  const Mesh mesh = cube(CellType::Hexahedron, 2);
  const auto surface = cube_surface(mesh);
  CHECK_THROWS_AS(VolumeMorph(mesh, {}), InvalidInputError);
  CHECK_THROWS_AS(VolumeMorph(mesh, {0, 1, 2, mesh.node_count()}), InvalidInputError);
  CHECK_THROWS_AS(VolumeMorph(mesh, {0, 1, 2, -1}), InvalidInputError);
  CHECK_THROWS_AS(VolumeMorph(mesh, {0, 1, 2, 1}), InvalidInputError);
  const VolumeMorph morph(mesh, surface);
  Points target = rows_of(mesh.points, surface);
  CHECK_THROWS_AS(morph.morph(target.topRows(3)), InvalidInputError);
  target(2, 1) = std::numeric_limits<double>::quiet_NaN();
  CHECK_THROWS_AS(morph.morph(target), InvalidInputError);
}

TEST_CASE("Sets morphed together equal those morphed alone to the last bit", "[volume]") {
  const Mesh mesh = cube(CellType::Hexahedron, 20);  // 2,402 surface nodes
  const auto surface = cube_surface(mesh);
  const Points base = rows_of(mesh.points, surface);
  Points bad = base;
  bad(7, 2) = std::numeric_limits<double>::infinity();
  const std::vector<Points> targets = {shaken(base, 0.05, 1), base, bad, shaken(base, 0.2, 2),
                                       base.topRows(5)};
  for (const SolverKind solver : {SolverKind::Adaptive, SolverKind::Cholesky, SolverKind::Fast}) {
    const VolumeMorph morph(mesh, surface, {.rbf = {.solver = solver}});
    const std::vector<VolumeMorphResult> together = morph.morph_each(targets);
    for (const std::size_t i : {0, 1, 3}) {
      RbfReport report;
      REQUIRE_FALSE(together[i].error);
      REQUIRE(morph.morph(targets[i], &report) == together[i].positions);
      REQUIRE(rows_of(together[i].positions, surface) == targets[i]);
      CHECK(report.solver == solver);
      CHECK(report.iterations == together[i].report.iterations);
    }
    for (const std::size_t i : {2, 4})
      REQUIRE_THROWS_AS(std::rethrow_exception(together[i].error), InvalidInputError);
  }
}

}  // namespace cadmorph
