#include "volume/nearest_affine.h"

#include <catch2/catch.hpp>

#include "../core/sample_meshes.h"
#include "core/plane_mesh.h"

namespace cadmorph {
namespace {

using namespace testing;
using Eigen::Matrix3d;
using Eigen::RowVector3d;

Points mapped(const Points& points, const Matrix3d& map, const RowVector3d& shift) {
  return (points * map.transpose()).rowwise() + shift;
}

const Matrix3d kStretch = (Matrix3d() << 1.3, 0.2, 0, 0, 0.8, 0.1, 0.05, 0, 1.1).finished();
const RowVector3d kShift(3, -2, 0.5);

TEST_CASE("An affine motion is its own nearest affine map") {
  const Mesh mesh = cube(CellType::Hexahedron, 4);
  const Points to = mapped(mesh.points, kStretch, kShift);
  const NearestAffine nearest = nearest_affine(mesh, mesh.points, to);
  CHECK((nearest.image - to).cwiseAbs().maxCoeff() < 1e-13);
  CHECK(nearest.farthest < 1e-13);
  CHECK(nearest.is_whole);
}

TEST_CASE(
    "What is over is orthogonal to all affine maps, and one that turns inside out is not whole") {
  const Mesh mesh = cube(CellType::Hexahedron, 4);
  const Points bent = shaken(mapped(mesh.points, kStretch, kShift), 0.1, 1);
  const NearestAffine nearest = nearest_affine(mesh, mesh.points, bent);
  const Points over = bent - nearest.image;
  CHECK((mesh.points.transpose() * over).cwiseAbs().maxCoeff() < 1e-11);
  CHECK(over.colwise().sum().cwiseAbs().maxCoeff() < 1e-11);
  CHECK(nearest.farthest == Approx(over.rowwise().norm().maxCoeff()));
  CHECK(nearest.is_whole);
  // A bump without a stretch leaves all of the motion over.
  Points bump = mesh.points;
  bump.col(2).array() += 0.2 * (6.283185307 * mesh.points.col(0).array()).sin();
  CHECK_FALSE(nearest_affine(mesh, mesh.points, bump).is_whole);
  const Matrix3d mirror = RowVector3d(-1, 1, 1).asDiagonal();
  const NearestAffine turned =
      nearest_affine(mesh, mesh.points, mapped(mesh.points, mirror, kShift));
  CHECK(turned.farthest < 1e-13);
  CHECK_FALSE(turned.is_whole);
}

TEST_CASE("The normal of a plane mesh stays") {
  Mesh mesh = single_cell(CellType::Quad,
                          (RowMatrix(4, 3) << 0, 0, 0, 2, 0, 0, 2, 1, 0, 0, 1, 0).finished());
  Points to = mesh.points;
  to.col(0) *= 1.5;
  const NearestAffine nearest = nearest_affine(mesh, mesh.points, to);
  CHECK((nearest.image - to).cwiseAbs().maxCoeff() < 1e-14);
  CHECK(nearest.is_whole);
}

}  // namespace
}  // namespace cadmorph
