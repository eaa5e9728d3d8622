#include "core/boundary.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <catch2/catch.hpp>
#include <map>
#include <numeric>
#include <random>

#include "core/cell_topology.h"
#include "core/errors.h"
#include "core/parallel.h"
#include "sample_meshes.h"

using namespace cadmorph;
using namespace cadmorph::testing;

namespace {

Eigen::Vector3d area(const Mesh& mesh, const Boundary& boundary, Index f) {
  const auto nodes = boundary.facet(f);
  const int corners = corner_count(boundary.types[f], std::ssize(nodes));
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (int i = 0; i < corners; ++i) {
    const Eigen::Vector3d a = mesh.points.row(nodes[i]).transpose();
    const Eigen::Vector3d b = mesh.points.row(nodes[(i + 1) % corners]).transpose();
    sum += a.cross(b) / 2;
  }
  return sum;
}

/// Volume inside the facets, by the divergence theorem: right only if all normals point out.
double enclosed_volume(const Mesh& mesh, const Boundary& boundary) {
  double volume = 0;
  for (Index f = 0; f < boundary.facet_count(); ++f)
    volume += area(mesh, boundary, f).dot(mesh.points.row(boundary.facet(f)[0]).transpose()) / 3;
  return volume;
}

/// Number of facets of the cube of cube(type, n).
Index expected_facets(CellType type, Index n) {
  switch (linear_type(type)) {
    case CellType::Tetra:
      return 12 * n * n;
    case CellType::Wedge:
      return 4 * n * n + 4 * n * n;
    default:
      return 6 * n * n;
  }
}

bool is_on_cube(const Eigen::RowVector3d& x) {
  return (x.array() < 1e-12).any() || (x.array() > 1 - 1e-12).any();
}

}  // namespace

TEST_CASE("shells beside solids and within them are facets, those on the outside are not",
          "[core][boundary]") {
  Mesh mesh = cube(CellType::Hexahedron, 3);
  const Boundary alone = extract_boundary(mesh);
  const Index of_cube = mesh.node_count();
  const auto node_at = [&](double x, double y, double z) {
    for (Index n = 0; n < mesh.node_count(); ++n)
      if ((mesh.points.row(n) - Eigen::RowVector3d(x, y, z)).norm() < 1e-9) return n;
    return Index(-1);
  };
  const auto add_quad = [&](const std::vector<Index>& nodes) {
    add_cell(mesh, CellType::Quad, nodes);
  };
  // On the cube's side, within it, and a sheet that stands on its edge.
  const double t = 1.0 / 3;
  add_quad({node_at(0, 0, 0), node_at(t, 0, 0), node_at(t, t, 0), node_at(0, t, 0)});
  add_quad(
      {node_at(t, t, t), node_at(2 * t, t, t), node_at(2 * t, 2 * t, t), node_at(t, 2 * t, t)});
  mesh.points.conservativeResize(of_cube + 2, 3);
  mesh.points.row(of_cube) << t, 0, 2;
  mesh.points.row(of_cube + 1) << 0, 0, 2;
  add_quad({node_at(0, 0, 1), node_at(t, 0, 1), of_cube, of_cube + 1});
  const Boundary boundary = extract_boundary(mesh);
  REQUIRE(boundary.facet_count() == alone.facet_count() + 2);
  std::vector<Index> inner, sheets;
  for (Index f = 0; f < boundary.facet_count(); ++f) {
    if (boundary.neighbour[f] < 0) continue;
    (boundary.neighbour[f] == boundary.cell[f] ? sheets : inner).push_back(f);
  }
  REQUIRE(inner.size() == 1);
  for (const Index node : boundary.facet(inner[0])) {
    CHECK(mesh.points(node, 2) == Approx(t));
    CHECK_FALSE(is_on_cube(mesh.points.row(node)));
  }
  REQUIRE(sheets == std::vector<Index>{boundary.facet_count() - 1});
  CHECK(boundary.cell[sheets[0]] == mesh.cell_count() - 1);
  CHECK(std::ssize(boundary.nodes) == std::ssize(alone.nodes) + 4 + 2);
}

TEST_CASE("the boundary of a cube is its surface, for every cell type", "[core][boundary]") {
  for (CellType type : solid_types()) {
    CAPTURE(static_cast<int>(type));
    const Mesh mesh = cube(type, 3);
    const Boundary boundary = extract_boundary(mesh);
    REQUIRE(boundary.facet_count() == expected_facets(type, 3));
    REQUIRE(enclosed_volume(mesh, boundary) == Approx(1).epsilon(1e-12));
    std::vector<Index> on_surface;
    for (Index n = 0; n < mesh.node_count(); ++n)
      if (is_on_cube(mesh.points.row(n))) on_surface.push_back(n);
    REQUIRE(boundary.nodes == on_surface);
    REQUIRE(std::ranges::is_sorted(boundary.cell));
    REQUIRE(std::ranges::all_of(boundary.neighbour, [](Index c) { return c == -1; }));
  }
}

TEST_CASE("the facets are those a brute-force count finds", "[core][boundary]") {
  for (CellType type : {CellType::Tetra, CellType::QuadraticPyramid, CellType::Polyhedron}) {
    Mesh mesh = cube(type, 3);
    std::vector<Index> number(mesh.node_count());  // nodes in another order
    std::iota(number.begin(), number.end(), 0);
    std::shuffle(number.begin(), number.end(), std::mt19937(3));
    for (Index& node : mesh.connectivity) node = number[node];
    for (std::size_t at = 0; at < mesh.polyhedron_faces.size(); ++at)
      if (at % 5 != 0) mesh.polyhedron_faces[at] = number[mesh.polyhedron_faces[at]];
    Points points(mesh.node_count(), 3);
    for (Index n = 0; n < mesh.node_count(); ++n) points.row(number[n]) = mesh.points.row(n);
    mesh.points = points;

    std::map<std::vector<Index>, std::vector<std::pair<Index, std::vector<Index>>>> faces;
    for (Index c = 0; c < mesh.cell_count(); ++c)
      for (const Facet& facet : cell_facets(mesh, c)) {
        std::vector<Index> key = facet.nodes;
        std::ranges::sort(key);
        faces[key].emplace_back(c, facet.nodes);
      }
    std::vector<std::pair<Index, std::vector<Index>>> expected, found;
    for (const auto& [key, uses] : faces)
      if (uses.size() == 1) expected.push_back(uses[0]);
    const Boundary boundary = extract_boundary(mesh);
    for (Index f = 0; f < boundary.facet_count(); ++f)
      found.emplace_back(boundary.cell[f],
                         std::vector<Index>(boundary.facet(f).begin(), boundary.facet(f).end()));
    std::ranges::sort(expected);
    std::ranges::sort(found);
    REQUIRE(found == expected);
  }
}

TEST_CASE("a part inside of a region is bounded as one between regions is", "[core][boundary]") {
  for (CellType type : solid_types()) {
    CAPTURE(static_cast<int>(type));
    Mesh mesh = cube(type, 4);
    const CellNeighbours neighbours = find_cell_neighbours(mesh);
    std::vector<char> is_middle;
    for (Index n = 0; n < mesh.node_count(); ++n)
      is_middle.push_back(std::abs(mesh.points(n, 0) - 0.5) < 1e-9);
    const Boundary found = extract_boundary(mesh, neighbours, is_middle);
    set_regions_by_x(mesh, 0.5);
    const Boundary expected = extract_boundary(mesh, neighbours);
    const auto sorted = [](const Boundary& boundary) {
      std::vector<std::vector<Index>> facets;
      for (Index f = 0; f < boundary.facet_count(); ++f) {
        facets.emplace_back(boundary.facet(f).begin(), boundary.facet(f).end());
        std::ranges::sort(facets.back());
      }
      std::ranges::sort(facets);
      return facets;
    };
    CHECK(found.facet_count() > expected_facets(type, 4));
    CHECK(sorted(found) == sorted(expected));
    CHECK(found.nodes == expected.nodes);
  }
}

TEST_CASE("the interface of two blocks is there once, owned by the lower region",
          "[core][boundary]") {
  for (CellType type : solid_types()) {
    CAPTURE(static_cast<int>(type));
    Mesh mesh = cube(type, 4);
    set_regions_by_x(mesh, 0.5);
    const bool is_swapped = GENERATE(false, true);
    if (is_swapped)
      for (int& region : mesh.regions) region = 7 - 9 * region;
    const Boundary boundary = extract_boundary(mesh);
    const bool has_triangles = linear_type(type) == CellType::Tetra;
    Index interfaces = 0;
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (Index f = 0; f < boundary.facet_count(); ++f) {
      if (boundary.neighbour[f] < 0) continue;
      ++interfaces;
      REQUIRE(mesh.region(boundary.cell[f]) < mesh.region(boundary.neighbour[f]));
      for (Index node : boundary.facet(f)) REQUIRE(mesh.points(node, 0) == Approx(0.5));
      sum += area(mesh, boundary, f);
    }
    REQUIRE(interfaces == (has_triangles ? 32 : 16));
    REQUIRE(boundary.facet_count() == expected_facets(type, 4) + interfaces);
    REQUIRE(sum.x() == Approx(is_swapped ? -1 : 1).epsilon(1e-12));
  }
}

TEST_CASE("normals point out of a mesh in the mirrored node order too", "[core][boundary]") {
  for (CellType type : solid_types_without_polyhedron()) {
    CAPTURE(static_cast<int>(type));
    Mesh mesh = cube(type, 2);
    mesh.points.col(0) *= -1;
    const Boundary boundary = extract_boundary(mesh);
    REQUIRE(enclosed_volume(mesh, boundary) == Approx(1).epsilon(1e-12));
    for (Index f = 0; f < boundary.facet_count(); ++f) {
      const auto nodes = boundary.facet(f);
      const int corners = corner_count(boundary.types[f], std::ssize(nodes));
      const int step = boundary.types[f] == CellType::QuadraticLinearQuad ? 2 : 1;
      int mid = corners;
      for (int i = 0; i < corners && mid < std::ssize(nodes); i += step, ++mid) {
        const auto middle =
            (mesh.points.row(nodes[i]) + mesh.points.row(nodes[(i + 1) % corners])) / 2;
        REQUIRE((mesh.points.row(nodes[mid]) - middle).norm() < 1e-14);
      }
    }
  }
}

TEST_CASE("shell cells on a solid add nothing to its boundary", "[core][boundary]") {
  const Mesh solid = cube(CellType::Tetra, 2);
  const Boundary expected = extract_boundary(solid);
  Mesh mesh = solid;
  for (Index f = 0; f < expected.facet_count(); ++f) {
    mesh.types.push_back(CellType::Triangle);
    for (Index node : expected.facet(f)) mesh.connectivity.push_back(node);
    mesh.offsets.push_back(std::ssize(mesh.connectivity));
  }
  const Boundary boundary = extract_boundary(mesh);
  REQUIRE(boundary.connectivity == expected.connectivity);
  REQUIRE(boundary.cell == expected.cell);
}

TEST_CASE("without solid cells the shell cells are the surface", "[core][boundary]") {
  Mesh mesh;
  mesh.points = Points::Random(9, 3);
  mesh.types = {CellType::Line, CellType::Triangle, CellType::Pixel, CellType::Polygon};
  mesh.offsets = {0, 2, 5, 9, 14};
  mesh.connectivity = {0, 1, 0, 1, 2, 1, 3, 4, 5, 8, 4, 5, 2, 0};
  const Boundary boundary = extract_boundary(mesh);
  REQUIRE(boundary.types == std::vector{CellType::Triangle, CellType::Quad, CellType::Polygon});
  REQUIRE(boundary.connectivity == std::vector<Index>{0, 1, 2, 1, 3, 5, 4, 8, 4, 5, 2, 0});
  REQUIRE(boundary.cell == std::vector<Index>{1, 2, 3});
  REQUIRE(boundary.nodes == std::vector<Index>{0, 1, 2, 3, 4, 5, 8});
}

TEST_CASE("a collapsed hexahedron meets the wedge beside it", "[core][boundary]") {
  // Two prisms that make up the unit cube, one of them written as a hexahedron.
  Mesh mesh = cube(CellType::Hexahedron, 1);
  mesh.types = {CellType::Hexahedron, CellType::Wedge};
  mesh.offsets = {0, 8, 14};
  mesh.connectivity = {0, 1, 3, 3, 4, 5, 7, 7, 0, 2, 3, 4, 6, 7};
  const Boundary boundary = extract_boundary(mesh);
  REQUIRE(boundary.facet_count() == 8);
  REQUIRE(std::ranges::count(boundary.types, CellType::Triangle) == 4);
  REQUIRE(enclosed_volume(mesh, boundary) == Approx(1).epsilon(1e-12));
}

TEST_CASE("a face of three cells and a mesh without surface are refused", "[core][boundary]") {
  Mesh mesh = cube(CellType::Hexahedron, 2);
  for (int i = 0; i < 8; ++i) mesh.connectivity.push_back(mesh.connectivity[i]);
  mesh.types.push_back(CellType::Hexahedron);
  mesh.offsets.push_back(std::ssize(mesh.connectivity));
  REQUIRE_THROWS_AS(extract_boundary(mesh), InvalidInputError);
  const Mesh line = single_cell(CellType::Line, RowMatrix::Identity(2, 3));
  REQUIRE_THROWS_AS(extract_boundary(line), InvalidInputError);
}

TEST_CASE("the boundary is the same on one thread and on all", "[core][boundary]") {
  const Mesh mesh = cube(CellType::Tetra, 20);  // some chunks
  const Boundary all = extract_boundary(mesh);
  set_thread_count(1);
  const Boundary one = extract_boundary(mesh);
  set_thread_count(0);
  REQUIRE(one.connectivity == all.connectivity);
  REQUIRE(one.cell == all.cell);
}

TEST_CASE("the facets at a node are those that use it", "[core][boundary]") {
  const Mesh mesh = cube(CellType::QuadraticTetra, 2);
  const Boundary boundary = extract_boundary(mesh);
  const Incidence incidence = node_facets(boundary, mesh.node_count());
  for (Index n = 0; n < mesh.node_count(); ++n) {
    std::vector<Index> expected;
    for (Index f = 0; f < boundary.facet_count(); ++f)
      if (std::ranges::count(boundary.facet(f), n)) expected.push_back(f);
    REQUIRE(std::ranges::equal(incidence.at(n), expected));
  }
}
