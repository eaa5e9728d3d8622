#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cstdio>
#include <string>
#include <vector>

#include "core/errors.h"
#include "tests/core/formats/format_checks.h"

namespace cadmorph::test {
namespace {

std::string integers(const std::vector<int>& numbers, int width = 9) {
  std::string line;
  for (const int number : numbers) {
    const std::string text = std::to_string(number);
    line += std::string(std::size_t(width) - text.size(), ' ') + text;
  }
  return line + "\n";
}

/// An element of EBLOCK: material, type and number, and its nodes, eight on the first line.
std::string element(int material, int type, int number, const std::vector<int>& nodes) {
  std::vector<int> line{material, type, 1, 1, 0, 0, 0, 0, int(nodes.size()), 0, number};
  line.insert(line.end(), nodes.begin(),
              nodes.begin() + std::min<std::ptrdiff_t>(8, std::ssize(nodes)));
  std::string text = integers(line);
  if (nodes.size() > 8) text += integers({nodes.begin() + 8, nodes.end()});
  return text;
}

std::string node(int number, const std::vector<double>& coordinates) {
  std::string line = integers({number, 0, 0});
  line.pop_back();
  for (const double x : coordinates) {
    char text[32];
    std::snprintf(text, sizeof text, "%21.13E", x);
    // Fortran's e21.13e3 has an exponent of three digits.
    std::string number_text = text;
    number_text.insert(number_text.size() - 2, 1, '0');
    line += number_text.substr(number_text.size() - 21);
  }
  return line + "\n";
}

// The unit cube's corners as nodes 11 to 18, and two beside it; trailing zeros are left out.
std::string cube_deck(const std::string& elements) {
  return "/COM,ANSYS RELEASE 2022 R2\n/PREP7\n"
         "ET,1,185\nET,2,SOLID187\nET,3,181\nET,4,186\nET,5,21\n"
         "NBLOCK,6,SOLID,30,10\n(3i9,6e21.13e3)\n" +
         node(11, {}) + node(12, {1}) + node(13, {1, 1}) + node(14, {0, 1}) + node(15, {0, 0, 1}) +
         node(16, {1, 0, 1}) + node(17, {1, 1, 1}) + node(18, {0, 1, 1}) +
         node(30, {2, 0.5, 0.125}) + node(25, {0.5, 0.5, 2, 0, 0, 30}) +
         "N,UNBL,LOC,       -1,\n"
         "EBLOCK,19,SOLID,10,5\n(19i9)\n" +
         elements +
         "       -1\n"
         "CMBLOCK,TOP     ,NODE,       2  ! users node component\n(8i10)\n" +
         integers({15, -18}, 10) + "CMBLOCK,FIRST,ELEM,1\n(8i10)\n" + integers({7}, 10) +
         "FINISH\n";
}

std::string standard_deck() {
  return cube_deck(element(3, 1, 7, {11, 12, 13, 14, 15, 16, 17, 18}) +
                   element(3, 1, 8, {15, 16, 17, 18, 25, 25, 25, 25}) +
                   element(4, 1, 9, {12, 30, 13, 13, 16, 16, 16, 16}) +
                   element(4, 3, 10, {11, 12, 13, 13}) + element(1, 5, 11, {30}));
}

std::string replaced(std::string text, const std::string& old_text, const std::string& new_text) {
  const std::size_t place = text.find(old_text);
  REQUIRE(place != std::string::npos);
  return text.replace(place, old_text.size(), new_text);
}

std::vector<Index> nodes_of(const Mesh& mesh, Index cell) {
  const auto nodes = mesh.cell(cell);
  return {nodes.begin(), nodes.end()};
}

}  // namespace

TEST_CASE("An Ansys file gives its cells, points and components", "[core][formats]") {
  const FormatFolder folder;
  const MeshFile file(folder.put("cube.cdb", standard_deck()));
  const Mesh& mesh = file.mesh();
  CHECK(file.format() == "Ansys");
  using enum CellType;
  REQUIRE(mesh.types == std::vector{Hexahedron, Pyramid, Tetra, Triangle});
  CHECK(nodes_of(mesh, 0) == std::vector<Index>{0, 1, 2, 3, 4, 5, 6, 7});
  CHECK(nodes_of(mesh, 1) == std::vector<Index>{4, 5, 6, 7, 9});
  CHECK(nodes_of(mesh, 2) == std::vector<Index>{1, 8, 2, 5});
  CHECK(nodes_of(mesh, 3) == std::vector<Index>{0, 1, 2});
  CHECK(mesh.points.row(0) == Eigen::RowVector3d(0, 0, 0));
  CHECK(mesh.points.row(2) == Eigen::RowVector3d(1, 1, 0));
  CHECK(mesh.points.row(8) == Eigen::RowVector3d(2, 0.5, 0.125));
  CHECK(mesh.regions == std::vector<int>{3, 3, 4, 4});
  REQUIRE(mesh.groups.size() == 2);
  CHECK(mesh.groups[0].name == "TOP");
  CHECK(mesh.groups[0].nodes == std::vector<Index>{4, 5, 6, 7});
  CHECK(mesh.groups[1].kind == "element component");
  CHECK(mesh.groups[1].nodes == std::vector<Index>{0, 1, 2, 3, 4, 5, 6, 7});
  REQUIRE(file.remarks().size() == 2);
  CHECK_THAT(file.remarks()[0], Catch::Contains(": 1 of type 21"));
  CHECK_THAT(file.remarks()[1], Catch::Contains("coordinate systems"));
}

TEST_CASE("Ansys files come back with other coordinates alone", "[core][formats]") {
  const FormatFolder folder;
  // Thirteen decimals.
  require_promise(folder.put("cube.cdb", standard_deck()), folder, "out.cdb", 1e-13);
}

TEST_CASE("Moved coordinates keep the columns of an Ansys file", "[core][formats]") {
  const FormatFolder folder;
  const std::string deck = standard_deck();
  const MeshFile file(folder.put("cube.cdb", deck));
  Points moved = file.mesh().points;
  moved(0, 2) = -0.25;  // beyond the end of the line
  moved(1, 0) = 1.0 / 3;
  const CoordinateRounding rounding = file.write(folder / "out.cdb", moved);
  CHECK(rounding.largest > 0);
  CHECK(rounding.largest < 1e-14);
  const std::string expected = replaced(replaced(deck, node(11, {}), node(11, {0, 0, -0.25})),
                                        node(12, {1}), node(12, {1.0 / 3}));
  CHECK(bytes_of(folder / "out.cdb") == expected);
}

TEST_CASE("Second-order elements of Ansys, whole and collapsed, have VTK's nodes",
          "[core][formats]") {
  // Corners of a cube and the middles of its edges, numbered by place: 1 + x + 3 y + 9 z.
  std::string nodes;
  for (int i = 0; i < 27; ++i)
    nodes += node(1 + i, {double(i % 3), double(i / 3 % 3), double(i / 9)});
  const auto id = [](int x, int y, int z) { return 1 + x + 3 * y + 9 * z; };
  const int I = id(0, 0, 0), J = id(2, 0, 0), K = id(2, 2, 0), L = id(0, 2, 0);
  const int M = id(0, 0, 2), N = id(2, 0, 2), O = id(2, 2, 2), P = id(0, 2, 2);
  const auto mid = [](int a, int b) {
    const auto at = [](int n) { return std::array{(n - 1) % 3, (n - 1) / 3 % 3, (n - 1) / 9}; };
    const auto p = at(a), q = at(b);
    return 1 + (p[0] + q[0]) / 2 + 3 * ((p[1] + q[1]) / 2) + 9 * ((p[2] + q[2]) / 2);
  };
  const auto hexahedron = [&](int i, int j, int k, int l, int m, int n, int o, int p) {
    return std::vector<int>{i,         j,         k,         l,         m,
                            n,         o,         p,         mid(i, j), mid(j, k),
                            mid(k, l), mid(l, i), mid(m, n), mid(n, o), mid(o, p),
                            mid(p, m), mid(i, m), mid(j, n), mid(k, o), mid(l, p)};
  };
  const std::string deck = "/PREP7\nET,4,186\nNBLOCK,6,SOLID,27,27\n(3i9,6e21.13e3)\n" + nodes +
                           "N,R5.3,LOC,-1,\nEBLOCK,19,SOLID,4,4\n(19i9)\n" +
                           element(1, 4, 1, hexahedron(I, J, K, L, M, N, O, P)) +
                           element(1, 4, 2, hexahedron(I, J, K, K, M, M, M, M)) +
                           element(1, 4, 3, hexahedron(I, J, K, L, M, M, M, M)) +
                           element(1, 4, 4, hexahedron(I, J, K, K, M, N, O, O)) + "-1\n";
  const FormatFolder folder;
  const MeshFile file(folder.put("quadratic.cdb", deck));
  const Mesh& mesh = file.mesh();
  using enum CellType;
  REQUIRE(mesh.types ==
          std::vector{QuadraticHexahedron, QuadraticTetra, QuadraticPyramid, QuadraticWedge});
  // The corners between which VTK puts the mid-side nodes of each.
  const std::vector<std::vector<std::pair<int, int>>> edges{
      {{0, 1},
       {1, 2},
       {2, 3},
       {3, 0},
       {4, 5},
       {5, 6},
       {6, 7},
       {7, 4},
       {0, 4},
       {1, 5},
       {2, 6},
       {3, 7}},
      {{0, 1}, {1, 2}, {2, 0}, {0, 3}, {1, 3}, {2, 3}},
      {{0, 1}, {1, 2}, {2, 3}, {3, 0}, {0, 4}, {1, 4}, {2, 4}, {3, 4}},
      {{0, 1}, {1, 2}, {2, 0}, {3, 4}, {4, 5}, {5, 3}, {0, 3}, {1, 4}, {2, 5}}};
  const std::size_t corners[] = {8, 4, 5, 6};
  for (std::size_t c = 0; c < 4; ++c) {
    const auto cell = mesh.cell(Index(c));
    REQUIRE(cell.size() == corners[c] + edges[c].size());
    for (std::size_t e = 0; e < edges[c].size(); ++e) {
      const Eigen::RowVector3d middle = (mesh.points.row(cell[std::size_t(edges[c][e].first)]) +
                                         mesh.points.row(cell[std::size_t(edges[c][e].second)])) /
                                        2;
      INFO("cell " << c << ", edge " << e);
      CHECK(mesh.points.row(cell[corners[c] + e]) == middle);
    }
  }
}

TEST_CASE("Bad Ansys files are refused by line", "[core][formats]") {
  const FormatFolder folder;
  const auto refused = [&](const std::string& old_text, const std::string& new_text,
                           std::initializer_list<std::string> parts) {
    require_refused(folder.put("bad.cdb", replaced(standard_deck(), old_text, new_text)), parts);
  };
  refused("(3i9,6e21.13e3)", "(3x9)", {"bad.cdb", "line 9", "format", "'(3x9)'"});
  refused("       30   ", "       3x   ", {"line 18", "number of a node", "'3x'"});
  refused("2.0000000000000E+000", "2.000000000x000E+000", {"line 18", "a coordinate"});
  refused(integers({12, 30, 13, 13, 16, 16, 16, 16}), integers({12, 31, 13, 13, 16, 16, 16, 16}),
          {"line 25", "element 9", "node 31"});
  refused("ET,1,185", "ET,6,185", {"line 23", "element type 1", "ET"});
  refused("ET,1,185", "ET,1,9999", {"line 23", "type 9999"});
  refused("FINISH", "NGEN,2,100,1,8\nFINISH", {"NGEN", "CDWRITE"});
  refused("FINISH", "NMODIF,3,1,2,3\nFINISH", {"NMODIF", "CDWRITE"});
  refused("FINISH", "MOVE,3,0,1,2,3\nFINISH", {"MOVE", "CDWRITE"});
  refused("FINISH", "N,40,1.,2.,3.\nFINISH", {"blocked format"});
  refused("CMBLOCK,FIRST,ELEM,1\n", "CMBLOCK,FIRST,ELEM,5\n", {"line 35", "a number", "'FINISH'"});
}

TEST_CASE("Damaged Ansys files never crash the reader", "[core][formats]") {
  const FormatFolder folder;
  require_robust(folder.put("cube.cdb", standard_deck()), folder);
}

}  // namespace cadmorph::test
