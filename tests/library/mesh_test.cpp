#include <cadmorph/cadmorph.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <limits>

#include "workplace.h"

namespace cadmorph {
namespace {

using namespace testing;
using Catch::Matchers::Contains;

constexpr std::uint8_t kTetra = 10, kQuadraticTetra = 24, kPolyhedron = 42;

// A tetrahedron.
MeshArrays tetra() {
  MeshArrays arrays;
  arrays.points = Points::Zero(4, 3);
  arrays.points.bottomRows(3).setIdentity();
  arrays.types = {kTetra};
  arrays.offsets = {0, 4};
  arrays.connectivity = {0, 1, 2, 3};
  return arrays;
}

MeshArrays arrays_of(const Mesh& mesh) {
  return {.points = mesh.points(),
          .types = mesh.types(),
          .offsets = mesh.offsets(),
          .connectivity = mesh.connectivity(),
          .regions = mesh.regions(),
          .groups = mesh.groups()};
}

}  // namespace

TEST_CASE("A mesh of arrays is the mesh of the file they came from", "[library][mesh]") {
  const Workplace place;
  const Mesh file = Mesh::read(model("shapes/cylinder_quadratic.vtu"));
  const Mesh mesh(arrays_of(file), "arrays");
  CHECK(mesh.points() == file.points());
  CHECK(mesh.types() == file.types());
  CHECK(mesh.connectivity() == file.connectivity());
  CHECK(mesh.name() == "arrays");
  CHECK(mesh.format() == "memory");
  mesh.write(place / "copy.vtu", mesh.points());
  const Mesh copy = Mesh::read(place / "copy.vtu");
  CHECK(copy.points() == file.points());
  CHECK(copy.connectivity() == file.connectivity());
  CHECK_THROWS_WITH(mesh.write(place / "copy.su2", mesh.points()), Contains(".vtu or .vtk"));
}

TEST_CASE("Groups of a mesh of arrays are ascending and without doubles", "[library][mesh]") {
  MeshArrays arrays = tetra();
  arrays.groups = {{.name = "wall", .nodes = {3, 1, 3}, .kind = "set"}};
  const std::vector<MeshGroup> groups = Mesh(std::move(arrays)).groups();
  REQUIRE(groups.size() == 1);
  CHECK(groups[0].name == "wall");
  CHECK(groups[0].nodes == std::vector<Index>{1, 3});
}

TEST_CASE("Arrays that make no mesh are refused with what is wrong", "[library][mesh]") {
  const auto broken = [](const auto& break_it) {
    MeshArrays arrays = tetra();
    break_it(arrays);
    return Mesh(std::move(arrays), "mine");
  };
  CHECK_THROWS_WITH(broken([](MeshArrays& a) { a.connectivity[2] = 4; }), Contains("mine: "));
  CHECK_THROWS_AS(broken([](MeshArrays& a) { a.connectivity[2] = -1; }), InvalidInputError);
  CHECK_THROWS_AS(broken([](MeshArrays& a) { a.offsets = {0, 5}; }), InvalidInputError);
  CHECK_THROWS_AS(broken([](MeshArrays& a) { a.offsets = {}; }), InvalidInputError);
  CHECK_THROWS_AS(broken([](MeshArrays& a) { a.offsets = {0, -4}; }), InvalidInputError);
  CHECK_THROWS_AS(broken([](MeshArrays& a) { a.types = {kQuadraticTetra}; }), InvalidInputError);
  CHECK_THROWS_WITH(broken([](MeshArrays& a) { a.types = {255}; }), Contains("has the type 255"));
  CHECK_THROWS_WITH(broken([](MeshArrays& a) { a.types = {kPolyhedron}; }), Contains("polyhedron"));
  CHECK_THROWS_AS(broken([](MeshArrays& a) { a.types = {}; }), InvalidInputError);
  CHECK_THROWS_AS(broken([](MeshArrays& a) { a.regions = {1, 2}; }), InvalidInputError);
  CHECK_THROWS_WITH(broken([](MeshArrays& a) { a.groups = {{.name = "wall", .nodes = {4}}}; }),
                    Contains("the group wall names the node 4 of 4"));
  CHECK_THROWS_AS(
      broken([](MeshArrays& a) { a.points(1, 1) = std::numeric_limits<double>::quiet_NaN(); }),
      InvalidInputError);
}

TEST_CASE("Elements of gmsh's API come in VTK's order", "[library][mesh]") {
  // gmsh ends a tetrahedron of second order with the edges 2-3 and 1-3, VTK the other way round.
  Points points(10, 3);
  points.topRows(4) = tetra().points;
  const int edges[6][2] = {{0, 1}, {1, 2}, {2, 0}, {3, 0}, {2, 3}, {1, 3}};
  for (int e = 0; e < 6; ++e)
    points.row(4 + e) = 0.5 * (points.row(edges[e][0]) + points.row(edges[e][1]));
  std::vector<std::size_t> tags(10);
  for (std::size_t i = 0; i < 10; ++i) tags[i] = 100 - i;
  const std::vector<GmshElements> elements = {{11, tags}};
  const Mesh mesh = Mesh::from_gmsh(tags, points, elements);
  CHECK(mesh.types() == std::vector<std::uint8_t>{kQuadraticTetra});
  CHECK(mesh.connectivity() == std::vector<Index>{0, 1, 2, 3, 4, 5, 6, 7, 9, 8});

  const auto with = [&](std::vector<GmshElements> other) {
    return Mesh::from_gmsh(tags, points, other);
  };
  CHECK_THROWS_WITH(with({{11, {100, 99}}}), Contains("no whole number of elements"));
  CHECK_THROWS_WITH(with({{4, {100, 99, 98, 5}}}), Contains("the node tag 5"));
  CHECK_THROWS_WITH(with({{29, tags}}), Contains("gmsh's type 29"));
  CHECK_THROWS_WITH(with({{0, tags}}), Contains("gmsh's type 0"));
  tags[3] = 100;
  CHECK_THROWS_WITH(with({}), Contains("comes twice"));
}

TEST_CASE("A copy of a mesh file at its own positions has its bytes", "[library][mesh]") {
  const Workplace place;
  CHECK(place.run("'" + model("shapes/box.step").string() + "' '" +
                  model("shapes/box.step").string() + "' '" + model("shapes/box.vtu").string() +
                  "' -o first.vtu --quiet") == 0);
  const Mesh mesh = Mesh::read(place / "first.vtu");
  CHECK(mesh.write(place / "second.vtu", mesh.points()).path == place / "second.vtu");
  CHECK(read_file(place / "second.vtu") == read_file(place / "first.vtu"));
  CHECK_THROWS_AS(mesh.write(place / "no/folder.vtu", mesh.points()), OutputError);
  CHECK_THROWS_AS(mesh.write(place / "short.vtu", mesh.points().topRows(3)), InvalidInputError);
  CHECK_THROWS_AS(mesh.at(mesh.points().topRows(3)), InvalidInputError);
  CHECK_THROWS_AS(Mesh::read(place / "missing.vtu"), IoError);
}

}  // namespace cadmorph
