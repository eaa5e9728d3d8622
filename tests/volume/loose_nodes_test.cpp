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

namespace {

// The cube's face x = 1 turns rigidly with what is beside it, its face x = 0 rests.
Vector3d turned(const Vector3d& x) {
  const Vector3d axis = Vector3d(1, 2, 3).normalized();
  return Eigen::AngleAxisd(0.4, axis) * (x - Vector3d(1, 0, 0)) + Vector3d(1.5, 0.2, -0.1);
}

std::vector<Index> nodes_at(const Mesh& mesh, double x) {
  std::vector<Index> nodes;
  for (Index n = 0; n < mesh.node_count(); ++n)
    if (mesh.points(n, 0) == x) nodes.push_back(n);
  return nodes;
}

const Motion kTurnedEnd = [](const Vector3d& x) -> Vector3d {
  return x.x() > 0.9 ? turned(x) : x.x() < 0.1 ? x : x + 0.3 * x.y() * Vector3d::UnitZ();
};

RowVector3d turned_row(const RowVector3d& x) { return turned(x.transpose()).transpose(); }

}  // namespace

TEST_CASE("A node moves as a body with what it is tied to", "[volume][loose]") {
  Case c(cube(CellType::Tetra, 4), kTurnedEnd);
  const std::vector<Index> right = nodes_at(c.mesh, 1), left = nodes_at(c.mesh, 0);
  // Far off; each nearer to what it is not tied to.
  const RowVector3d far(-20, 3, 7), near(1.01, 0.3, 0.3), beyond(40, 1, 1);
  const Index a = c.add(far, {7, 7, 7}), b = c.add(near, {7, 7, 7}), d = c.add(beyond, {7, 7, 7});
  const Index mixed = c.add(far, {7, 7, 7});
  c.mesh.ties = {{a, right}, {b, left}, {d, {a}}, {mixed, {right[0]}}, {mixed, {right[1]}}};
  c.carry();
  CHECK((c.positions.row(a) - turned_row(far)).norm() < 1e-12);
  CHECK(c.positions.row(b) == near);
  CHECK((c.positions.row(d) - beyond - turned_row(far) + far).norm() < 1e-12);  // one node
  // Two nodes turn as the line through them, and not about it.
  const Vector3d before = (c.mesh.points.row(right[1]) - c.mesh.points.row(right[0])).transpose();
  const Vector3d after = (c.positions.row(right[1]) - c.positions.row(right[0])).transpose();
  const Vector3d axis = before.cross(after);
  const Eigen::AngleAxisd least(std::atan2(axis.norm(), before.dot(after)), axis.normalized());
  const RowVector3d lever = far - c.mesh.points.row(right[0]);
  CHECK(
      (c.positions.row(mixed) - c.positions.row(right[0]) - (least * lever.transpose()).transpose())
          .norm() < 1e-12);
}

TEST_CASE("Loose nodes that are tied to each other follow in order", "[volume][loose]") {
  Case c(cube(CellType::Tetra, 4), kTurnedEnd);
  const std::vector<Index> right = nodes_at(c.mesh, 1);
  const RowVector3d at(5, 5, 5);
  std::vector<Index> nodes;
  for (int i = 0; i < 5; ++i) nodes.push_back(c.add(at + RowVector3d(i, i * i, 0), {7, 7, 7}));
  const auto add_last = [](Case& to) {
    return std::vector<Index>{to.add({-3, 0, 0}, {7, 7, 7}), to.add({-3, 1, 0}, {7, 7, 7}),
                              to.add({9, 9, 9}, {7, 7, 7}), to.add({-3, 0, 1}, {7, 7, 7})};
  };
  Case untied = c;
  add_last(untied);
  untied.carry();
  const std::vector<Index> last = add_last(c);
  // The fourth is tied to the face and to the first, the first to the three behind it; a node of
  // the face to the fifth.
  c.mesh.ties = {{nodes[0], {nodes[1], nodes[2], nodes[3]}},
                 {nodes[1], {nodes[3]}},
                 {nodes[2], {nodes[3]}},
                 {nodes[3], right},
                 {nodes[3], {nodes[0]}},
                 {right[0], {right[1], right[2], right[3], right[20], nodes[4]}}};
  // A ring, one tied to it, and ties to nothing: as without ties.
  c.mesh.ties.insert(c.mesh.ties.end(), {{last[0], {last[1]}},
                                         {last[1], {last[0]}},
                                         {last[2], {last[0]}},
                                         {last[3], {}},
                                         {last[3], {last[3]}}});
  c.carry();
  CHECK((c.positions.row(nodes[3]) - turned_row(at + RowVector3d(3, 9, 0))).norm() < 1e-12);
  CHECK((c.positions.row(nodes[4]) - turned_row(at + RowVector3d(4, 16, 0))).norm() < 1e-12);
  const RowVector3d shift = c.positions.row(nodes[3]) - c.mesh.points.row(nodes[3]);
  for (int i = 0; i <= 2; ++i)
    CHECK((c.positions.row(nodes[i]) - c.mesh.points.row(nodes[i]) - shift).norm() < 1e-12);
  for (const Index node : last) CHECK(c.positions.row(node) == untied.positions.row(node));
}

TEST_CASE("A node that is tied ends lines of beams", "[volume][loose]") {
  Case c(cube(CellType::Tetra, 4), kTurnedEnd);
  const std::vector<Index> right = nodes_at(c.mesh, 1), left = nodes_at(c.mesh, 0);
  std::vector<Index> nodes;
  for (int i = 0; i <= 4; ++i) nodes.push_back(c.add({0.25 * i, 3, 0}, {0.25 * i, 3, 0}));
  for (int i = 0; i < 4; ++i) {
    const Index ends[] = {nodes[i], nodes[i + 1]};
    add_cell(c.mesh, CellType::Line, ends);
  }
  c.mesh.ties = {{nodes[0], left}, {nodes[4], right}};
  c.carry();
  const RowVector3d end = turned_row({1, 3, 0});
  CHECK(c.positions.row(nodes[0]) == RowVector3d(0, 3, 0));
  CHECK((c.positions.row(nodes[4]) - end).norm() < 1e-12);
  CHECK((c.positions.row(nodes[2]) - (RowVector3d(0, 3, 0) + end) / 2).norm() <
        1e-8);  // a billionth of the field's is left along lines
}

}  // namespace cadmorph
