#include <Eigen/Geometry>
#include <algorithm>
#include <catch2/catch.hpp>
#include <string>

#include "core/errors.h"
#include "tests/core/formats/format_checks.h"
#include "tests/core/formats/node_order_checks.h"

namespace fs = std::filesystem;

namespace cadmorph::test {
namespace {

// The unit cube's corners are nodes 11 to 18; both forms of solids, all their collapsed shapes.
const std::string kDeck =
    "$# made by hand\n"
    "*KEYWORD\n"
    "*TITLE\n"
    "a cube and what stands on it\n"
    "*NODE\n"
    "$#   nid               x               y               z      tc      rc\n"
    "      11             0.0             0.0             0.0       0       0\n"
    "      12             1.0\n"
    "      13             1.0             1.0\n"
    "      14             0.0             1.0             0.0       0       0\n"
    "      15             0.0             0.0             1.0       0       0\n"
    "      16             1.0             0.0             1.0       0       0\n"
    "17,1.,1.,1.\n"
    "18, 0, 1, 1, 0, 0\n"
    "      30            0.50            0.50             2.0       0       0\n"
    "*NODE +\n"
    "                  40                 2.0                 0.5                0.25\n"
    "*ELEMENT_SOLID\n"
    "       1       3      11      12      13      14      15      16      17      18\n"
    "*ELEMENT_SOLID (ten nodes format)\n"
    "       2       4\n"
    "      15      16      17      18      30      30      30      30       0       0\n"
    "       3       4\n"
    "      12      40      13      16      16      16      16      16\n"
    "       4       5\n"
    "      11      12      13      14      15      15      18      18\n"
    "       5       5\n"
    "      12      40      13      16      11      14      15      17      18      30\n"
    "*ELEMENT_SHELL_THICKNESS\n"
    "       6       2      11      12      13      14\n"
    "             0.1             0.1             0.1             0.1\n"
    "       7       2      11      12      13      13\n"
    "             0.1             0.1             0.1             0.1\n"
    "*ELEMENT_BEAM\n"
    "       8       6      11      12      13\n"
    "*ELEMENT_MASS\n"
    "       9      11             1.0\n"
    "*SET_NODE_LIST_TITLE\n"
    "top\n"
    "         1       0.0       0.0       0.0       0.0\n"
    "        15        16        17        18         0         0         0         0\n"
    "*SET_SEGMENT\n"
    "         7\n"
    "        11        12        13        14\n"
    "*END\n"
    "*NODE\nnonsense\n";

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

TEST_CASE("An LS-DYNA deck gives its cells, points, sets and parts", "[core][formats]") {
  const FormatFolder folder;
  const MeshFile file(folder.put("deck.k", kDeck));
  const Mesh& mesh = file.mesh();
  CHECK(file.format() == "LS-DYNA");
  using enum CellType;
  REQUIRE(mesh.types ==
          std::vector{Hexahedron, Pyramid, Tetra, Wedge, QuadraticTetra, Quad, Triangle, Line});
  CHECK(nodes_of(mesh, 0) == std::vector<Index>{0, 1, 2, 3, 4, 5, 6, 7});
  CHECK(nodes_of(mesh, 1) == std::vector<Index>{4, 5, 6, 7, 8});
  CHECK(nodes_of(mesh, 2) == std::vector<Index>{1, 9, 2, 5});
  CHECK(nodes_of(mesh, 4) == std::vector<Index>{1, 9, 2, 5, 0, 3, 4, 6, 7, 8});
  CHECK(nodes_of(mesh, 6) == std::vector<Index>{0, 1, 2});
  CHECK(mesh.points.row(2) == Eigen::RowVector3d(1, 1, 0));
  CHECK(mesh.points.row(7) == Eigen::RowVector3d(0, 1, 1));
  CHECK(mesh.points.row(9) == Eigen::RowVector3d(2, 0.5, 0.25));
  CHECK(mesh.regions == std::vector<int>{3, 4, 4, 5, 5, 2, 2, 6});
  CHECK(mesh.region_array == "part");
  REQUIRE(mesh.groups.size() == 2);
  CHECK(mesh.groups[0].name == "top");
  CHECK(mesh.groups[0].nodes == std::vector<Index>{4, 5, 6, 7});
  CHECK(mesh.groups[1].name == "7");
  CHECK(mesh.groups[1].kind == "segment set");
  CHECK(mesh.groups[1].nodes == std::vector<Index>{0, 1, 2, 3});
  REQUIRE(file.remarks().size() == 1);
  CHECK_THAT(file.remarks()[0], Catch::Contains(": 1 lines of *ELEMENT_MASS"));

  // The wedge: the edges upwards of its first triangle lie along y, where its normal points.
  const auto wedge = mesh.cell(3);
  const auto point = [&](std::size_t i) -> Eigen::Vector3d {
    return mesh.points.row(wedge[i]).transpose();
  };
  const Eigen::Vector3d normal = (point(1) - point(0)).cross(point(2) - point(0));
  for (std::size_t i = 0; i < 3; ++i) {
    CHECK(point(i + 3) - point(i) == Eigen::Vector3d::UnitY());
    CHECK(normal.dot(point(i + 3) - point(i)) > 0);
  }
}

TEST_CASE("LS-DYNA's nodal rigid bodies and interpolations tie nodes", "[core][formats]") {
  const FormatFolder folder;
  const auto ties = [&](const std::string& lines) {
    return MeshFile(folder.put("ties.k", replaced(kDeck, "*END\n", lines + "*END\n"))).mesh().ties;
  };
  using Ties = std::vector<Tie>;
  // Nodes 11 to 18, 30, 40 are 0 to 9; set 1 has the nodes 4 to 7.
  CHECK(ties("*CONSTRAINED_NODAL_RIGID_BODY\n"
             "         9                   1        40\n"
             "        10         0         1         0\n") ==
        Ties{{9, {4, 5, 6, 7}}, {4, {5, 6, 7}}});
  CHECK(ties("*CONSTRAINED_NODAL_RIGID_BODY_SPC_TITLE\na body\n"
             "         9         0         1        40\n"
             "       1.0         7         7\n") == Ties{{9, {4, 5, 6, 7}}});
  // The set may follow.
  CHECK(ties("*CONSTRAINED_NODAL_RIGID_BODY\n8,,2,40\n*SET_NODE\n2\n11,12\n") == Ties{{9, {0, 1}}});
  CHECK(ties("*CONSTRAINED_INTERPOLATION\n"
             "         1        40    123456\n"
             "        11       123       1.0\n"
             "        13       123       1.0\n") == Ties{{9, {0, 2}}});
  CHECK(ties("*CONSTRAINED_INTERPOLATION\n1,40,123456,,1\n1\n") == Ties{{9, {4, 5, 6, 7}}});
  CHECK(ties("*CONSTRAINED_NODAL_RIGID_BODY\n&pid,0,1,40\n9,0,7,40\n9\n\n"
             "*CONSTRAINED_INTERPOLATION\n&a\nb\n*CONSTRAINED_INTERPOLATION\n1,40\nb\n")
            .empty());
}

TEST_CASE("LS-DYNA decks come back with other coordinates alone", "[core][formats]") {
  const FormatFolder folder;
  // Sixteen columns hold 13 digits and more.
  require_promise(folder.put("deck.k", kDeck), folder, "out.k", 1e-13);
}

TEST_CASE("Moved coordinates keep the columns of an LS-DYNA deck", "[core][formats]") {
  const FormatFolder folder;
  const MeshFile file(folder.put("deck.k", kDeck));
  Points moved = file.mesh().points;
  moved(0, 1) = -1.0 / 3;
  moved(1, 2) = 0.125;  // beyond the end of the line
  moved(6, 1) = 1.5;
  moved(9, 0) = 2.0 / 3;
  file.write(folder / "out.k", moved);
  std::string expected = replaced(kDeck, "      11             0.0             0.0",
                                  "      11             0.0-.33333333333333");
  expected = replaced(expected, "      12             1.0",
                      "      12             1.0              0.           0.125");
  expected = replaced(expected, "17,1.,1.,1.", "17,1.,1.5,1.");
  expected = replaced(expected, "                  40                 2.0",
                      "                  40  0.6666666666666666");
  CHECK(bytes_of(folder / "out.k") == expected);
}

TEST_CASE("Decks of LS-DYNA with wide integers are read by their columns", "[core][formats]") {
  const FormatFolder folder;
  const std::string deck =
      "*KEYWORD I10=Y\n*NODE\n"
      "         1             0.0             0.0             0.0\n"
      "         2             1.0             0.0             0.0\n"
      "         3             0.0             1.0             0.0\n"
      "1000000004             0.0             0.0             1.0\n"
      "*ELEMENT_SOLID\n"
      "         7         1         1         2         31000000004100000000410000000041000000004"
      "1000000004\n"
      "*END\n";
  const MeshFile file(folder.put("wide.k", deck));
  CHECK(file.mesh().types == std::vector{CellType::Tetra});
  CHECK(file.mesh().connectivity == std::vector<Index>{0, 1, 2, 3});
  require_promise(folder / "wide.k", folder, "out.k", 1e-13);
}

TEST_CASE("Files that an LS-DYNA deck includes are copied with it", "[core][formats]") {
  const FormatFolder folder;
  const std::size_t end = kDeck.find("*ELEMENT_SOLID");
  folder.put("nodes.k", kDeck.substr(0, end));
  const std::string main = "*KEYWORD\n*INCLUDE\nnodes.k\n" + kDeck.substr(end);
  const MeshFile file(folder.put("main.k", main));
  CHECK(file.mesh().cell_count() == 8);
  fs::create_directories(folder / "out");
  Points moved = file.mesh().points;
  moved(6, 1) = 1.5;
  REQUIRE_THROWS_WITH(file.write(folder / "other.k", moved), Catch::Contains("nodes.k"));
  file.write(folder / "out/main.k", moved);
  CHECK(bytes_of(folder / "out/main.k") == main);
  CHECK(bytes_of(folder / "out/nodes.k") ==
        replaced(kDeck.substr(0, end), "17,1.,1.,1.", "17,1.,1.5,1."));
}

TEST_CASE("Included files of an LS-DYNA deck are looked for in its folders", "[core][formats]") {
  const FormatFolder folder;
  const std::size_t end = kDeck.find("*ELEMENT_SOLID");
  folder.put("in/mesh/parts/nodes.k", kDeck.substr(0, end));
  folder.put("lib/cells.k", kDeck.substr(end));
  folder.put("lib/nodes.k", "no nodes");
  const std::string main =
      "*KEYWORD\n*INCLUDE_PATH_RELATIVE\nnone\nmesh/ +\nparts\n*INCLUDE_PATH\n" +
      (folder / "lib").string() + "\n*INCLUDE\nnodes.k\ncells.k\n*END\n";
  const MeshFile file(folder.put("in/main.k", main));
  CHECK(file.mesh().cell_count() == 8);
  REQUIRE(file.remarks().size() >= 1);
  CHECK(std::ranges::any_of(file.remarks(), [](const std::string& remark) {
    return remark.find("lib/cells.k is not copied") != std::string::npos;
  }));
  fs::create_directories(folder / "out");
  Points moved = file.mesh().points;
  moved(6, 1) = 1.5;
  REQUIRE_THROWS_WITH(file.write(folder / "in/other.k", moved), Catch::Contains("parts/nodes.k"));
  file.write(folder / "out/main.k", moved);
  CHECK(bytes_of(folder / "out/main.k") == main);
  CHECK(MeshFile(folder / "out/main.k").mesh().points == moved);
  // Another file that the copy would include.
  folder.put("taken/nodes.k", "*END\n");
  REQUIRE_THROWS_WITH(file.write(folder / "taken/main.k", moved),
                      Catch::Contains("would include") && Catch::Contains("taken/nodes.k instead"));

  // Nodes in a folder that is named by its whole path would be those of the base.
  const MeshFile whole(folder.put("in/whole.k", "*KEYWORD\n*INCLUDE_PATH\n" +
                                                    (folder / "in/mesh/parts").string() +
                                                    "\n*INCLUDE\nnodes.k\n" + kDeck.substr(end)));
  REQUIRE_THROWS_WITH(whole.write(folder / "out/whole.k", moved),
                      Catch::Contains("below the deck's folder"));
  require_refused(folder.put("in/bad.k", "*KEYWORD\n*INCLUDE_PATH\nmesh\n*INCLUDE\nnodes.k\n"),
                  {"line 5", "in/nodes.k", "nor one in mesh"});
}

TEST_CASE("Solids of second order of LS-DYNA have VTK's nodes, whatever their order in the deck",
          "[core][formats]") {
  const FormatFolder folder;
  const auto check = [&](CellType type, const std::vector<int>& order,
                         const std::string& elements) {
    const Points places = unit_cell(type);
    REQUIRE(std::ssize(order) == places.rows());
    std::string deck = "*KEYWORD\n*NODE\n";
    for (Index n = 0; n < places.rows(); ++n) {
      deck += std::to_string(n + 1);
      for (int k = 0; k < 3; ++k) deck += "," + std::to_string(places(order[std::size_t(n)], k));
      deck += "\n";
    }
    const MeshFile file(folder.put("deck.k", deck + elements + "*END\n"));
    REQUIRE(file.mesh().types == std::vector{type});
    require_middles(file.mesh(), 0);
    require_promise(folder / "deck.k", folder, "out.k", 1e-16);
  };
  using enum CellType;
  // The manual's: edges of the lower side, of the upper one, between them.
  const std::string in_columns =
      "       1       1\n"
      "       1       2       3       4       5       6       7       8       9      10\n"
      "      11      12      13      14      15      16      17      18      19      20\n";
  check(QuadraticHexahedron, {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18, 19},
        "*ELEMENT_SOLID_H20\n" + in_columns);
  // gmsh's, with the edges between them before those of the upper side, and its lines.
  const std::string between_commas =
      "1, 1, 1, 2, 3, 4, 5, 6, 7, 8, 9, \n10, 11, 12, 13, 14, 15, 16, 17, 18, 19, \n20";
  check(QuadraticHexahedron, {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 16, 17, 18, 19, 12, 13, 14, 15},
        "*ELEMENT_SOLID_H20\n" + between_commas + "\n");
  check(TriquadraticHexahedron, {0,  1,  2,  3,  4,  5,  6,  7,  8,  9,  10, 11, 16, 17,
                                 18, 19, 12, 13, 14, 15, 26, 24, 22, 20, 21, 23, 25},
        "*ELEMENT_SOLID_H27\n" + between_commas + ", 21, 22, 23, 24, 25, 26, 27\n");
  check(QuadraticWedge, {0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 13, 14, 9, 10, 11},
        "*ELEMENT_SOLID_P15\n1, 1, 1, 2, 3, 4, 5, 6, 7, 8, 9, \n10, 11, 12, 13, 14, 15\n");
}

TEST_CASE("Tetrahedra of second order of LS-DYNA are read from gmsh's lines", "[core][formats]") {
  const FormatFolder folder;
  const std::string deck =
      "*NODE\n1, 0, 0, 0\n2, 2, 0, 0\n3, 0, 2, 0\n4, 0, 0, 2\n5, 1, 0, 0\n6, 1, 1, 0\n"
      "7, 0, 1, 0\n8, 0, 0, 1\n9, 1, 0, 1\n123456789, 0, 1, 1\n*ELEMENT_SOLID\n";
  const std::string lines = "1, 7, 1, 2, 3, 4, 5, 6, 7, 8, 9, \n123456789";
  const MeshFile file(folder.put("gmsh.k", deck + lines + "\n2, 7, 1, 2, 3, 4, 4, 4, 4, 4\n"));
  using enum CellType;
  REQUIRE(file.mesh().types == std::vector{QuadraticTetra, Tetra});
  require_middles(file.mesh(), 0);
  require_refused(folder.put("many.k", deck + lines + ", 1, 2, 3\n"),
                  {"line 13", "element 1", "more than 10 nodes"});
}

TEST_CASE("Bad LS-DYNA decks are refused by line", "[core][formats]") {
  const FormatFolder folder;
  const auto refused = [&](const std::string& old_text, const std::string& new_text,
                           std::initializer_list<std::string> parts) {
    require_refused(folder.put("bad.k", replaced(kDeck, old_text, new_text)), parts);
  };
  refused("            0.50", "            0x50", {"bad.k", "line 15", "a coordinate", "'0x50'"});
  refused("      30            0.50", "      3x            0.50", {"line 15", "number of a node"});
  refused("      12      40      13", "      12      41      13", {"line 23", "node 41"});
  refused("      12      40      13", "      12       0      13", {"line 23", "element 3"});
  refused("*ELEMENT_SOLID (ten", "*ELEMENT_SOLID_H64 (ten", {"line 20", "H64"});
  refused("*ELEMENT_MASS", "*INCLUDE_TRANSFORM", {"line 36", "*INCLUDE_TRANSFORM"});
  refused("*ELEMENT_MASS", "*NODE_TRANSFORM", {"line 36", "*NODE_TRANSFORM"});
  refused("*ELEMENT_MASS\n", "*INCLUDE\nnone.k\n", {"line 37", "none.k"});
  refused("      12      40      13      16      11      14      15      17      18      30\n", "",
          {"line 27", "element 5", "missing"});
}

TEST_CASE("Damaged LS-DYNA decks never crash the reader", "[core][formats]") {
  const FormatFolder folder;
  require_robust(folder.put("deck.k", kDeck), folder);
}

}  // namespace cadmorph::test
