#include "volume/components.h"

#include <catch2/catch.hpp>
#include <cmath>

#include "../core/sample_meshes.h"
#include "core/boundary.h"
#include "core/parallel.h"
#include "core/rbf/rbf_system.h"
#include "volume/volume_morph.h"
#include "volume_meshes.h"

namespace cadmorph {

using namespace testing;

TEST_CASE("Regions are components where their interface is prescribed", "[volume]") {
  const Mesh mesh = two_halves();
  const std::vector<Index> with_interface = extract_boundary(mesh).nodes;
  const auto components = split_components(mesh, with_interface);
  REQUIRE(components.size() == 2);
  Index interface = 0, volume = 0;
  for (const Index n : with_interface) interface += std::abs(mesh.points(n, 0) - 0.5) < 1e-9;
  for (const auto& c : components) volume += static_cast<Index>(c.volume.size());
  CHECK(interface == 49);
  CHECK(static_cast<Index>(components[0].surface.size() + components[1].surface.size()) ==
        static_cast<Index>(with_interface.size()) + interface);
  CHECK(volume == mesh.node_count() - static_cast<Index>(with_interface.size()));
}

TEST_CASE("Regions with a free interface node are one component", "[volume]") {
  const Mesh mesh = two_halves();
  CHECK(split_components(mesh, cube_surface(mesh)).size() == 1);
}

TEST_CASE("Components side by side give what they give one by one", "[volume][threads]") {
  const Mesh mesh = two_halves();
  const std::vector<Index> surface = extract_boundary(mesh).nodes;
  Points target = rows_of(mesh.points, surface);
  for (Index i = 0; i < target.rows(); ++i)
    target.row(i) +=
        0.1 * Eigen::RowVector3d(std::sin(3 * target(i, 1)), target(i, 0) * target(i, 2),
                                 std::cos(2 * target(i, 0)));
  set_thread_count(1);
  const Points serial = VolumeMorph(mesh, surface).morph(target);
  set_thread_count(0);
  const Points parallel = VolumeMorph(mesh, surface).morph(target);
  CHECK((serial.array() == parallel.array()).all());
  // And what a mesh of that component alone gives.
  for (const Component& component : split_components(mesh, surface)) {
    std::vector<Index> nodes;
    for (const Index i : component.surface) nodes.push_back(surface[i]);
    const RbfSystem alone(rows_of(mesh.points, nodes), Kernel::triharmonic_3d());
    const RowMatrix moved =
        alone.solve(target(component.surface, Eigen::all) - rows_of(mesh.points, nodes))
            .evaluate(rows_of(mesh.points, component.volume));
    for (std::size_t i = 0; i < component.volume.size(); ++i) {
      const Index n = component.volume[i];
      CHECK((parallel.row(n) - mesh.points.row(n) - moved.row(static_cast<Index>(i))).norm() <
            1e-12);
    }
  }
}

TEST_CASE("A component moves by its own surface alone", "[volume]") {
  const Mesh mesh = two_halves();
  const std::vector<Index> surface = extract_boundary(mesh).nodes;
  Points target = rows_of(mesh.points, surface);
  for (Index i = 0; i < target.rows(); ++i)  // the right half stretches, the left one stays
    if (target(i, 0) > 0.5) target(i, 0) = 0.5 + 1.5 * (target(i, 0) - 0.5);
  const Points moved = VolumeMorph(mesh, surface).morph(target);
  for (Index n = 0; n < mesh.node_count(); ++n) {
    const double x = mesh.points(n, 0);
    // Affine on each side: exact to the system's condition times rounding.
    CHECK(moved(n, 0) == Approx(x > 0.5 ? 0.5 + 1.5 * (x - 0.5) : x).margin(1e-8));
  }
}

}  // namespace cadmorph
