#include <catch2/catch.hpp>
#include <filesystem>
#include <sstream>

#include "../core/sample_meshes.h"
#include "core/archive_types.h"
#include "core/boundary.h"
#include "core/rbf/rbf_system.h"
#include "volume/volume_morph.h"
#include "volume_meshes.h"

namespace cadmorph {
namespace {

using namespace testing;

VolumeMorph stored_and_restored(const Mesh& mesh, const VolumeMorph& morph) {
  std::stringstream stream;
  {
    OutputArchive archive(stream);
    morph.store(archive);
  }
  InputArchive archive(stream);
  return {mesh, morph.options(), archive};
}

Points target_of(const Mesh& mesh, const std::vector<Index>& surface) {
  Points target = rows_of(mesh.points, surface);
  for (Index i = 0; i < target.rows(); ++i)
    target.row(i) +=
        0.05 * Eigen::RowVector3d(std::sin(3 * target(i, 1)), target(i, 0) * target(i, 2),
                                  std::cos(2 * target(i, 0)));
  return target;
}

void check_restored(const Mesh& mesh, const std::vector<Index>& surface,
                    const VolumeMorphOptions& options) {
  const VolumeMorph made(mesh, surface, options);
  const VolumeMorph restored = stored_and_restored(mesh, made);
  const Points target = target_of(mesh, surface);
  RbfReport before, after;
  CHECK(restored.morph(target, &after) == made.morph(target, &before));
  CHECK(restored.surface_nodes() == surface);
  CHECK(after.solver == before.solver);
  CHECK(after.reason == before.reason);
  CHECK(after.centres == before.centres);
  CHECK(after.iterations == before.iterations);
  CHECK(after.reciprocal_condition == before.reciprocal_condition);
}

// Nodes nearer to each other than the fast solver keeps.
Mesh with_near_nodes(Mesh mesh, const std::vector<Index>& surface) {
  mesh.points.row(surface[1]) = mesh.points.row(surface[0]) + Eigen::RowVector3d(1e-5, 0, 0);
  return mesh;
}

}  // namespace

TEST_CASE("A volume morph that was stored moves nodes as before, bit for bit", "[volume][store]") {
  const Mesh mesh = cube(CellType::Hexahedron, 9);
  const std::vector<Index> surface = cube_surface(mesh);
  for (const SolverKind solver : {SolverKind::Cholesky, SolverKind::Ldlt, SolverKind::Lu,
                                  SolverKind::Iqr, SolverKind::Fast, SolverKind::Adaptive}) {
    INFO(static_cast<int>(solver));
    check_restored(mesh, surface, {.rbf = {.solver = solver, .tolerance = 1e-3}});
  }
  check_restored(mesh, surface, {.kernel = Kernel::biharmonic_3d()});
  check_restored(mesh, surface, {.method = MorphMethod::Lbwarp});
  check_restored(with_near_nodes(mesh, surface), surface, {.rbf = {.solver = SolverKind::Fast}});
}

TEST_CASE("The trees of a large morph come back, too", "[volume][store]") {
  const Mesh mesh = cube(CellType::Hexahedron, 47);  // 13,256 surface nodes
  const std::vector<Index> surface = cube_surface(mesh);
  REQUIRE(surface.size() > 12000);
  check_restored(mesh, surface, {.rbf = {.solver = SolverKind::Fast}});
  check_restored(mesh, surface, {.rbf = {.solver = SolverKind::Adaptive}});
}

TEST_CASE("Components come back one by one", "[volume][store]") {
  const Mesh mesh = two_halves();
  check_restored(mesh, extract_boundary(mesh).nodes, {});
}

}  // namespace cadmorph
