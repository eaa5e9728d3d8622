#include <vtkCellType.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <catch2/catch.hpp>
#include <limits>
#include <set>

#include "core/cell_topology.h"
#include "core/errors.h"
#include "core/mesh.h"
#include "sample_meshes.h"

using namespace cadmorph;
using namespace cadmorph::testing;

namespace {

std::set<Index> as_set(std::span<const Index> nodes) { return {nodes.begin(), nodes.end()}; }

/// Corner polygon's area vector.
Eigen::Vector3d area(const Mesh& mesh, const Facet& facet) {
  const int corners = corner_count(facet.type, std::ssize(facet.nodes));
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (int i = 0; i < corners; ++i) {
    const Eigen::Vector3d a = mesh.points.row(facet.nodes[i]).transpose();
    const Eigen::Vector3d b = mesh.points.row(facet.nodes[(i + 1) % corners]).transpose();
    sum += a.cross(b) / 2;
  }
  return sum;
}

}  // namespace

TEST_CASE("the faces of each solid cell type are VTK's", "[core][mesh]") {
  for (CellType type : solid_types_without_polyhedron()) {
    CAPTURE(static_cast<int>(type));
    const Mesh mesh = cube(type, 1);
    const auto facets = cell_facets(single_cell(type, RowMatrix::Zero(mesh.cell(0).size(), 3)), 0);
    std::set<std::set<Index>> ours, theirs;
    for (const Facet& facet : facets) ours.insert(as_set(facet.nodes));
    for (const auto& face : vtk_faces(type)) theirs.insert(as_set(face));
    REQUIRE(ours == theirs);
  }
}

TEST_CASE("the facets of a cell of positive volume have outward normals", "[core][mesh]") {
  for (CellType type : solid_types()) {
    CAPTURE(static_cast<int>(type));
    const Mesh mesh = cube(type, 1);
    for (Index c = 0; c < mesh.cell_count(); ++c) {
      double volume = 0;  // by the divergence theorem
      Eigen::Vector3d closed = Eigen::Vector3d::Zero();
      for (const Facet& facet : cell_facets(mesh, c)) {
        const Eigen::Vector3d normal = area(mesh, facet);
        volume += normal.dot(mesh.points.row(facet.nodes[0]).transpose()) / 3;
        closed += normal;
      }
      REQUIRE(closed.norm() < 1e-14);  // rounding of unit areas
      REQUIRE(volume == Approx(1.0 / static_cast<double>(mesh.cell_count())).epsilon(1e-12));
    }
  }
}

TEST_CASE("each mid node of a facet lies between the corners beside it", "[core][mesh]") {
  for (CellType type : solid_types_without_polyhedron()) {
    if (linear_type(type) == type) continue;
    CAPTURE(static_cast<int>(type));
    const Mesh mesh = cube(type, 1);
    for (const Facet& facet : cell_facets(mesh, 0)) {
      const int corners = corner_count(facet.type, std::ssize(facet.nodes));
      const int step = facet.type == CellType::QuadraticLinearQuad ? 2 : 1;
      int next = corners;
      for (int i = 0; i < corners; i += step, ++next) {
        const auto middle =
            (mesh.points.row(facet.nodes[i]) + mesh.points.row(facet.nodes[(i + 1) % corners])) / 2;
        REQUIRE((mesh.points.row(facet.nodes[next]) - middle).norm() < 1e-14);
      }
      REQUIRE(std::ssize(facet.nodes) - next <= 1);  // a node in the facet's middle
    }
  }
}

TEST_CASE("a vertex has no mid node, and each mid node lies between others", "[core][mesh]") {
  CHECK(mid_nodes_of(CellType::Vertex).empty());
  CHECK(mid_nodes_of(CellType::Line).empty());
  for (const CellType type : {CellType::QuadraticEdge, CellType::BiquadraticQuad,
                              CellType::TriquadraticHexahedron, CellType::QuadraticWedge}) {
    CHECK(std::ssize(mid_nodes_of(type)) == cell_node_count(type) - info_of(type).corners);
    for (const LocalMidNode& mid : mid_nodes_of(type)) CHECK(mid.corners.size() >= 2);
  }
}

TEST_CASE("dimension and node counts follow the type", "[core][mesh]") {
  REQUIRE(dimension(CellType::Vertex) == 0);
  REQUIRE(dimension(CellType::QuadraticEdge) == 1);
  REQUIRE(dimension(CellType::Polygon) == 2);
  REQUIRE(dimension(CellType::Polyhedron) == 3);
  REQUIRE(dimension(static_cast<CellType>(VTK_LAGRANGE_HEXAHEDRON)) == -1);
  REQUIRE(cell_node_count(CellType::TriquadraticHexahedron) == 27);
  REQUIRE(cell_node_count(CellType::Polygon) == -1);
  REQUIRE(corner_count(CellType::QuadraticTriangle, 6) == 3);
  REQUIRE(corner_count(CellType::BiquadraticQuad, 9) == 4);
  REQUIRE(corner_count(CellType::Polygon, 7) == 7);
}

TEST_CASE("a shell cell has no facets of its own", "[core][mesh]") {
  const Mesh mesh = single_cell(CellType::Triangle, RowMatrix::Identity(3, 3));
  REQUIRE_THROWS_AS(cell_facets(mesh, 0), InvalidInputError);
}

TEST_CASE("a sound mesh of every type passes the check", "[core][mesh]") {
  for (CellType type : solid_types()) REQUIRE_NOTHROW(check_mesh(cube(type, 2)));
}

TEST_CASE("the check names what is wrong with a mesh", "[core][mesh]") {
  Mesh mesh = cube(CellType::Tetra, 1);
  const auto fails_with = [&](const std::string& text) {
    REQUIRE_THROWS_AS(check_mesh(mesh), InvalidInputError);
    REQUIRE_THROWS_WITH(check_mesh(mesh), Catch::Contains(text));
  };
  SECTION("no nodes") { fails_with((mesh = Mesh{}, "no nodes")); }
  SECTION("no cells") {
    mesh.types.clear();
    mesh.connectivity.clear();
    mesh.offsets = {0};
    fails_with("no cells");
  }
  SECTION("a coordinate that is no number") {
    mesh.points(5, 1) = std::numeric_limits<double>::quiet_NaN();
    fails_with("node 5");
  }
  SECTION("a node that is not there") {
    mesh.connectivity[4 * 2 + 1] = mesh.node_count();
    fails_with("cell 2");
  }
  SECTION("a cell of an unknown type") {
    mesh.types[3] = static_cast<CellType>(VTK_LAGRANGE_TETRAHEDRON);
    fails_with("cell 3");
  }
  SECTION("a cell of the wrong number of nodes") {
    mesh.types[1] = CellType::Hexahedron;
    fails_with("cell 1");
  }
  SECTION("offsets that go back") {
    std::swap(mesh.offsets[1], mesh.offsets[2]);
    fails_with("offsets");
  }
  SECTION("regions of another mesh") {
    mesh.regions = {1, 2};
    fails_with("region");
  }
  SECTION("a polyhedron whose face is cut off") {
    mesh = cube(CellType::Polyhedron, 1);
    mesh.polyhedron_faces[25] = 9;
    fails_with("face");
  }
  SECTION("a polyhedron with a face of a node that is not its own") {
    mesh = cube(CellType::Polyhedron, 1);
    mesh.connectivity.pop_back();
    mesh.offsets.back() = 7;
    fails_with("cell 0 has a face with node 6");
  }
  SECTION("a polyhedron without faces") {
    mesh = cube(CellType::Polyhedron, 1);
    mesh.polyhedron_offsets.clear();
    fails_with("polyhedron faces");
  }
}
