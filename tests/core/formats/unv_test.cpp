#include <catch2/catch.hpp>
#include <cstdio>
#include <string>
#include <vector>

#include "core/errors.h"
#include "tests/core/formats/format_checks.h"
#include "tests/core/formats/node_order_checks.h"

namespace cadmorph::test {
namespace {

using enum CellType;

std::string dataset(int number, const std::string& records) {
  char name[16];
  std::snprintf(name, sizeof name, "%6d\n", number);
  return "    -1\n" + (name + records) + "    -1\n";
}

/// Numbers in columns of ten.
std::string integers(const std::vector<int>& numbers) {
  std::string line;
  for (const int number : numbers) {
    char text[16];
    std::snprintf(text, sizeof text, "%10d", number);
    line += text;
  }
  return line + "\n";
}

std::string coordinates(double x, double y, double z) {
  char line[100];
  std::snprintf(line, sizeof line, "%25.16E%25.16E%25.16E\n", x, y, z);
  return line;
}

std::string node(int number, double x, double y, double z) {
  return integers({number, 1, 1, 11}) + coordinates(x, y, z);
}

/// An element of dataset 2412; beams have a line that tells their orientation.
std::string element(int number, int kind, int property, const std::vector<int>& nodes) {
  std::string text = integers({number, kind, property, 1, 7, int(nodes.size())});
  if (kind < 40) text += integers({0, 1, 1});
  for (std::size_t i = 0; i < nodes.size(); i += 8)
    text += integers({nodes.begin() + std::ptrdiff_t(i),
                      nodes.begin() + std::ptrdiff_t(std::min(i + 8, nodes.size()))});
  return text;
}

/// The unit cube's corners as nodes 11 to 18, and one above.
std::string cube_nodes() {
  return node(11, 0, 0, 0) + node(12, 1, 0, 0) + node(13, 1, 1, 0) + node(14, 0, 1, 0) +
         node(15, 0, 0, 1) + node(16, 1, 0, 1) + node(17, 1, 1, 1) + node(18, 0, 1, 1) +
         node(25, 0.5, 0.5, 2);
}

std::string cube(const std::string& groups = {}) {
  return dataset(164,
                 "         1  SI: Meters (newton)         2\n"
                 "    1.0000000000000000E+00    1.0000000000000000E+00\n") +
         dataset(2411, cube_nodes()) +
         dataset(2412, element(7, 115, 3, {11, 12, 13, 14, 15, 16, 17, 18}) +
                           element(8, 312, 4, {15, 16, 17, 18, 25}) +
                           element(9, 94, 5, {11, 12, 13, 14}) + element(10, 21, 6, {15, 25}) +
                           element(11, 161, 6, {25})) +
         groups;
}

}  // namespace

TEST_CASE("A universal file gives its cells, properties and groups", "[core][formats]") {
  const FormatFolder folder;
  const std::string groups =
      dataset(2467, integers({1, 0, 0, 0, 0, 0, 0, 3}) + "foot of it\n" +
                        integers({8, 9, 0, 0, 7, 25, 0, 0}) + integers({8, 10, 0, 0})) +
      dataset(2429, integers({2, 0, 0, 0, 0, 0, 2}) + "old\n" + integers({7, 11, 7, 12}));
  const MeshFile file(folder.put("cube.unv", cube(groups)));
  const Mesh& mesh = file.mesh();
  CHECK(file.format() == "UNV");
  REQUIRE(mesh.types == std::vector{Hexahedron, Pyramid, Quad, Line});
  CHECK(mesh.connectivity ==
        std::vector<Index>{0, 1, 2, 3, 4, 5, 6, 7, 4, 5, 6, 7, 8, 0, 1, 2, 3, 4, 8});
  CHECK(mesh.points.row(2) == Eigen::RowVector3d(1, 1, 0));
  CHECK(mesh.points.row(8) == Eigen::RowVector3d(0.5, 0.5, 2));
  CHECK(mesh.regions == std::vector<int>{3, 4, 5, 6});
  CHECK(mesh.region_array == "property");
  REQUIRE(mesh.groups.size() == 3);
  CHECK(mesh.groups[0].name == "foot of it");
  CHECK(mesh.groups[0].kind == "group of nodes");
  CHECK(mesh.groups[0].nodes == std::vector<Index>{8});
  CHECK(mesh.groups[1].name == "foot of it");
  CHECK(mesh.groups[1].kind == "group of elements");
  CHECK(mesh.groups[1].nodes == std::vector<Index>{0, 1, 2, 3, 4, 8});
  CHECK(mesh.groups[2].name == "old");
  CHECK(mesh.groups[2].nodes == std::vector<Index>{0, 1});
  REQUIRE(file.remarks().size() == 1);
  CHECK_THAT(file.remarks()[0], Catch::Contains(": 1 of kind 161"));
}

TEST_CASE("Second-order elements of universal files have VTK's nodes", "[core][formats]") {
  // Places in a cube of 0 to 4, a digit each, in the order that gmsh and Salome write.
  const FormatFolder folder;
  const auto check = [&](CellType type, int kind, const std::string& digits) {
    CAPTURE(kind);
    std::string nodes;
    std::vector<int> numbers;
    for (std::size_t i = 0; i < digits.size(); i += 3) {
      numbers.push_back(int(i / 3) + 1);
      nodes += node(numbers.back(), digits[i] - '0', digits[i + 1] - '0', digits[i + 2] - '0');
    }
    const MeshFile file(
        folder.put("one.unv", dataset(2411, nodes) + dataset(2412, element(1, kind, 1, numbers))));
    REQUIRE(file.mesh().types == std::vector{type});
    require_middles(file.mesh(), 0);
  };
  check(QuadraticEdge, 24, "000200400");
  check(QuadraticTriangle, 92, "000200400220040020");
  check(QuadraticQuad, 95, "000200400420440240040020");
  check(QuadraticTetra, 118, "000200400220040020002202022004");
  check(QuadraticWedge, 113, "000200400220040020002402042004204404224044024");
  check(QuadraticHexahedron, 116, "000200400420440240040020002402442042004204404424444244044024");
}

TEST_CASE("Older datasets of universal files are read", "[core][formats]") {
  const FormatFolder folder;
  std::string nodes;
  for (const auto& [number, x, y, z] :
       {std::tuple{1, 0., 0., 0.}, {2, 1., 0., 0.}, {3, 0., 1., 0.}, {4, 0., 0., 0.25}}) {
    char line[100];
    std::snprintf(line, sizeof line, "%10d%10d%10d%10d%13.5E%13.5E%13.5E\n", number, 1, 1, 11, x, y,
                  z);
    nodes += line;
  }
  const auto path = folder.put(
      "old.unv", dataset(15, nodes) +
                     dataset(780, integers({1, 111, 1, 2, 1, 1, 7, 4}) + integers({1, 2, 3, 4})));
  const MeshFile file(path);
  REQUIRE(file.mesh().types == std::vector{Tetra});
  CHECK(file.mesh().points(3, 2) == 0.25);
  Points moved = file.mesh().points;
  moved(1, 0) = 4.0 / 3;
  const CoordinateRounding rounding = file.write(folder / "out.unv", moved);
  CHECK(rounding.largest > 0);
  CHECK(rounding.largest < 1e-9);  // twelve columns
  require_promise(path, folder, "out.unv", 1e-9);
}

TEST_CASE("Moved coordinates keep the columns of a universal file", "[core][formats]") {
  const FormatFolder folder;
  std::string text = cube();
  // As gmsh writes them.
  for (std::size_t e = 0; (e = text.find("E+", e)) != text.npos;) text[e] = 'D';
  const MeshFile file(folder.put("cube.unv", text));
  Points moved = file.mesh().points;
  moved(1, 0) = -1.0 / 3;
  moved(1, 2) = 1.5e-30;
  CHECK(file.write(folder / "out.unv", moved).largest == 0);
  const std::string old_line =
      "   1.0000000000000000D+00   0.0000000000000000D+00"
      "   0.0000000000000000D+00\n";
  const std::string new_line =
      "      -0.3333333333333333   0.0000000000000000D+00"
      "                  1.5D-30\n";
  REQUIRE(old_line.size() == new_line.size());
  const std::size_t place = text.find(old_line);
  REQUIRE(place != text.npos);
  CHECK(bytes_of(folder / "out.unv") == text.replace(place, old_line.size(), new_line));
}

TEST_CASE("Universal files come back with other coordinates alone", "[core][formats]") {
  const FormatFolder folder;
  const std::string results = dataset(2414, "         1\nLOADCASE\n    -1.5  2 3\n");
  require_promise(folder.put("cube.unv", cube() + results), folder, "out.unv");
}

TEST_CASE("Bad universal files are refused by line", "[core][formats]") {
  const FormatFolder folder;
  const auto refused = [&](const std::string& old_text, const std::string& new_text,
                           std::initializer_list<std::string> parts) {
    std::string text = cube();
    const std::size_t place = text.find(old_text);
    REQUIRE(place != text.npos);
    text.replace(place, old_text.size(), new_text);
    require_refused(folder.put("bad.unv", text), parts);
  };
  refused(integers({15, 16, 17, 18, 25}), integers({15, 16, 17, 18, 26}),
          {"bad.unv", "line 31", "node 26", "not defined"});
  refused(integers({15, 16, 17, 18, 25}), integers({15, 16, 17, 18}),
          {"line 31", "element 8", "expected 5"});
  refused("         8       312", "         8       117", {"line 31", "kind 117"});
  refused(coordinates(0.5, 0.5, 2), "  0.5  0.5\n", {"line 25", "three coordinates"});
  refused(coordinates(0.5, 0.5, 2), "  0.5  0.5  x\n", {"line 25", "three coordinates", "'x'"});
  refused(coordinates(0.5, 0.5, 2), "\n", {"line 25", "three coordinates", "blank"});
  refused("  2412\n", "  2413\n", {"no elements"});
  refused("    -1\n  2412\n", "  2412\n", {"line 27", "expected -1"});
  std::string cut = cube();
  cut.resize(cut.rfind("    -1"));
  require_refused(folder.put("bad.unv", cut), {"line 27", "cut off"});
}

TEST_CASE("Damaged universal files never crash the reader", "[core][formats]") {
  const FormatFolder folder;
  require_robust(folder.put("cube.unv", cube(dataset(2477, integers({1, 0, 0, 0, 0, 0, 0, 1}) +
                                                               "top\n" + integers({8, 8, 0, 0})))),
                 folder);
}

}  // namespace cadmorph::test
