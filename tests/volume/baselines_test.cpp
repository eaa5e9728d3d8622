#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <catch2/catch.hpp>
#include <optional>
#include <random>
#include <set>

#include "../core/sample_meshes.h"
#include "core/errors.h"
#include "volume/baselines/baseline.h"
#include "volume/baselines/femwarp.h"
#include "volume/baselines/lbwarp.h"
#include "volume/baselines/simplex_linear.h"
#include "volume/stepping.h"
#include "volume_meshes.h"

namespace cadmorph {
namespace {

using namespace testing;
using Eigen::Matrix4d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::Vector4d;
using Eigen::VectorXd;

std::vector<MorphMethod> built_methods() {
  std::vector<MorphMethod> result = {MorphMethod::Femwarp, MorphMethod::Lbwarp};
  if (has_simplex_linear()) result.push_back(MorphMethod::SimplexLinear);
  return result;
}

// Inner nodes shaken, the surface kept.
Mesh shaken_inside(CellType type, int n) {
  Mesh mesh = cube(type, n);
  const Points moved = shaken(mesh.points, 0.2 / n, 7);
  std::vector<char> is_surface(mesh.node_count(), 0);
  for (const Index node : cube_surface(mesh)) is_surface[node] = 1;
  for (Index node = 0; node < mesh.node_count(); ++node)
    if (!is_surface[node]) mesh.points.row(node) = moved.row(node);
  return mesh;
}

Points random_points(Index count, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> uniform(-1, 1);
  return Points::NullaryExpr(count, 3, [&] { return uniform(random); });
}

Index centre_of(const Mesh& mesh) {
  Index centre = 0;
  const Eigen::RowVector3d middle(0.5, 0.5, 0.5);
  REQUIRE((mesh.points.rowwise() - middle).rowwise().norm().minCoeff(&centre) == 0);
  return centre;
}

MatrixXd stiffness_matrix(const Mesh& mesh) {
  MatrixXd result = MatrixXd::Zero(mesh.node_count(), mesh.node_count());
  for (Index c = 0; c < mesh.cell_count(); ++c) {
    const std::vector<Index> ids(mesh.cell(c).begin(), mesh.cell(c).end());
    result(ids, ids) += laplace_stiffness(mesh.types[c], rows_of(mesh.points, ids));
  }
  return result;
}

// Rows u_i - sum_j w_ij u_j over the neighbours by an edge; those of `fixed` nodes are left alone.
MatrixXd log_barrier_matrix(const Mesh& mesh, const std::vector<Index>& fixed) {
  std::vector<std::set<Index>> neighbours(mesh.node_count());
  for (Index c = 0; c < mesh.cell_count(); ++c)
    for (const Facet& facet : cell_facets(mesh, c))
      for (std::size_t i = 0; i < facet.nodes.size(); ++i) {
        const Index a = facet.nodes[i], b = facet.nodes[(i + 1) % facet.nodes.size()];
        neighbours[a].insert(b);
        neighbours[b].insert(a);
      }
  MatrixXd result = MatrixXd::Identity(mesh.node_count(), mesh.node_count());
  for (Index node = 0; node < mesh.node_count(); ++node) {
    if (std::ranges::find(fixed, node) != fixed.end()) continue;
    const std::vector<Index> around(neighbours[node].begin(), neighbours[node].end());
    const Points offsets = rows_of(mesh.points, around).rowwise() - mesh.points.row(node);
    result(node, around) = -log_barrier_weights(offsets).transpose();
  }
  return result;
}

// Solves A u = 0 for given rows of u by dense elimination, the rows of A of a like size.
Points eliminated(MatrixXd A, const std::vector<Index>& given, const Points& values) {
  MatrixXd rhs = MatrixXd::Zero(A.rows(), 3);
  for (std::size_t i = 0; i < given.size(); ++i) {
    A.row(given[i]).setZero();
    A(given[i], given[i]) = 1;
    rhs.row(given[i]) = values.row(static_cast<Index>(i));
  }
  for (Index i = 0; i < A.rows(); ++i) A.row(i) /= A(i, i);
  return A.partialPivLu().solve(rhs);
}

// Weights of four corners (rows) with sum 1 that give x.
Vector4d barycentric(const Points& corners, const Vector3d& x) {
  Matrix4d system;
  system.topRows<3>() = corners.transpose();
  system.row(3).setOnes();
  return system.fullPivLu().solve(Vector4d(x[0], x[1], x[2], 1));
}

// The Delaunay tetrahedron that holds x, found by trying all: no other point lies in its sphere.
std::vector<Index> delaunay_tetrahedron(const Points& points, const Vector3d& x) {
  const Index n = points.rows();
  for (Index a = 0; a < n; ++a)
    for (Index b = a + 1; b < n; ++b)
      for (Index c = b + 1; c < n; ++c)
        for (Index d = c + 1; d < n; ++d) {
          const std::vector<Index> ids = {a, b, c, d};
          const Points corners = rows_of(points, ids);
          const Eigen::Matrix3d edges = corners.bottomRows<3>().rowwise() - corners.row(0);
          if (std::abs(edges.determinant()) < 1e-9) continue;
          if (barycentric(corners, x).minCoeff() < 0) continue;
          const Vector3d centre =
              edges.fullPivLu().solve(Vector3d(0.5 * edges.rowwise().squaredNorm())) +
              corners.row(0).transpose();
          const double radius = (corners.row(0).transpose() - centre).norm();
          const VectorXd distances = (points.rowwise() - centre.transpose()).rowwise().norm();
          if (distances.minCoeff() > radius - 1e-9) return ids;
        }
  return {};
}

}  // namespace

TEST_CASE("Every baseline moves all nodes affinely with an affine surface", "[volume][baselines]") {
  Eigen::Matrix3d linear;
  linear << 1.3, 0.2, -0.1, 0.4, 0.8, 0.3, -0.2, 0.1, 1.1;
  const auto affine = [&](const Vector3d& x) -> Vector3d {
    return linear * x + Vector3d(3, -2, 5);
  };
  for (const MorphMethod method : built_methods())
    for (const CellType type : {CellType::Tetra, CellType::Hexahedron, CellType::Voxel,
                                CellType::Wedge, CellType::Pyramid}) {
      CAPTURE(to_string(method), static_cast<int>(type));
      const Mesh mesh = type == CellType::Voxel ? cube(type, 4) : shaken_inside(type, 4);
      const auto surface = cube_surface(mesh);
      const VolumeMorph morph(mesh, surface, {.method = method});
      const Points all = mapped(mesh.points, affine);
      const Points result = morph.morph(rows_of(all, surface));
      CHECK((result - all).cwiseAbs().maxCoeff() < 1e-10);  // the iterations stop at 1e-13
      CHECK(rows_of(result, surface) == rows_of(all, surface));
    }
}

TEST_CASE("Baselines keep the surface exactly and leave a mesh at rest", "[volume][baselines]") {
  const Mesh mesh = shaken_inside(CellType::Hexahedron, 4);
  const auto surface = cube_surface(mesh);
  for (const MorphMethod method : built_methods()) {
    const VolumeMorph morph(mesh, surface, {.method = method});
    const Points target = shaken(rows_of(mesh.points, surface), 0.1, 3);
    RbfReport report;
    CHECK(rows_of(morph.morph(target, &report), surface) == target);
    CHECK(report.centres == static_cast<Index>(surface.size()));
    CHECK(morph.morph(rows_of(mesh.points, surface)) == mesh.points);
  }
}

TEST_CASE("The stiffness of a unit tetrahedron and cube is the textbook's", "[volume][baselines]") {
  RowMatrix tetrahedron(4, 3);
  tetrahedron << 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1;
  MatrixXd expected(4, 4);
  expected << 3, -1, -1, -1, -1, 1, 0, 0, -1, 0, 1, 0, -1, 0, 0, 1;
  CHECK((laplace_stiffness(CellType::Tetra, tetrahedron) - expected / 6).norm() < 1e-15);

  // By the number of coordinates in which two corners differ: 0, 1, 2, 3.
  const double values[] = {1.0 / 3, 0, -1.0 / 12, -1.0 / 12};
  const Mesh hexahedron = parametric_cell(CellType::Hexahedron);
  const MatrixXd K = laplace_stiffness(CellType::Hexahedron, hexahedron.points);
  for (Index i = 0; i < 8; ++i)
    for (Index j = 0; j < 8; ++j) {
      const auto apart = (hexahedron.points.row(i) - hexahedron.points.row(j)).cwiseAbs().sum();
      CHECK(K(i, j) == Approx(values[std::lround(apart)]).margin(1e-15));
    }
}

TEST_CASE("The stiffness of a distorted cell is exact for linear functions",
          "[volume][baselines]") {
  // No flux of a linear function out of any inner node, and the energy |a|^2 V of a . x, with the
  // volume from the cell cut into tetrahedra around points on bilinear faces: here straight cells.
  for (const auto& [type, volume] :
       {std::pair(CellType::Tetra, 1.0 / 6), std::pair(CellType::Hexahedron, 1.0),
        std::pair(CellType::Voxel, 1.0), std::pair(CellType::Wedge, 0.5),
        std::pair(CellType::Pyramid, 1.0 / 3)}) {
    CAPTURE(static_cast<int>(type));
    Eigen::Matrix3d linear;
    linear << 1.3, 0.2, -0.1, 0.4, 0.8, 0.3, -0.2, 0.1, 1.1;
    const Points corners = parametric_cell(type).points;
    const RowMatrix nodes = corners * linear.transpose();
    const MatrixXd K = laplace_stiffness(type, nodes);
    CHECK((K - K.transpose()).norm() < 1e-14);
    CHECK((K * VectorXd::Ones(nodes.rows())).norm() < 1e-13);
    const VectorXd f = nodes * Vector3d(1, -2, 3);
    CHECK(f.dot(K * f) == Approx(14 * volume * linear.determinant()).epsilon(1e-12));
  }
}

TEST_CASE("FEMWARP weighs a cube's centre by hand", "[volume][baselines]") {
  // 8 unit cubes: the face centres' entries cancel; 12 edge midpoints 1/16 each, 8 corners 1/32.
  const Mesh mesh = cube(CellType::Hexahedron, 2);
  const auto surface = cube_surface(mesh);
  REQUIRE(surface.size() == 26);
  const Index centre = centre_of(mesh);
  const auto method = make_baseline(MorphMethod::Femwarp, mesh, surface);
  const double weights[] = {0, 1.0 / 16, 1.0 / 32};
  for (std::size_t i = 0; i < surface.size(); ++i) {
    Points push = Points::Zero(surface.size(), 3);
    push.row(i) << 1, 2, -3;
    const Points moved = method->displacements(push);
    const Eigen::RowVector3d from_centre = mesh.points.row(surface[i]).array() - 0.5;
    const auto sides = (from_centre.array().abs() > 0.25).count();
    CHECK((moved.row(centre) - weights[sides - 1] * push.row(i)).norm() < 1e-13);
  }
}

TEST_CASE("FEMWARP reproduces harmonic functions on a regular grid", "[volume][baselines]") {
  // The trilinear stencil annihilates xy and x^2 - y^2, on a regular grid only.
  const Mesh mesh = cube(CellType::Hexahedron, 6);
  const auto surface = cube_surface(mesh);
  const auto field = [](const Vector3d& x) -> Vector3d {
    return {x[0] * x[1], x[1] * x[1] - x[2] * x[2], x[0] * x[1] * x[2]};
  };
  const Points all = mapped(mesh.points, field);
  const auto method = make_baseline(MorphMethod::Femwarp, mesh, surface);
  CHECK((method->displacements(rows_of(all, surface)) - all).cwiseAbs().maxCoeff() < 1e-12);
}

TEST_CASE("Layers of 1e-6 cost the baselines no accuracy", "[volume][baselines][layers]") {
  constexpr double kFirst = 1e-6;
  const Mesh mesh = graded_layers(8, kFirst);
  const auto surface = cube_surface(mesh);
  const Points start = rows_of(mesh.points, surface);
  const Points moves = mapped(start, wave) - start;
  // A thousandth of the thinnest cell: nothing inverts for want of digits.
  const double allowed = 1e-3 * kFirst;
  const Points by_stiffness = eliminated(stiffness_matrix(mesh), surface, moves);
  const Points by_weights = eliminated(log_barrier_matrix(mesh, surface), surface, moves);
  const auto femwarp = make_femwarp(mesh, surface), lbwarp = make_lbwarp(mesh, surface);
  CHECK((femwarp->displacements(moves) - by_stiffness).cwiseAbs().maxCoeff() <= allowed);
  CHECK((lbwarp->displacements(moves) - by_weights).cwiseAbs().maxCoeff() <= allowed);
}

TEST_CASE("Log-barrier weights on three axes are known", "[volume][baselines]") {
  // Neighbours at a and -b on an axis: weights b / (3 (a + b)) and a / (3 (a + b)).
  Points offsets = Points::Zero(6, 3);
  const double a[] = {1, 2, 1e-5}, b[] = {3, 0.5, 1};
  for (int axis = 0; axis < 3; ++axis) {
    offsets(2 * axis, axis) = a[axis];
    offsets(2 * axis + 1, axis) = -b[axis];
  }
  const VectorXd w = log_barrier_weights(offsets);
  for (int axis = 0; axis < 3; ++axis) {
    const double sum = 3 * (a[axis] + b[axis]);
    CHECK(w[2 * axis] == Approx(b[axis] / sum).epsilon(1e-9));
    CHECK(w[2 * axis + 1] == Approx(a[axis] / sum).epsilon(1e-9));
  }
}

TEST_CASE("Log-barrier weights of four neighbours are barycentric", "[volume][baselines]") {
  int inside = 0;
  for (unsigned seed = 0; seed < 200; ++seed) {
    const Points corners = random_points(4, seed);
    const Vector4d expected = barycentric(corners, Vector3d::Zero());
    if (expected.minCoeff() > 1e-3) {
      ++inside;
      CHECK((log_barrier_weights(corners) - expected).cwiseAbs().maxCoeff() < 1e-10);
    } else if (expected.minCoeff() < -1e-3) {
      CHECK_THROWS_AS(log_barrier_weights(corners), SolverError);
    }
  }
  CHECK(inside > 10);
}

TEST_CASE("Log-barrier weights are positive, sum to one, and no others have a larger product",
          "[volume][baselines]") {
  for (unsigned seed = 0; seed < 50; ++seed) {
    Points offsets = random_points(12, 100 + seed);
    offsets.row(11) = -0.2 * offsets.topRows(11).colwise().sum();  // the node is inside
    const VectorXd w = log_barrier_weights(offsets);
    CHECK(w.minCoeff() > 0);
    CHECK(w.sum() == Approx(1).epsilon(1e-14));
    CHECK((w.transpose() * offsets).norm() < 1e-12);
    // All weights near that keep the constraints differ by the null space of these four rows.
    MatrixXd constraints(4, 12);
    constraints << offsets.transpose(), Eigen::RowVectorXd::Ones(12);
    const MatrixXd free = constraints.fullPivLu().kernel();
    for (Index k = 0; k < free.cols(); ++k)
      for (const double step : {-1e-4, 1e-4}) {
        const VectorXd other = w + step * w.minCoeff() * free.col(k).normalized();
        CHECK(other.array().log().sum() < w.array().log().sum());
      }
  }
}

TEST_CASE("LBWARP weighs a cube's centre by its six neighbours", "[volume][baselines]") {
  const Mesh mesh = cube(CellType::Hexahedron, 2);
  const auto surface = cube_surface(mesh);
  REQUIRE(surface.size() == 26);
  const Index centre = centre_of(mesh);
  const auto method = make_baseline(MorphMethod::Lbwarp, mesh, surface);
  for (std::size_t i = 0; i < surface.size(); ++i) {
    Points push = Points::Zero(surface.size(), 3);
    push.row(i) << 1, 2, -3;
    const Points moved = method->displacements(push);
    const Eigen::RowVector3d from_centre = mesh.points.row(surface[i]).array() - 0.5;
    const bool is_face_centre = (from_centre.array().abs() > 0.25).count() == 1;
    CHECK((moved.row(centre) - (is_face_centre ? 1.0 / 6 : 0) * push.row(i)).norm() < 1e-13);
  }
}

TEST_CASE("Simplex-linear keeps a node's place in its Delaunay tetrahedron",
          "[volume][baselines]") {
  if (!has_simplex_linear()) {
    const Mesh mesh = cube(CellType::Tetra, 2);
    CHECK_THROWS_AS(make_simplex_linear(mesh, cube_surface(mesh)), SolverError);
    return;
  }
  Mesh mesh = cube(CellType::Hexahedron, 3);
  mesh.points = shaken(mesh.points, 0.05, 11);  // no five surface nodes on one sphere
  const auto surface = cube_surface(cube(CellType::Hexahedron, 3));
  const Points corners = rows_of(mesh.points, surface);
  const Points push = random_points(static_cast<Index>(surface.size()), 5);
  const Points moved = make_simplex_linear(mesh, surface)->displacements(push);
  Index free = 0;
  for (Index node = 0; node < mesh.node_count(); ++node) {
    if (std::ranges::find(surface, node) != surface.end()) continue;
    const Vector3d x = mesh.points.row(node);
    const auto ids = delaunay_tetrahedron(corners, x);
    REQUIRE(ids.size() == 4);
    const Eigen::RowVector3d expected =
        barycentric(rows_of(corners, ids), x).transpose() * rows_of(push, ids);
    CHECK((moved.row(node) - expected).norm() < 1e-11);
    ++free;
  }
  CHECK(free == 8);
}

TEST_CASE("Baselines refuse the cells that they do not know", "[volume][baselines]") {
  const auto refuses = [](MorphMethod method, CellType type) {
    const Mesh mesh = cube(type, 2);
    CAPTURE(to_string(method), static_cast<int>(type));
    CHECK_THROWS_AS(VolumeMorph(mesh, cube_surface(mesh), {.method = method}), InvalidInputError);
  };
  refuses(MorphMethod::Femwarp, CellType::QuadraticTetra);
  refuses(MorphMethod::Femwarp, CellType::Polyhedron);
  refuses(MorphMethod::Lbwarp, CellType::QuadraticTetra);
  const Mesh mesh = cube(CellType::Tetra, 2);
  CHECK_THROWS_AS(make_baseline(MorphMethod::Rbf, mesh, cube_surface(mesh)), InvalidInputError);
}

TEST_CASE("LBWARP takes polyhedra", "[volume][baselines]") {
  const Mesh mesh = cube(CellType::Polyhedron, 3);
  const auto surface = cube_surface(mesh);
  const Points push = random_points(static_cast<Index>(surface.size()), 9);
  const Mesh same = cube(CellType::Hexahedron, 3);
  REQUIRE(same.points == mesh.points);
  CHECK(make_lbwarp(mesh, surface)->displacements(push) ==
        make_lbwarp(same, surface)->displacements(push));
}

TEST_CASE("Stepping rebuilds a baseline from the mesh moved so far", "[volume][baselines]") {
  const Mesh mesh = shaken_inside(CellType::Tetra, 4);
  const auto surface = cube_surface(mesh);
  const Orientation orientation = detect_orientation(mesh);
  const auto bend = [](const Vector3d& x) -> Vector3d {
    return x + Vector3d(0.2 * x[1] * x[1], 0.1 * x[0] * x[2], -0.15 * x[0] * x[0]);
  };
  const Points start = rows_of(mesh.points, surface), target = mapped(start, bend);
  for (const MorphMethod method : {MorphMethod::Femwarp, MorphMethod::Lbwarp}) {
    const VolumeMorph first(mesh, surface, {.method = method});
    const auto stepped = morph_in_steps(mesh, first, target, orientation, {.steps = 2});
    Mesh half = mesh;
    half.points = first.morph(0.5 * (start + target));
    const Points expected = VolumeMorph(half, surface, {.method = method}).morph(target);
    CHECK((stepped.positions - expected).cwiseAbs().maxCoeff() < 1e-12);
    CHECK((stepped.positions - first.morph(target)).cwiseAbs().maxCoeff() > 1e-5);
  }
}

}  // namespace cadmorph
