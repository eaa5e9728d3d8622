#include "volume/sound_volumes.h"

#include <Eigen/Geometry>
#include <catch2/catch.hpp>

#include "../core/sample_meshes.h"
#include "core/boundary.h"
#include "core/validity.h"
#include "volume/untangle.h"

namespace cadmorph {
namespace {

using namespace testing;
using Eigen::RowVector3d;

std::vector<char> surface_marks(const Mesh& mesh) {
  std::vector<char> is_fixed(mesh.node_count(), 0);
  for (const Index node : extract_boundary(mesh).nodes) is_fixed[node] = 1;
  return is_fixed;
}

Index node_at(const Points& points, const RowVector3d& x) {
  Index node = 0;
  (points.rowwise() - x).rowwise().squaredNorm().minCoeff(&node);
  return node;
}

}  // namespace

TEST_CASE("Nodes of unsound volumes move to where these are sound", "[volume][finite-volumes]") {
  for (const CellType type : {CellType::Hexahedron, CellType::Wedge, CellType::Pyramid}) {
    INFO(static_cast<int>(type));
    Mesh mesh = cube(type, 4);
    mesh.is_of_finite_volumes = true;
    const std::vector<char> is_fixed = surface_marks(mesh);
    const Orientation orientation = detect_orientation(mesh);
    Points positions = mesh.points;
    // An inner node behind its neighbours, and a surface node past the next inner one.
    positions.row(node_at(mesh.points, {0.5, 0.5, 0.5})) += RowVector3d(0.4, 0.4, 0.4);
    positions.row(node_at(mesh.points, {0, 0.5, 0.25})) += RowVector3d(0.27, 0, 0);
    const auto unsound = check_validity(mesh, positions, orientation).invalid_cells;
    REQUIRE(unsound.size() > 2);
    const Points mended = mend_volumes(mesh, positions, is_fixed, orientation, unsound);
    CHECK(check_validity(mesh, mended, orientation).invalid == 0);
    Index fixed = 0;
    for (Index n = 0; n < mesh.node_count(); ++n) {
      if (!is_fixed[n]) continue;
      ++fixed;
      CHECK(mended.row(n) == positions.row(n));
    }
    CHECK(fixed >= 98);  // corners on the surface of 4 x 4 x 4 cells
    const UntangleResult repaired = untangle(mesh, positions, is_fixed, orientation);
    CHECK(repaired.report.before == std::ssize(unsound));
    CHECK(repaired.report.after == 0);
    CHECK(repaired.report.moved_nodes > 0);
    // The cells get their shapes back, too.
    CHECK(measure_quality(mesh, repaired.positions, orientation).min > 0);
  }
}

TEST_CASE("Volumes that fixed nodes hold unsound leave the others where they are",
          "[volume][finite-volumes]") {
  Mesh mesh = cube(CellType::Hexahedron, 3);
  mesh.is_of_finite_volumes = true;
  const std::vector<char> is_fixed(mesh.node_count(), 1);
  const Orientation orientation = detect_orientation(mesh);
  Points positions = mesh.points;
  positions.row(node_at(mesh.points, {1, 1, 1})).setConstant(0.2);
  const auto unsound = check_validity(mesh, positions, orientation).invalid_cells;
  REQUIRE(!unsound.empty());
  CHECK(mend_volumes(mesh, positions, is_fixed, orientation, unsound) == positions);
}

}  // namespace cadmorph
