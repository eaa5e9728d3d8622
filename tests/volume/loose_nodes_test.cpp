#include "volume/loose_nodes.h"

#include <Eigen/Geometry>
#include <catch2/catch.hpp>
#include <cmath>

#include "../core/sample_meshes.h"
#include "volume_meshes.h"

namespace cadmorph {
namespace {

using namespace testing;
using Eigen::RowVector3d;
using Eigen::Vector3d;

// Appends nodes, and where they are after the field moved them, of which nothing is to be left.
struct Case {
  explicit Case(Mesh given, const Motion& motion) : mesh(std::move(given)) {
    boundary = extract_boundary(mesh);
    positions = mapped(mesh.points, motion);
  }

  Index add(const RowVector3d& at, const RowVector3d& field) {
    const Index node = mesh.node_count();
    mesh.points.conservativeResize(node + 1, 3);
    positions.conservativeResize(node + 1, 3);
    mesh.points.row(node) = at;
    positions.row(node) = field;
    return node;
  }

  void carry() {
    carry_loose_nodes(mesh, boundary, positions(boundary.nodes, Eigen::all), positions);
  }

  Mesh mesh;
  Boundary boundary;
  Points positions;
};

// Moves what is near the middle, and less of what is far.
Motion near_motion(const Vector3d& shift, double turn, double growth) {
  return [=](const Vector3d& x) -> Vector3d {
    const double share = 1 / (1 + std::pow(std::max(x.norm() - 1, 0.0), 2));
    const Vector3d moved = growth * (Eigen::AngleAxisd(turn, Vector3d::UnitZ()) * x) + shift;
    return x + share * (moved - x);
  };
}

}  // namespace

TEST_CASE("A node amid a hole's rim stays there", "[volume][loose]") {
  const Vector3d shift(2, -1, 0);
  for (const double growth : {1.0, 1.4}) {
    Case c(flat_far_field(24, 8).mesh, near_motion(shift, 0.3, growth));
    const Points before = c.positions;
    const Index middle = c.add({0, 0, 0}, {7, 7, 7}), above = c.add({0, 0, 1.5}, {7, 7, 7});
    c.carry();
    CHECK(c.positions.topRows(before.rows()) == before);
    CHECK((c.positions.row(middle) - shift.transpose()).norm() < 0.01);
    CHECK((c.positions.row(above) - RowVector3d(2, -1, 1.5)).norm() < 0.1);
  }
}

TEST_CASE("A node in the void of a solid moves with its wall, one in the solid with the field",
          "[volume][loose]") {
  const Vector3d shift(0.5, 1, -2);
  Case c(far_field(6, 5).mesh, near_motion(shift, 0.4, 1.2));
  const Index middle = c.add({0, 0, 0}, {7, 7, 7});
  const Index inside = c.add({3, 0.1, 0.2}, {7, 7, 7});
  c.carry();
  CHECK((c.positions.row(middle) - shift.transpose()).norm() < 0.01);
  CHECK(c.positions.row(inside) == RowVector3d(7, 7, 7));
}

TEST_CASE("Affine motions are those of loose nodes", "[volume][loose]") {
  const Motion map = [](const Vector3d& x) {
    return Vector3d(1.3 * x.x() + 0.2 * x.y() + 4, x.y() - 0.1 * x.z(), 0.7 * x.z() - 1);
  };
  Case c(cube(CellType::Tetra, 3), map);
  const RowVector3d far(9, -4, 3), near(1.2, 0.5, 0.5);
  const Index a = c.add(far, {0, 0, 0}), b = c.add(near, {0, 0, 0});
  c.carry();
  CHECK((c.positions.row(a) - map(far.transpose()).transpose()).norm() < 1e-6);
  CHECK((c.positions.row(b) - map(near.transpose()).transpose()).norm() < 1e-6);
}

TEST_CASE("Far off, nodes move as what is nearest to them, and not at all where that rests",
          "[volume][loose]") {
  // Stretched by 4 % from x = 0 on, and bulged so that no affine map is it.
  const Motion map = [](const Vector3d& x) {
    return Vector3d(1.04 * x.x(), x.y(), x.z() + 0.1 * x.x() * x.y() * (1 - x.y()));
  };
  Case c(cube(CellType::Tetra, 20), map);
  const Index right = c.add({20, 0.5, 0.5}, {7, 7, 7}), left = c.add({-8, 0.5, 0.5}, {7, 7, 7});
  c.carry();
  CHECK((c.positions.row(right) - RowVector3d(20.04, 0.5, 0.52)).norm() < 0.02);
  CHECK((c.positions.row(left) - RowVector3d(-8, 0.5, 0.5)).norm() < 0.01);

  Case still(cube(CellType::Tetra, 3), [](const Vector3d& x) { return x; });
  const RowVector3d at(1.0 / 3, 17.1, -0.7);
  const Index node = still.add(at, at);
  still.carry();
  CHECK(still.positions.row(node) == at);
}

TEST_CASE("Lines of beams stay straight between their ends", "[volume][loose]") {
  // A bolt through the hole; its other end far off, where little moves.
  const Vector3d shift(2, -1, 0);
  Case c(flat_far_field(24, 8).mesh, near_motion(shift, 0, 1));
  std::vector<Index> nodes;
  for (int i = 0; i <= 4; ++i) nodes.push_back(c.add({0, 0, 0.1 * i}, {0, 0, 0.1 * i}));
  for (int i = 0; i < 4; ++i) {
    const Index ends[] = {nodes[i], nodes[i + 1]};
    add_cell(c.mesh, CellType::Line, ends);
  }
  // A beam from a node of the rim: that one stays, the other end goes along.
  const Index rim = c.boundary.nodes[0];
  const Index tip = c.add(c.mesh.points.row(rim) + RowVector3d(0, 0, 0.2), {7, 7, 7});
  const Index beam[] = {rim, tip};
  add_cell(c.mesh, CellType::Line, beam);
  const RowVector3d rim_after = c.positions.row(rim);
  c.carry();
  for (int i = 0; i <= 4; ++i)
    CHECK((c.positions.row(nodes[i]) - RowVector3d(2, -1, 0.1 * i)).norm() < 0.02);
  CHECK(c.positions.row(rim) == rim_after);
  CHECK((c.positions.row(tip) - rim_after - RowVector3d(0, 0, 0.2)).norm() < 0.1);
}

}  // namespace cadmorph
