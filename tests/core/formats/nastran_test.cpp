#include <catch2/catch.hpp>
#include <string>
#include <vector>

#include "core/errors.h"
#include "tests/core/formats/format_checks.h"

namespace fs = std::filesystem;

namespace cadmorph::test {
namespace {

/// A line of large fields, numbers at their right ends.
std::string large(const std::string& name, const std::vector<std::string>& fields) {
  std::string line = name + std::string(8 - name.size(), ' ');
  for (const std::string& field : fields) line += std::string(16 - field.size(), ' ') + field;
  return line;
}

// Small, free and large fields, numbers as Nastran writes them.
const std::string kDeck =
    "$ a comment\n"
    "SOL 101\n"
    "CEND\n"
    "TITLE = two tetrahedra, a wedge, a rod\n"
    "BEGIN BULK\n"
    "GRID          10              0.      0.      0.\n"
    "GRID           7       0    1.+0                       $ no y, no z\r\n"
    "grid,30,,0.,1.5E0,0.\n" +
    large("GRID*", {"4", "", "0.", "0."}) + "\n" + large("*", {"1.0"}) + "\n" +
    large("GRID*", {"11", "0", ".100000", "-2.000000E+0"}) + "*G1\n" +
    large("*G1", {"3.000D0", "0"}) +
    "\n"
    "GRID    12              1.25-1  -2.     3.\n"
    "GRID    13              0.      -3.     3.      7\n"
    "CTETRA         1       1      10       7      30       4\n"
    "CPENTA  20      2       11      12      13      10      7       30\n"
    "CROD,5,9,4,12\n"
    "CTRIA3  6       3       10      30      7\n"
    "CELAS2  7       100.    4       1\n"
    "PSOLID  1       1\n"
    "ENDDATA\n"
    "GRID    99\n";

std::string replaced(std::string text, const std::string& old_text, const std::string& new_text) {
  const std::size_t place = text.find(old_text);
  REQUIRE(place != std::string::npos);
  return text.replace(place, old_text.size(), new_text);
}

}  // namespace

TEST_CASE("A Nastran deck gives its cells, points and properties", "[core][formats]") {
  const FormatFolder folder;
  const MeshFile file(folder.put("deck.bdf", kDeck));
  const Mesh& mesh = file.mesh();
  CHECK(file.format() == "Nastran");
  CHECK(mesh.types ==
        std::vector{CellType::Tetra, CellType::Wedge, CellType::Line, CellType::Triangle});
  CHECK(mesh.connectivity == std::vector<Index>{0, 1, 2, 3, 4, 5, 6, 0, 1, 2, 3, 5, 0, 2, 1});
  CHECK(mesh.points.row(1) == Eigen::RowVector3d(1, 0, 0));
  CHECK(mesh.points.row(2) == Eigen::RowVector3d(0, 1.5, 0));
  CHECK(mesh.points.row(3) == Eigen::RowVector3d(0, 0, 1));
  CHECK(mesh.points.row(4) == Eigen::RowVector3d(0.1, -2, 3));
  CHECK(mesh.points.row(5) == Eigen::RowVector3d(0.125, -2, 3));
  CHECK(mesh.regions == std::vector<int>{1, 2, 9, 3});
  REQUIRE(mesh.groups.size() == 1);
  CHECK(mesh.groups[0].name == "3");
  CHECK(mesh.groups[0].nodes == std::vector<Index>{0, 1, 2});
  REQUIRE(file.remarks().size() == 1);
  CHECK_THAT(file.remarks()[0], Catch::Contains(": 1 CELAS2"));
}

TEST_CASE("Nastran's rigid elements tie nodes", "[core][formats]") {
  const FormatFolder folder;
  const auto read = [&](const std::string& cards) {
    return MeshFile(folder.put("ties.bdf", replaced(kDeck, "PSOLID  1", cards + "PSOLID  1")));
  };
  using Ties = std::vector<Tie>;
  // Nodes 10, 7, 30, 4, 11, 12, 13 are 0 to 6.
  CHECK(read("RBE2    50      12      123456  10      7       30      4       11\n"
             "        13      6.5-6\n")
            .mesh()
            .ties == Ties{{5, {0, 1, 2, 3, 4, 6}}});
  CHECK(read("RBE2,50,30,123,10,THRU,13,7\n").mesh().ties == Ties{{2, {0, 4, 5, 6, 1}}});
  CHECK(read("RBE3    50              13      123456  1.0     123     10      7\n"
             "+       30      .5      123     4       11\n"
             "+       UM      12      123\n")
            .mesh()
            .ties == Ties{{6, {0, 1, 2, 3, 4}}});
  CHECK(read("RBE3,50,,13,123456,1.0,123,10,7\n+,ALPHA,1.-5\n").mesh().ties == Ties{{6, {0, 1}}});
  CHECK(read("RBAR    50      13      4       123456\n").mesh().ties == Ties{{6, {3}}});

  // Those that tie nothing are counted as before; numbers of no node are left out.
  const MeshFile odd = read(
      "RBE2    50\nRBE2    51      x       123     10\nRBE3,52,,13,123456,1.0,123\n"
      "RBAR    53      13\nRBE2,54,999,123,10\nRBE2,55,13,123,10,THRU,99999999\n");
  CHECK(odd.mesh().ties.empty());
  CHECK_THAT(odd.remarks()[0], Catch::Contains("1 RBAR, 3 RBE2, 1 RBE3"));
  const MeshFile file = read("RBAR    50      13      4       123456\n");
  REQUIRE(file.remarks().size() == 1);
  CHECK_THAT(file.remarks()[0], !Catch::Contains("RBAR"));
}

TEST_CASE("Nastran decks come back with other coordinates alone", "[core][formats]") {
  const FormatFolder folder;
  // Sixteen columns hold 13 digits of a negative number.
  require_promise(folder.put("deck.bdf", kDeck), folder, "out.bdf", 1e-13);
}

TEST_CASE("Moved nodes of Nastran stand in large fields, others as they were", "[core][formats]") {
  const FormatFolder folder;
  const MeshFile file(folder.put("deck.bdf", kDeck));
  Points moved = file.mesh().points;
  moved(0, 0) = 1.0 / 3;
  moved(1, 2) = -2.0 / 3e5;
  moved(2, 1) = 2;
  moved(4, 0) = -100.0 / 3;
  moved(6, 2) = 4;
  const CoordinateRounding rounding = file.write(folder / "out.bdf", moved);
  CHECK(rounding.relative > 0);
  CHECK(rounding.relative < 1e-12);
  const auto card = [](const std::vector<std::string>& first,
                       const std::vector<std::string>& second) {
    return large("GRID*", first) + "\n" + large("*", second);
  };
  std::string expected = replaced(kDeck, "GRID          10              0.      0.      0.",
                                  card({"10", "", ".333333333333333", "0."}, {"0."}));
  expected =
      replaced(expected, "GRID           7       0    1.+0                       $ no y, no z",
               card({"7", "0", "1.+0", ""}, {"-6.66666666667-6"}) + " $ no y, no z");
  expected = replaced(expected, "grid,30,,0.,1.5E0,0.", card({"30", "", "0.", "2."}, {"0."}));
  expected = replaced(expected, "         .100000", "-33.333333333333");
  expected = replaced(expected, "GRID    13              0.      -3.     3.      7",
                      card({"13", "", "0.", "-3."}, {"4.", "7"}));
  CHECK(bytes_of(folder / "out.bdf") == expected);
}

TEST_CASE("Second-order elements of Nastran have VTK's nodes", "[core][formats]") {
  const FormatFolder folder;
  // Corners of the unit cube, then Nastran's mid-side nodes: bottom, upright, top.
  const double corners[8][3] = {{0, 0, 0}, {2, 0, 0}, {2, 2, 0}, {0, 2, 0},
                                {0, 0, 2}, {2, 0, 2}, {2, 2, 2}, {0, 2, 2}};
  const int edges[12][2] = {{0, 1}, {1, 2}, {2, 3}, {3, 0}, {0, 4}, {1, 5},
                            {2, 6}, {3, 7}, {4, 5}, {5, 6}, {6, 7}, {7, 4}};
  std::string deck = "BEGIN BULK\n";
  const auto add = [&](int number, double x, double y, double z) {
    deck += "GRID," + std::to_string(number) + ",," + std::to_string(x) + "," + std::to_string(y) +
            "," + std::to_string(z) + "\n";
  };
  for (int i = 0; i < 8; ++i) add(i + 1, corners[i][0], corners[i][1], corners[i][2]);
  for (int e = 0; e < 12; ++e)
    add(9 + e, (corners[edges[e][0]][0] + corners[edges[e][1]][0]) / 2,
        (corners[edges[e][0]][1] + corners[edges[e][1]][1]) / 2,
        (corners[edges[e][0]][2] + corners[edges[e][1]][2]) / 2);
  deck +=
      "CHEXA   1       1       1       2       3       4       5       6\n"
      "        7       8       9       10      11      12      13      14\n"
      "        15      16      17      18      19      20\n"
      "CTETRA,2,1,1,2,3,5,9,10,+A\n+A,,13\nENDDATA\n";
  const MeshFile file(folder.put("hexa.bdf", deck));
  const Mesh& mesh = file.mesh();
  REQUIRE(mesh.types == std::vector{CellType::QuadraticHexahedron, CellType::Tetra});
  constexpr int kEdges[12][2] = {{0, 1}, {1, 2}, {2, 3}, {3, 0}, {4, 5}, {5, 6},
                                 {6, 7}, {7, 4}, {0, 4}, {1, 5}, {2, 6}, {3, 7}};
  const auto cell = mesh.cell(0);
  for (std::size_t e = 0; e < 12; ++e) {
    const Eigen::RowVector3d middle = (mesh.points.row(cell[std::size_t(kEdges[e][0])]) +
                                       mesh.points.row(cell[std::size_t(kEdges[e][1])])) /
                                      2;
    CHECK(mesh.points.row(cell[8 + e]) == middle);
  }
  REQUIRE(file.remarks().size() == 1);
  CHECK_THAT(file.remarks()[0], Catch::Contains("mid-side nodes"));
}

TEST_CASE("Axisymmetric elements of Nastran are cells", "[core][formats]") {
  const FormatFolder folder;
  std::string deck = "BEGIN BULK\n";
  const auto grid = [&](int number, const std::string& r, const std::string& z) {
    deck += "GRID," + std::to_string(number) + ",," + r + ",0.," + z + "\n";
  };
  grid(1, "1.", "0.");
  grid(2, "2.", "0.");
  grid(3, "2.", "1.");
  grid(4, "1.", "1.");
  grid(5, "1.5", "0.");
  grid(6, "2.", ".5");
  grid(7, "1.5", ".5");
  deck +=
      "CTRIAX6,1,9,1,5,2,6,3,7\n"  // round the element
      "CTRIAX,2,9,1,2,3,5,6,7\nCTRAX6,3,9,1,2,3,5,6,7\nCTRIAX,4,9,1,2,3\n"
      "CTRAX3,5,9,1,2,3\nCQUADX,6,9,1,2,3,4\nCQUADX4,7,9,1,2,3,4\nCQUAD,8,9,1,2,3,4\nENDDATA\n";
  const MeshFile file(folder.put("round.bdf", deck));
  const Mesh& mesh = file.mesh();
  using enum CellType;
  CHECK(mesh.types == std::vector{QuadraticTriangle, QuadraticTriangle, QuadraticTriangle, Triangle,
                                  Triangle, Quad, Quad, Quad});
  const auto nodes = [&](Index c) {
    return std::vector<Index>(mesh.cell(c).begin(), mesh.cell(c).end());
  };
  for (const Index c : {0, 1, 2}) CHECK(nodes(c) == std::vector<Index>{0, 1, 2, 4, 5, 6});
  CHECK(nodes(7) == std::vector<Index>{0, 1, 2, 3});
}

TEST_CASE("Coordinate systems of Nastran are followed", "[core][formats]") {
  const FormatFolder folder;
  const std::string deck =
      "BEGIN BULK\n"
      "GRID,1,5,1.,0.,0.\nGRID,2,6,2.,90.,1.\nGRID,3,0,0.,0.,0.\nGRID,4,0,0.,0.,1.\n"
      "CORD2R,5,0,1.,2.,3.,1.,2.,4.,+\n+,1.,3.,3.\n"
      "CORD2C,6,5,0.,0.,0.,0.,0.,1.,+\n+,1.,0.,0.\n"
      "CTETRA,1,1,1,2,3,4\nENDDATA\n";
  const MeshFile file(folder.put("systems.bdf", deck));
  const Points& points = file.mesh().points;
  CHECK((points.row(0) - Eigen::RowVector3d(1, 3, 3)).norm() < 1e-14);
  // The x axis of system 5 is the basic y axis, its y axis the negative x axis.
  CHECK((points.row(1) - Eigen::RowVector3d(-1, 2, 4)).norm() < 1e-14);
  // Angles of 16 columns have 13 digits, of some radians.
  require_promise(folder / "systems.bdf", folder, "out.bdf", 1e-12);
}

TEST_CASE("Files that a Nastran deck includes are copied with it", "[core][formats]") {
  const FormatFolder folder;
  const std::string main =
      "CEND\r\nBEGIN BULK\r\nINCLUDE 'nodes.inc'\r\nCTETRA,1,1,1,2,3,4\r\nENDDATA\r\n";
  folder.put("nodes.inc",
             "GRID,1,,0.,0.,0.\r\nGRID,2,,1.,0.,0.\r\nGRID,3,,0.,1.,0.\r\n"
             "GRID,4,,0.,0.,1.\r\n");
  const MeshFile file(folder.put("main.bdf", main));
  fs::create_directories(folder / "out");
  Points moved = file.mesh().points;
  moved(3, 2) = 2;
  REQUIRE_THROWS_WITH(file.write(folder / "other.bdf", moved), Catch::Contains("nodes.inc"));
  file.write(folder / "out/main.bdf", moved);
  CHECK(bytes_of(folder / "out/main.bdf") == main);
  CHECK(MeshFile(folder / "out/main.bdf").mesh().points == moved);
  const std::string nodes = bytes_of(folder / "out/nodes.inc");
  CHECK(nodes.starts_with("GRID,1,,0.,0.,0.\r\n"));
  CHECK(nodes.ends_with("0.              0.\r\n*                     2.\r\n"));
}

TEST_CASE("The name of a file that a Nastran deck includes goes over several lines",
          "[core][formats]") {
  const FormatFolder folder;
  const std::string nodes = "GRID,1,,0.,0.,0.\nGRID,2,,1.,0.,0.\nGRID,3,,0.,1.,0.\n";
  folder.put("sub/grid,7/nodes.inc", nodes);
  const std::string end = "GRID,4,,0.,0.,1.\nCTETRA,1,1,1,2,3,4\nENDDATA\n";
  const std::string include = GENERATE(as<std::string>(), "INCLUDE 'sub/\ngrid,7/nodes.inc'\n",
                                       "INCLUDE 'sub/  \r\n grid,7/\r\n  nodes.inc' $ it's\r\n",
                                       "include \"sub/\n\ngrid,7/nodes.inc\"\n");
  // At the border of a block of lines, the name begins in one and ends in the next.
  const std::size_t before = GENERATE(0, (1 << 18) - 5);
  std::string main = "BEGIN BULK\n" + std::string(before, '$') + "\n" + include + end;
  const MeshFile file(folder.put("main.bdf", main));
  CHECK(file.mesh().node_count() == 4);
  fs::create_directories(folder / "out");
  Points moved = file.mesh().points;
  moved(1, 0) = 2;
  moved(3, 2) = 2;
  file.write(folder / "out/main.bdf", moved);
  CHECK(MeshFile(folder / "out/main.bdf").mesh().points == moved);

  require_refused(folder.put("open.bdf", "BEGIN BULK\nINCLUDE 'sub/\n" + end),
                  {"open.bdf", "line 2", "closing quote"});
}

TEST_CASE("A Nastran deck whose columns are too narrow leaves nothing behind", "[core][formats]") {
  const FormatFolder folder;
  fs::create_directories(folder / "in/grids");
  folder.put("in/grids/nodes.inc",
             "GRID,1,,0.,0.,0.\nGRID,2,,1.,0.,0.\nGRID,3,,0.,1.,0.\nGRID,4,,0.,0.,1.\n");
  const MeshFile file(folder.put(
      "in/main.bdf", "BEGIN BULK\nINCLUDE 'grids/nodes.inc'\nCTETRA,1,1,1,2,3,4\nENDDATA\n"));
  fs::create_directories(folder / "out");
  const Points far = file.mesh().points.array() + 1e14 / 3;  // sixteen columns hold one decimal
  REQUIRE_THROWS_WITH(file.write(folder / "out/main.bdf", far),
                      Catch::Contains("too few digits: node"));
  CHECK(fs::is_empty(folder / "out"));
}

TEST_CASE("Bad Nastran decks are refused by line", "[core][formats]") {
  const FormatFolder folder;
  const auto refused = [&](const std::string& old_text, const std::string& new_text,
                           std::initializer_list<std::string> parts) {
    require_refused(folder.put("bad.bdf", replaced(kDeck, old_text, new_text)), parts);
  };
  refused("      30       4\n", "      30       6\n", {"bad.bdf", "line 15", "node 6"});
  refused("      30       4\n", "      30\n", {"line 15", "the number of a node", "''"});
  refused("      30       4\n", "      30      x4\n", {"line 15", "'x4'"});
  refused("CTETRA         1       1      10       7      30       4\n",
          "CTETRA,1,1,10,7,30,4,11,12,\n+,13,10,7,30,4\n",
          {"line 15", "element 1", "more than the 10 nodes"});
  refused("1.25-1", "1.25-x", {"line 13", "a coordinate", "'1.25-x'"});
  refused("GRID    12 ", "GRID     x ", {"line 13", "number of a node", "'x'"});
  refused("GRID    12 ", "GRID    13 ", {"line 14", "node 13", "defined before"});
  refused("GRID    12              ", "GRID    12             8", {"line 13", "system 8"});
  refused("PSOLID  1       1\n", "INCLUDE 'none.bdf'\n", {"line 20", "none.bdf"});
  const std::string spherical =
      replaced(kDeck, "GRID    12              ", "GRID    12             8");
  require_refused(folder.put("bad.bdf", replaced(spherical, "PSOLID  1       1", "CORD2S,8")),
                  {"line 13", "CORD2S", "basic system"});
}

TEST_CASE("Damaged Nastran decks never crash the reader", "[core][formats]") {
  const FormatFolder folder;
  require_robust(folder.put("deck.bdf", kDeck), folder);
}

}  // namespace cadmorph::test
