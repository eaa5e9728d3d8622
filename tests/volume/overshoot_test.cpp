#include <Eigen/Geometry>
#include <catch2/catch.hpp>
#include <cmath>
#include <map>
#include <numbers>

#include "../core/sample_meshes.h"
#include "core/parallel.h"
#include "core/quality.h"
#include "volume/deformation_field.h"
#include "volume/volume_morph.h"
#include "volume_meshes.h"

namespace cadmorph {
namespace {

using namespace testing;
using Eigen::Vector3d;

double farthest(const Points& from, const Points& to) {
  return (to - from).rowwise().norm().maxCoeff();
}

Motion turn_about(const Vector3d& centre, double degrees) {
  const Eigen::Matrix3d q =
      Eigen::AngleAxisd(degrees * std::numbers::pi / 180, Vector3d(1, 2, 2).normalized())
          .toRotationMatrix();
  return [=](const Vector3d& x) -> Vector3d { return centre + q * (x - centre); };
}

Vector3d grow(const Vector3d& x) { return 1.25 * x; }
Vector3d flatten(const Vector3d& x) { return {x[0], x[1], 0.7 * x[2]}; }
Vector3d grow_in_plane(const Vector3d& x) { return {1.25 * x[0], 1.1 * x[1], 0}; }
Vector3d turn_in_plane(const Vector3d& x) {
  return {std::cos(0.3) * x[0] - std::sin(0.3) * x[1], std::sin(0.3) * x[0] + std::cos(0.3) * x[1],
          0};
}
Vector3d shift(const Vector3d& x) { return x + Vector3d(0.2, 0, 0.1); }

}  // namespace

TEST_CASE("No node moves farther than 1.2 times the farthest of the surface",
          "[volume][overshoot]") {
  const double far = GENERATE(10.0, 50.0, 500.0);
  const int n = GENERATE(8, 18);  // few centres, and those that the adaptive solver takes
  if (far > 100 && n > 8) return;
  const FarField field = far_field(n, far);
  const Orientation orientation = detect_orientation(field.mesh);
  const VolumeMorph morph(field.mesh, field.surface);
  const std::map<std::string, Motion> motions{{"grow", grow},
                                              {"flatten", flatten},
                                              {"turn", turn_about(Vector3d::Zero(), 20)},
                                              {"turn about a far point", turn_about({3, 0, 0}, 5)},
                                              {"shift", shift}};
  for (const auto& [name, motion] : motions) {
    INFO(name << ", far field of " << far << ", " << field.surface.size() << " surface nodes");
    const Points moved = targets(field, motion);
    const double asked = farthest(rows_of(field.mesh.points, field.surface), moved);
    const Points result = morph.morph(moved);
    CHECK(rows_of(result, field.surface) == moved);
    CHECK(farthest(field.mesh.points, result) <= 1.2 * asked);
    const QualityReport quality = measure_quality(field.mesh, result, orientation);
    CHECK(quality.min > (name == "flatten" || name == "turn" ? 0.7 : 0.83));
    // Of a body that the full interpolant does not run on from nothing changes.
    if (name == "shift")
      CHECK(quality.mean >=
            measure_quality(field.mesh, field.mesh.points, orientation).mean - 1e-3);
  }
}

TEST_CASE("A field that runs on within a few spacings of the surface is not held",
          "[volume][overshoot]") {
  const auto dish = [](const Vector3d& x) -> Vector3d {
    return x + Vector3d(0.01 * ((x - Vector3d(0.5, 0.5, 0.5)).squaredNorm() - 0.5), 0, 0);
  };
  const auto times = [&](int n) {
    const Mesh mesh = cube(CellType::Hexahedron, n);
    const std::vector<Index> surface = cube_surface(mesh);
    const Points start = rows_of(mesh.points, surface), moved = mapped(start, dish);
    const Points result = VolumeMorph(mesh, surface).morph(moved);
    return farthest(mesh.points, result) / farthest(start, moved);
  };
  CHECK(times(8) > 2);  // the middle, four spacings deep
  CHECK(times(16) <= 1.2);
}

TEST_CASE("A far field moves affinely with all of its surface", "[volume][overshoot]") {
  const FarField field = far_field(8, 50);
  const Motion turn = turn_about({1, 2, 3}, 40);
  const auto affine = [&](const Vector3d& x) -> Vector3d { return 1.5 * turn(x); };
  const Points result = VolumeMorph(field.mesh, field.surface)
                            .morph(mapped(rows_of(field.mesh.points, field.surface), affine));
  CHECK(farthest(mapped(field.mesh.points, affine), result) < 1e-9 * 100);
}

TEST_CASE("A body that shifts or turns keeps the heights of its layers", "[volume][overshoot]") {
  FarField field = far_field(10, 50);
  const auto count = static_cast<Index>(field.body.size());
  // The four lowest layers, 2 % of the radius in all, grow by a factor of two each.
  for (int k = 1; k <= 4; ++k)
    for (Index i = 0; i < count; ++i)
      field.mesh.points.row(k * count + i) =
          (1 + 0.02 * (std::pow(2, k) - 1) / 15) * field.mesh.points.row(i);
  const auto height = [&](const Points& points, int layer, Index i) {
    return (points.row((layer + 1) * count + i) - points.row(layer * count + i)).norm();
  };
  const VolumeMorph morph(field.mesh, field.surface);
  // Of a large turn the bound takes some of the heights; its share of five degrees keeps them.
  for (const auto& [motion, allowed] :
       std::vector<std::pair<Motion, double>>{{shift, 0.001},
                                              {turn_about({3, 0, 0}, 5), 0.01},
                                              {turn_about(Vector3d::Zero(), 20), 0.03}}) {
    const Points result = morph.morph(targets(field, motion));
    Index kept = 0;
    for (int layer = 0; layer < 4; ++layer)
      for (Index i = 0; i < count; ++i)
        kept +=
            std::abs(height(result, layer, i) / height(field.mesh.points, layer, i) - 1) < allowed;
    CHECK(static_cast<double>(kept) >= 0.99 * 4 * static_cast<double>(count));
  }
}

TEST_CASE("A flat mesh round a body keeps within 1.2 times its motion", "[volume][overshoot]") {
  const FarField field = flat_far_field(60, 50);
  const VolumeMorph morph(field.mesh, field.surface);
  for (const Motion& motion : {Motion(grow_in_plane), Motion(turn_in_plane)}) {
    const Points moved = targets(field, motion);
    const double asked = farthest(rows_of(field.mesh.points, field.surface), moved);
    const Points result = morph.morph(moved);
    CHECK(farthest(field.mesh.points, result) <= 1.2 * asked);
    CHECK(result.col(2).cwiseAbs().maxCoeff() < 1e-12);
    const QualityReport quality =
        measure_quality(field.mesh, result, detect_orientation(field.mesh));
    CHECK(quality.inverted == 0);
  }
}

TEST_CASE("A held field is the same in any company, on any number of threads, and stored",
          "[volume][overshoot]") {
  const FarField field = far_field(8, 50);
  const VolumeMorph morph(field.mesh, field.surface);
  const std::vector<Points> motions{targets(field, grow), targets(field, shift),
                                    targets(field, turn_about(Vector3d::Zero(), 20))};
  set_thread_count(1);
  std::vector<Points> alone;
  for (const Points& motion : motions) alone.push_back(morph.morph(motion));
  set_thread_count(5);
  const std::vector<VolumeMorphResult> together = morph.morph_each(motions);
  for (std::size_t i = 0; i < motions.size(); ++i) CHECK(together[i].positions == alone[i]);
  const DeformationField recorded(record_deformation(field.mesh, morph, motions[0], 1));
  CHECK(farthest(recorded.apply(field.mesh.points).positions, alone[0]) < 1e-9 * 50);
  set_thread_count(0);
}

}  // namespace cadmorph
