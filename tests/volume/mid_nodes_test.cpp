#include "volume/mid_nodes.h"

#include <algorithm>
#include <catch2/catch.hpp>

#include "core/cell_topology.h"
#include "core/validity.h"
#include "tests/core/sample_meshes.h"
#include "volume_meshes.h"

namespace cadmorph {
namespace {

using namespace testing;
using Eigen::Vector3d;

const std::vector<CellType> kSecondOrder = {CellType::QuadraticTetra,
                                            CellType::QuadraticHexahedron,
                                            CellType::TriquadraticHexahedron,
                                            CellType::QuadraticWedge,
                                            CellType::BiquadraticQuadraticWedge,
                                            CellType::BiquadraticQuadraticPyramid};

Vector3d bent(const Vector3d& x) {
  return x + 0.1 * Vector3d(x[1] * x[1], x[2] * x[0], std::sin(3 * x[0]));
}

Vector3d affine(const Vector3d& x) {
  Eigen::Matrix3d map;
  map << 0.2, -1.1, 0.3, 0.9, 0.1, -0.2, 0.4, 0.3, 2;
  return map * x + Vector3d(1, -2, 3);
}

}  // namespace

TEST_CASE("Nodes amid bent edges go with an affine map of the corners", "[volume][mid_nodes]") {
  for (const CellType type : kSecondOrder) {
    INFO(static_cast<int>(type));
    Mesh mesh = cube(type, 3);
    mesh.points = mapped(mesh.points, bent);
    const MidNodes mid_nodes(mesh, mesh.points);
    const Points image = mapped(mesh.points, affine);
    Points corners = image;
    for (Index i = 0; i < mid_nodes.count(); ++i) corners.row(mid_nodes.node(i)).setConstant(1e9);
    const Points carried = mid_nodes.carried(mesh, corners);
    REQUIRE(carried.rows() == mid_nodes.count());
    for (Index i = 0; i < mid_nodes.count(); ++i)
      CHECK((carried.row(i) - image.row(mid_nodes.node(i))).norm() < 1e-12);
  }
}

TEST_CASE("Nodes amid edges that slide are laid at the feet of perpendiculars",
          "[volume][mid_nodes]") {
  // A cube whose top goes up into a paraboloid, where all but its corners slide.
  const Mesh mesh = cube(CellType::QuadraticTetra, 4);
  const MidNodes mid_nodes(mesh, mesh.points);
  const std::vector<Index> surface = cube_surface(mesh);
  SlidingNodes sliding;
  std::vector<char> is_fixed(std::size_t(mesh.node_count()), 0);
  for (const Index node : surface) {
    is_fixed[node] = 1;
    if (mesh.points(node, 2) == 1 && mid_nodes.contains(node)) sliding.nodes.push_back(node);
  }
  const auto height = [](double x, double y) { return 1 + 0.3 * x * x + 0.2 * y * y; };
  sliding.slides = RowMatrix::Zero(std::ssize(sliding.nodes), 2);
  sliding.at = [&](Index i, const Eigen::Vector2d& slide) {
    const double x = mesh.points(sliding.nodes[i], 0) + slide[0],
                 y = mesh.points(sliding.nodes[i], 1) + slide[1];
    SlidePlace place{{x, y, height(x, y)}, {}};
    place.tangents << 1, 0, 0, 1, 0.6 * x, 0.4 * y;
    return place;
  };
  sliding.is_within = [](Index, const Eigen::Vector2d&) { return true; };
  Points plain = mesh.points, positions = mesh.points;
  for (Index n = 0; n < mesh.node_count(); ++n)
    plain(n, 2) = mesh.points(n, 2) * height(mesh.points(n, 0), mesh.points(n, 1));
  for (Index n = 0; n < mesh.node_count(); ++n)
    if (!mid_nodes.contains(n)) positions.row(n) = plain.row(n);
  RowMatrix slides = sliding.slides;
  lay_mid_nodes(mesh, is_fixed, sliding, plain, positions, slides);

  int slid = 0, fixed = 0, inner = 0;
  for (Index i = 0; i < mid_nodes.count(); ++i) {
    const Index node = mid_nodes.node(i);
    const Eigen::RowVector3d middle = mid_nodes.middle(i, positions);
    const auto found = std::ranges::lower_bound(sliding.nodes, node);
    if (found != sliding.nodes.end() && *found == node) {
      ++slid;
      const Index row = found - sliding.nodes.begin();
      const SlidePlace place = sliding.at(row, slides.row(row).transpose());
      CHECK((place.point.transpose() - positions.row(node)).norm() < 1e-12);
      const Vector3d gap = middle.transpose() - place.point;
      CHECK((place.tangents.transpose() * gap).norm() < 1e-9);
    } else if (is_fixed[node]) {
      ++fixed;
      CHECK(positions.row(node) == plain.row(node));
    } else {
      ++inner;
      CHECK((positions.row(node) - middle).norm() < 1e-12);
    }
  }
  CHECK(slid > 20);
  CHECK(fixed > 20);
  CHECK(inner > 20);
}

TEST_CASE("Cells whose edges are straight and stay so are linear ones", "[volume][mid_nodes]") {
  for (const CellType type : kSecondOrder) {
    INFO(static_cast<int>(type));
    const Mesh mesh = cube(type, 3);
    const MidNodes mid_nodes(mesh, mesh.points);
    const Index node = mid_nodes.node(0);
    Points now = mesh.points;
    now.row(node) += Eigen::RowVector3d(0.01, 0.02, 0.01);
    const auto check = [&](const Mesh& linear) {
      REQUIRE(linear.cell_count() == mesh.cell_count());
      Index curved = 0;
      for (Index c = 0; c < mesh.cell_count(); ++c) {
        const auto nodes = mesh.cell(c), kept = linear.cell(c);
        const bool is_bent = std::ranges::count(nodes, node) > 0;
        curved += is_bent;
        CHECK(linear.types[c] == (is_bent ? type : linear_type(type)));
        CHECK(std::ranges::equal(
            kept, is_bent ? nodes : nodes.first(std::size_t(info_of(type).corners))));
      }
      CHECK(curved > 0);
      CHECK(curved < mesh.cell_count());
    };
    check(with_linear_cells(mesh, mid_nodes, mesh.points, now));
    check(with_linear_cells(mesh, mid_nodes, now, mesh.points));
    check(with_linear_cells(mesh, mid_nodes, mesh.points, mesh.points,
                            [&](Index other) { return other == node; }));
  }
}

TEST_CASE("Corners alone are oriented as the cells that they are in place of",
          "[volume][mid_nodes]") {
  Mesh mesh = cube(CellType::QuadraticHexahedron, 2);
  mesh.points.col(0) *= -1;
  const Orientation orientation = detect_orientation(mesh);
  const Orientation of_corners = orientation_of_corners(mesh, orientation);
  REQUIRE(orientation[std::size_t(CellType::QuadraticHexahedron)] == -1);
  const Mesh corners = corners_alone(mesh);
  const auto hexahedron = std::size_t(CellType::Hexahedron);
  CHECK(of_corners[hexahedron] == detect_orientation(corners)[hexahedron]);
  CHECK(check_validity(corners, mesh.points, of_corners).invalid == 0);
}

}  // namespace cadmorph
