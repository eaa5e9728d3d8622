#include <Eigen/Geometry>
#include <catch2/catch.hpp>
#include <cmath>

#include "../core/sample_meshes.h"
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

}  // namespace cadmorph
