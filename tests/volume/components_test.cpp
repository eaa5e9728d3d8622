#include "volume/components.h"

#include <Eigen/Geometry>
#include <catch2/catch.hpp>
#include <cmath>
#include <map>

#include "../core/sample_meshes.h"
#include "core/boundary.h"
#include "core/parallel.h"
#include "core/rbf/rbf_system.h"
#include "volume/volume_morph.h"
#include "volume_meshes.h"

namespace cadmorph {

using namespace testing;
using Eigen::Vector3d;

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

TEST_CASE("Parts whose free nodes lie two at a place are one component", "[volume]") {
  const Mesh joined = two_halves();
  Mesh mesh = joined;  // each half with nodes of its own
  std::map<Index, Index> twin;
  for (Index c = 0; c < mesh.cell_count(); ++c) {
    if (mesh.regions[c] == joined.regions[0]) continue;
    for (Index i = mesh.offsets[c]; i < mesh.offsets[c + 1]; ++i) {
      Index& node = mesh.connectivity[i];
      if (std::abs(joined.points(node, 0) - 0.5) > 1e-9) continue;
      const auto [entry, is_new] = twin.try_emplace(node, mesh.node_count());
      if (is_new) {
        mesh.points.conservativeResize(mesh.node_count() + 1, 3);
        mesh.points.bottomRows(1) = joined.points.row(node);
      }
      node = entry->second;
    }
  }
  std::vector<Index> outer, free;
  for (Index n = 0; n < mesh.node_count(); ++n)
    if ((mesh.points.row(n).array() - 0.5).abs().maxCoeff() > 0.5 - 1e-9)
      outer.push_back(n);
    else if (std::abs(mesh.points(n, 0) - 0.5) < 1e-9)
      free.push_back(n);
  REQUIRE(free.size() == 50);
  CHECK(split_components(mesh, outer).size() == 2);
  CHECK(split_components(mesh, outer, free).size() == 1);
  // One side held holds the other.
  const auto middle =
      std::ranges::stable_partition(free, [&](Index node) { return node >= joined.node_count(); });
  outer.insert(outer.end(), free.begin(), middle.begin());
  CHECK(split_components(mesh, outer, {middle.begin(), middle.end()}).size() == 1);
}

TEST_CASE("Nodes of no cell belong to the nearest component", "[volume]") {
  Mesh mesh = two_halves();
  const std::vector<Index> surface = extract_boundary(mesh).nodes;
  const Index first = mesh.node_count();
  mesh.points.conservativeResize(first + 2, 3);
  mesh.points.row(first) << -0.2, 0.5, 0.5;
  mesh.points.row(first + 1) << 1.3, 0.5, 0.5;
  const auto components = split_components(mesh, surface);
  REQUIRE(components.size() == 2);
  for (const Component& component : components) {
    REQUIRE(component.loose == 1);
    const double of_cells = mesh.points(component.volume.front(), 0);
    CHECK((mesh.points(component.volume.back(), 0) > 0.5) == (of_cells > 0.5));
  }
  // They are in the derivative, too.
  mesh.points(first + 1, 0) = 40;
  const VolumeMorph morph(mesh, surface);
  const Points at = rows_of(mesh.points, surface);
  const RowMatrix way = 0.01 * shaken(at, 1, 7);
  const RowMatrix moved = morph.morph(at + way) - mesh.points;
  CHECK((morph.derivative(at).forward(way) - moved).cwiseAbs().maxCoeff() < 1e-7);
  CHECK(moved.row(first).norm() > 1e-3);
  CHECK(moved.row(first + 1).norm() < 1);
}

TEST_CASE("Nodes of no cell follow the mesh and change nothing of it", "[volume]") {
  // A body that turns in a large far field, with a reference node in its middle and a dummy.
  const FarField field = far_field(8, 50);
  const Eigen::AngleAxisd turn(0.35, Vector3d(1, 2, 3).normalized());
  const Points target = targets(field, [&](const Vector3d& x) -> Vector3d { return turn * x; });
  RbfReport plain_report;
  const Points plain = VolumeMorph(field.mesh, field.surface).morph(target, &plain_report);
  REQUIRE(plain_report.reason.find("hold the field") != std::string::npos);
  Mesh mesh = field.mesh;
  const Index first = mesh.node_count();
  mesh.points.conservativeResize(first + 2, 3);
  mesh.points.row(first).setZero();
  mesh.points.row(first + 1) << 1e6, -2e5, 7;
  RbfReport report;
  const VolumeMorph morph(mesh, field.surface);
  const Points moved = morph.morph(target, &report);
  CHECK((moved.topRows(first) - plain).cwiseAbs().maxCoeff() < 1e-12);
  CHECK(moved.row(first).norm() < 0.03);
  CHECK((moved.row(first + 1) - mesh.points.row(first + 1)).norm() < 1e-3);
  CHECK(report.reason.find("1 nodes of no element lie outside") != std::string::npos);
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
