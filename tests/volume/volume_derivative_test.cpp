#include "volume/volume_derivative.h"

#include <Eigen/Geometry>
#include <catch2/catch.hpp>
#include <cmath>

#include "../core/sample_meshes.h"
#include "core/boundary.h"
#include "core/errors.h"
#include "core/rbf/point_order.h"
#include "volume/volume_morph.h"
#include "volume_meshes.h"

namespace cadmorph {
namespace {

using namespace testing;
using Eigen::Vector3d;

RowMatrix noise(Index rows, Index columns, unsigned seed) {
  RowMatrix result(rows, columns);
  std::uint64_t state = seed;
  for (Index i = 0; i < result.size(); ++i) {
    state = 6364136223846793005u * state + 1442695040888963407u;
    result.data()[i] = static_cast<double>(state >> 11) * 0x1p-52 - 1;
  }
  return result;
}

double dot(const RowMatrix& a, const RowMatrix& b) { return a.cwiseProduct(b).sum(); }

// |<v, F u> - <F^T v, u>| over |v| |F u|.
double asymmetry(const VolumeDerivative& map, const RowMatrix& u, const RowMatrix& v) {
  const RowMatrix forward = map.forward(u);
  return std::abs(dot(v, forward) - dot(map.adjoint(v), u)) / (v.norm() * forward.norm());
}

Vector3d bend(const Vector3d& x) {
  return x + 0.1 * Vector3d(std::sin(3 * x[1]), x[0] * x[2], std::cos(2 * x[0]));
}

struct Case {
  Mesh mesh;
  std::vector<Index> surface;
  Points target;
  VolumeMorphOptions options;

  Points motion() const { return target - rows_of(mesh.points, surface); }
  double size() const {
    return (mesh.points.colwise().maxCoeff() - mesh.points.colwise().minCoeff()).norm();
  }
};

VolumeDerivative derivative(const Case& given) {
  return VolumeMorph(given.mesh, given.surface, given.options).derivative(given.target);
}

// The maps are each other's transpose, for the motion asked for and for noise, whose weights are
// large ones that cancel. With its kernels fixed the morph itself is linear: the map of its motion
// is its result, `accuracy` of the mesh's size apart.
void check(const Case& given, const VolumeDerivative& map, double accuracy) {
  const RowMatrix v = noise(given.mesh.node_count(), 3, 2);
  CHECK(asymmetry(map, given.motion(), v) < 1e-12);
  CHECK(asymmetry(map, noise(static_cast<Index>(given.surface.size()), 3, 1), v) < 1e-12);
  const Points moved = given.mesh.points + Points(map.forward(given.motion()));
  const Points expected = VolumeMorph(given.mesh, given.surface, given.options).morph(given.target);
  CHECK((moved - expected).cwiseAbs().maxCoeff() < accuracy * given.size());
  CHECK(rows_of(moved, given.surface).isApprox(given.target, 1e-14));
}

void check(const Case& given, double accuracy) { check(given, derivative(given), accuracy); }

Case bent(Mesh mesh, std::vector<Index> surface) {
  Case result{std::move(mesh), std::move(surface), {}, {}};
  result.target = mapped(rows_of(result.mesh.points, result.surface), bend);
  return result;
}

Case shaken_cube(int n, SolverKind solver) {
  Mesh mesh = cube(CellType::Hexahedron, n);
  const std::vector<Index> surface = cube_surface(mesh);
  mesh.points = shaken(mesh.points, 0.2 / n, 7);
  Case result = bent(std::move(mesh), surface);
  result.options.rbf.solver = solver;
  return result;
}

}  // namespace

TEST_CASE("Forward and adjoint of every solver are transposes, and the morph itself",
          "[volume][derivative]") {
  for (const SolverKind solver : {SolverKind::Auto, SolverKind::Lu, SolverKind::Ldlt,
                                  SolverKind::Cholesky, SolverKind::Fast, SolverKind::Adaptive}) {
    INFO("solver " << static_cast<int>(solver));
    Case given = shaken_cube(8, solver);
    given.options.rbf.tolerance = 1e-10;
    check(given, 1e-9);
  }
}

TEST_CASE("The derivative goes through adaptive centres and the correction",
          "[volume][derivative]") {
  const Case given = shaken_cube(20, SolverKind::Auto);  // 2,402 surface nodes
  check(given, 1e-6);                                    // the morph's own tolerance
}

TEST_CASE("The derivative is the slope of the morph where the same centres serve",
          "[volume][derivative]") {
  Case given = shaken_cube(8, SolverKind::Cholesky);
  const VolumeMorph morph(given.mesh, given.surface, given.options);
  const RowMatrix u = noise(static_cast<Index>(given.surface.size()), 3, 5);
  const RowMatrix slope = morph.derivative(given.target).forward(u);
  for (const double h : {1e-2, 1e-5}) {
    const Points plus = morph.morph(given.target + h * Points(u));
    const Points minus = morph.morph(given.target - h * Points(u));
    CHECK(((plus - minus) / (2 * h) - slope).cwiseAbs().maxCoeff() < 1e-12 / h);
  }
}

TEST_CASE("Kernels of other kinds have derivatives", "[volume][derivative]") {
  for (const Kernel& kernel : {Kernel::biharmonic_3d(), Kernel::quadharmonic_3d(),
                               Kernel{.kind = KernelKind::WendlandC2, .shape = 0.5}}) {
    Case given = shaken_cube(6, SolverKind::Auto);
    given.options.kernel = kernel;
    check(given, 1e-9);
  }
}

TEST_CASE("The derivative goes through components", "[volume][derivative]") {
  const Mesh mesh = two_halves();
  check(bent(mesh, extract_boundary(mesh).nodes), 1e-10);
}

TEST_CASE("The derivative goes through flat layers", "[volume][derivative]") {
  for (const SolverKind solver : {SolverKind::Auto, SolverKind::Adaptive}) {
    const Mesh mesh = graded_layers(12, 1e-3);
    Case given = bent(mesh, cube_surface(mesh));
    given.target = mapped(rows_of(mesh.points, given.surface), wave);
    given.options.rbf.solver = solver;
    check(given, 1e-5);
  }
}

TEST_CASE("The derivative of a mesh without inner nodes is the identity", "[volume][derivative]") {
  const Mesh mesh = cube(CellType::Tetra, 1);
  const Case given = bent(mesh, cube_surface(mesh));
  const VolumeDerivative map = derivative(given);
  const RowMatrix u = noise(8, 3, 1);
  CHECK(map.forward(u).isApprox(u(map.surface_nodes(), Eigen::all)));
  CHECK(map.adjoint(u).isApprox(u(map.surface_nodes(), Eigen::all)));
}

TEST_CASE("The derivative goes through anchors in a far field", "[volume][derivative]") {
  for (const int n : {8, 18}) {  // few centres, and those that the adaptive solver takes
    const FarField field = far_field(n, 50);
    Case given{field.mesh, field.surface, {}, {}};
    given.target = targets(field, [](const Vector3d& x) -> Vector3d { return 1.25 * x; });
    const VolumeDerivative map = derivative(given);
    check(given, map, 1e-5);
    // Held, it keeps within the bound.
    CHECK(map.forward(given.motion()).rowwise().norm().maxCoeff() <= 1.2 * 0.25 * 1.0001);
  }
}

TEST_CASE("Motions that anchors hold are known beforehand", "[volume][derivative]") {
  int held = 0;
  for (const int n : {8, 18})
    for (const double far : {10.0, 50.0}) {
      const FarField field = far_field(n, far);
      const VolumeMorph morph(field.mesh, field.surface);
      VolumeMorphOptions options;
      options.rbf.solver = SolverKind::Cholesky;  // asked for, it has no anchors
      const VolumeMorph full(field.mesh, field.surface, options);
      const VolumeMorph::HoldCheck check = morph.hold_check();
      const Points start = rows_of(field.mesh.points, field.surface);
      for (const auto& motion : std::vector<Motion>{
               [](const Vector3d& x) -> Vector3d { return 1.25 * x; },
               [](const Vector3d& x) -> Vector3d { return x + Vector3d(0.2, 0, 0.1); },
               [](const Vector3d& x) -> Vector3d { return x + 0.2 * Vector3d(x[1], -x[0], 0); }}) {
        const Points moved = targets(field, motion) - start;
        RbfReport report;
        morph.morph(start + moved, &report);
        CAPTURE(n, far, report.reason);
        if (report.reason.find("hold the field") != std::string::npos) {
          ++held;
          CHECK(check.may_be_held(start + moved));
          CHECK(check.may_be_held(start + 1e-6 * moved));
        }
        CHECK(!full.hold_check().may_be_held(start + moved));
      }
      CHECK(!check.may_be_held(start));
      CHECK(!check.may_be_held(1.1 * start));
    }
  CHECK(held >= 3);
  const Case cube = shaken_cube(8, SolverKind::Auto);
  CHECK(!VolumeMorph(cube.mesh, cube.surface).hold_check().may_be_held(cube.target));
}

TEST_CASE("Motions that anchors hold are known where few of the nodes don't tell",
          "[volume][derivative]") {
  const FarField field = far_field(18, 50);
  const VolumeMorph morph(field.mesh, field.surface);
  const Points start = rows_of(field.mesh.points, field.surface);
  Points moved = start;
  // The nodes that are farthest from each other, which a guess takes, shift; those between them
  // grow.
  const auto count = static_cast<Index>(field.body.size());
  std::vector<Index> order = farthest_point_order(start).rows;
  std::erase_if(order, [&](Index row) { return row >= count; });
  for (Index i = 0; i < count; ++i)
    if (i < 400)
      moved(order[i], 0) += 0.1;
    else
      moved.row(order[i]) *= 1.1;
  RbfReport report;
  morph.morph(moved, &report);
  CAPTURE(report.reason);
  CHECK(report.reason.find("hold the field") != std::string::npos);
  CHECK(morph.hold_check().may_be_held(moved));
}

TEST_CASE("Columns of a derivative are independent", "[volume][derivative]") {
  const Case given = shaken_cube(20, SolverKind::Auto);
  const VolumeDerivative map = derivative(given);
  const RowMatrix u = noise(static_cast<Index>(given.surface.size()), 7, 1);
  const RowMatrix v = noise(given.mesh.node_count(), 7, 2);
  const RowMatrix forward = map.forward(u), adjoint = map.adjoint(v);
  for (const int c : {0, 3, 6}) {
    CHECK((map.forward(u.col(c)) - forward.col(c)).norm() < 1e-9 * forward.col(c).norm());
    CHECK((map.adjoint(v.col(c)) - adjoint.col(c)).norm() < 1e-9 * adjoint.col(c).norm());
  }
}

TEST_CASE("What has no derivative, and wrong sizes, are refused", "[volume][derivative]") {
  Case given = shaken_cube(4, SolverKind::Iqr);
  CHECK_THROWS_AS(derivative(given), InvalidInputError);
  given.options.rbf.solver = SolverKind::Auto;
  given.options.method = MorphMethod::Femwarp;
  CHECK_THROWS_AS(derivative(given), InvalidInputError);
  given.options.method = MorphMethod::Rbf;
  const VolumeDerivative map = derivative(given);
  const auto m = static_cast<Index>(given.surface.size());
  CHECK_THROWS_AS(map.forward(noise(m + 1, 3, 1)), InvalidInputError);
  CHECK_THROWS_AS(map.adjoint(noise(m, 3, 1)), InvalidInputError);
  RowMatrix u = noise(m, 3, 1);
  u(2, 1) = std::nan("");
  CHECK_THROWS_AS(map.forward(u), InvalidInputError);
}

}  // namespace cadmorph
