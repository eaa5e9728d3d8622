#include <catch2/catch.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "tests/core/formats/binary_text.h"
#include "tests/core/formats/format_checks.h"
#include "tests/core/formats/node_order_checks.h"

namespace cadmorph::test {
namespace {

// Two tetrahedra in two volumes, with a named group, one without a name, and one within another;
// node numbers with gaps. Each element of two groups is there twice, as gmsh writes it.
const std::string kVersion2 =
    "$Comments\nby hand\n$EndComments\n"
    "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n"
    "$PhysicalNames\n2\n2 7 \"left wall\"\n3 1 \"body\"\n$EndPhysicalNames\n"
    "$Nodes\n6\n"
    "10 0 0 0\n20 1.0 0 0\n30 0 1.00e0 0\n1000000 0 0 1\n50 1 1 1\n60 5 5 5\n"
    "$EndNodes\n"
    "$Elements\n6\n"
    "1 15 2 0 1 10\n"
    "2 2 2 7 4 10 1000000 30\n"
    "3 2 2 9 4 10 1000000 30\n"
    "4 4 2 1 1 10 20 30 1000000\n"
    "5 4 2 3 1 10 20 30 1000000\n"
    "6 4 4 1 2 1 1 20 50 30 1000000\n"
    "$EndElements\n"
    "$Periodic\n0\n$EndPeriodic\n"
    "$NodeData\n1\n\"T\"\n1\n0\n3\n0\n1\n1\n10 0.5\n$EndNodeData\n";

const std::string kVersion4 =
    "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n"
    "$PhysicalNames\n1\n2 7 \"left wall\"\n$EndPhysicalNames\n"
    "$Entities\n1 0 1 2\n"
    "1 0 0 0 0 \n"
    "4 0 0 0 0 1 1 2 7 9 0 \n"
    "1 0 0 0 1 1 1 1 1 1 4 \n"
    "2 0 0 0 1 1 1 1 1 0 \n"
    "$EndEntities\n"
    "$Nodes\n2 5 10 1000000\n"
    "2 4 1 3\n10\n1000000\n30\n0 0 0 0.1 0.2\n0 0 1 0.3 0.4\n0 1 0 0.5 0.6\n"
    "3 1 0 2\n20\n50\n1.0 0 0\n1 1 1\n"
    "$EndNodes\n"
    "$Elements\n3 3 1 3\n"
    "2 4 2 1\n1 10 1000000 30 \n"
    "3 1 4 1\n2 10 20 30 1000000 \n"
    "3 2 4 1\n3 20 50 30 1000000 \n"
    "$EndElements\n";

/// The mesh of kVersion2, less what is doubled there.
std::string binary_version_2(bool is_big_endian) {
  BinaryText text(is_big_endian);
  text.text("$MeshFormat\n2.2 1 8\n").int32({1}).text("\n$EndMeshFormat\n$Nodes\n5\n");
  const auto node = [&](int number, double x, double y, double z) {
    text.int32({number}).float64({x, y, z});
  };
  node(10, 0, 0, 0);
  node(20, 1, 0, 0);
  node(30, 0, 1, 0);
  node(1000000, 0, 0, 1);
  node(50, 1, 1, 1);
  text.text("\n$EndNodes\n$Elements\n3\n");
  text.int32({2, 1, 2}).int32({1, 7, 4, 10, 1000000, 30});
  text.int32({4, 2, 2}).int32({2, 1, 1, 10, 20, 30, 1000000}).int32({3, 1, 2, 20, 50, 30, 1000000});
  return text.text("\n$EndElements\n").bytes();
}

std::string binary_version_4(bool is_big_endian) {
  BinaryText text(is_big_endian);
  text.text("$MeshFormat\n4.1 1 8\n").int32({1}).text("\n$EndMeshFormat\n$Entities\n");
  text.int64({0, 0, 1, 2});
  text.int32({4}).float64({0, 0, 0, 0, 1, 1}).int64({1}).int32({7}).int64({0});
  text.int32({1}).float64({0, 0, 0, 1, 1, 1}).int64({0}).int64({1}).int32({4});
  text.int32({2}).float64({0, 0, 0, 1, 1, 1}).int64({0}).int64({0});
  text.text("\n$EndEntities\n$Nodes\n").int64({2, 5, 10, 1000000});
  text.int32({2, 4, 1}).int64({3, 10, 1000000, 30});
  text.float64({0, 0, 0, 0.1, 0.2, 0, 0, 1, 0.3, 0.4, 0, 1, 0, 0.5, 0.6});
  text.int32({3, 1, 0}).int64({2, 20, 50}).float64({1, 0, 0, 1, 1, 1});
  text.text("\n$EndNodes\n$Elements\n").int64({3, 3, 1, 3});
  text.int32({2, 4, 2}).int64({1, 1, 10, 1000000, 30});
  text.int32({3, 1, 4}).int64({1, 2, 10, 20, 30, 1000000});
  text.int32({3, 2, 4}).int64({1, 3, 20, 50, 30, 1000000});
  return text.text("\n$EndElements\n").bytes();
}

/// A file with one element of gmsh's number `type`, its nodes at digits / 4.
std::string one_element(int type, const std::string& digits) {
  const std::size_t count = digits.size() / 3;
  std::ostringstream nodes, element;
  for (std::size_t i = 0; i < count; ++i) {
    nodes << i + 1;
    for (std::size_t c = 0; c < 3; ++c) nodes << ' ' << 0.25 * (digits[3 * i + c] - '0');
    nodes << '\n';
    element << ' ' << i + 1;
  }
  std::ostringstream text;
  text << "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n"
       << count << '\n'
       << nodes.str() << "$EndNodes\n$Elements\n1\n1 " << type << " 2 0 1" << element.str()
       << "\n$EndElements\n";
  return text.str();
}

void require_two_tetrahedra(const Mesh& mesh) {
  const std::size_t cells = mesh.types.size();
  CHECK(mesh.types[cells - 2] == CellType::Tetra);
  CHECK(mesh.types[cells - 1] == CellType::Tetra);
  CHECK(mesh.regions[cells - 2] == 1);
  CHECK(mesh.regions[cells - 1] == 2);
  CHECK(node_name(mesh, mesh.cell(Index(cells) - 1)[0]).ends_with(" (number 20 of the file)"));
  CHECK(mesh.cell_numbers[Index(cells) - 1] > mesh.cell_numbers[Index(cells) - 2]);
  const auto last = mesh.cell(Index(cells) - 1);
  CHECK(mesh.points.row(last[0]) == Eigen::RowVector3d(1, 0, 0));
  CHECK(mesh.points.row(last[1]) == Eigen::RowVector3d(1, 1, 1));
  CHECK(mesh.points.row(last[2]) == Eigen::RowVector3d(0, 1, 0));
  CHECK(mesh.points.row(last[3]) == Eigen::RowVector3d(0, 0, 1));
}

}  // namespace

TEST_CASE("A gmsh file gives its cells, nodes and physical groups", "[core][formats]") {
  const FormatFolder folder;
  SECTION("version 2") {
    const MeshFile file(folder.put("two.msh", kVersion2));
    const Mesh& mesh = file.mesh();
    CHECK(file.format() == "gmsh");
    CHECK(mesh.types ==
          std::vector{CellType::Vertex, CellType::Triangle, CellType::Tetra, CellType::Tetra});
    CHECK(mesh.connectivity == std::vector<Index>{0, 0, 3, 2, 0, 1, 2, 3, 1, 4, 2, 3});
    require_two_tetrahedra(mesh);
    CHECK(mesh.node_count() == 6);
    CHECK(cell_name(mesh, 3) == "cell 3 (element 6 of the file)");
    REQUIRE(mesh.groups.size() == 2);
    CHECK(mesh.groups[0].name == "left wall");
    CHECK(mesh.groups[0].kind == "physical group");
    CHECK(mesh.groups[0].nodes == std::vector<Index>{0, 2, 3});
    CHECK(mesh.groups[1].name == "physical surface 9");
    CHECK(mesh.groups[1].nodes == std::vector<Index>{0, 2, 3});
    CHECK(file.remarks().size() == 2);  // periodic maps, elements listed twice
  }
  SECTION("version 4") {
    const MeshFile file(folder.put("two.msh", kVersion4));
    const Mesh& mesh = file.mesh();
    CHECK(mesh.connectivity == std::vector<Index>{0, 1, 2, 0, 3, 2, 1, 3, 4, 2, 1});
    require_two_tetrahedra(mesh);
    REQUIRE(mesh.groups.size() == 2);
    CHECK(mesh.groups[0].name == "left wall");
    CHECK(mesh.groups[1].name == "physical surface 9");
    CHECK(mesh.groups[1].nodes == std::vector<Index>{0, 1, 2});
    CHECK(file.remarks().size() == 1);  // parameters
    CHECK(file.notes().size() == 1);    // entities, in every such file
  }
}

TEST_CASE("Binary gmsh files of both byte orders give what text does", "[core][formats]") {
  const FormatFolder folder;
  for (const bool is_big_endian : {false, true}) {
    const MeshFile old_file(folder.put("old.msh", binary_version_2(is_big_endian)));
    CHECK(old_file.mesh().connectivity == std::vector<Index>{0, 3, 2, 0, 1, 2, 3, 1, 4, 2, 3});
    require_two_tetrahedra(old_file.mesh());
    const MeshFile new_file(folder.put("new.msh", binary_version_4(is_big_endian)));
    require_two_tetrahedra(new_file.mesh());
    REQUIRE(new_file.mesh().groups.size() == 1);
    CHECK(new_file.mesh().groups[0].nodes == std::vector<Index>{0, 1, 2});
  }
}

TEST_CASE("Second-order elements of gmsh come in VTK's node order", "[core][formats]") {
  const FormatFolder folder;
  // Nodes of straight elements in the order of files that gmsh 4.8.4 wrote.
  const auto check = [&](int type, CellType expected, const std::string& digits) {
    const MeshFile file(folder.put("one.msh", one_element(type, digits)));
    REQUIRE(file.mesh().types == std::vector{expected});
    require_middles(file.mesh(), 0);
  };
  check(8, CellType::QuadraticEdge, "000400200");
  check(9, CellType::QuadraticTriangle, "040000400020200220");
  check(10, CellType::BiquadraticQuad, "000400440040200420240020220");
  check(11, CellType::QuadraticTetra, "000040004400020022002200202220");
  check(12, CellType::TriquadraticHexahedron,
        "000400440040004404444044200020002420402240442042204024424244220202022422242224222");
  check(13, CellType::BiquadraticQuadraticWedge,
        "000400040004404044200020002220402042204024224202022222");
  check(14, CellType::BiquadraticQuadraticPyramid, "440040000400222240420331020131200111311220");
  check(16, CellType::QuadraticQuad, "000400440040200420240020");
  check(17, CellType::QuadraticHexahedron,
        "000400440040004404444044200020002420402240442042204024424244");
  check(18, CellType::QuadraticWedge, "000400040004404044200020002220402042204024224");
  check(19, CellType::QuadraticPyramid, "440040000400222240420331020131200111311");
}

TEST_CASE("gmsh files come back with other coordinates alone", "[core][formats]") {
  const FormatFolder folder;
  require_promise(folder.put("two.msh", kVersion2), folder, "out.msh");
  require_promise(folder.put("two.msh", kVersion4), folder, "out.msh");
  require_promise(folder.put("two.msh", binary_version_2(false)), folder, "out.msh");
  require_promise(folder.put("two.msh", binary_version_2(true)), folder, "out.msh");
  require_promise(folder.put("two.msh", binary_version_4(false)), folder, "out.msh");
  require_promise(folder.put("two.msh", binary_version_4(true)), folder, "out.msh");
}

TEST_CASE("What did not move keeps its characters in a gmsh file", "[core][formats]") {
  const FormatFolder folder;
  const MeshFile file(folder.put("two.msh", kVersion4));
  Points moved = file.mesh().points;
  moved(1, 2) = 1.25;
  file.write(folder / "out.msh", moved);
  std::string expected = kVersion4;
  const std::string old_line = "0 0 1 0.3 0.4";
  expected.replace(expected.find(old_line), old_line.size(), "0 0 1.25 0.3 0.4");
  CHECK(bytes_of(folder / "out.msh") == expected);
}

TEST_CASE("Partitions of a gmsh mesh are no regions", "[core][formats]") {
  const FormatFolder folder;
  std::string text = kVersion4;
  const std::string old_entities =
      text.substr(text.find("$Entities"), text.find("$Nodes") - text.find("$Entities"));
  // Volume 1 in partitions 5 and 6, and the surface between them.
  text.replace(text.find(old_entities), old_entities.size(),
               "$PartitionedEntities\n2\n1\n8 1\n0 0 1 2\n"
               "4 3 1 2 1 2 0 0 0 0 1 1 1 7 0 \n"
               "5 3 1 1 1 0 0 0 1 1 1 0 1 4 \n"
               "6 3 1 1 2 0 0 0 1 1 1 0 0 \n"
               "$EndPartitionedEntities\n");
  text.replace(text.find("3 1 4 1\n2"), 9, "3 5 4 1\n2");
  text.replace(text.find("3 2 4 1\n3"), 9, "3 6 4 1\n3");
  const MeshFile file(folder.put("parts.msh", text));
  CHECK(file.mesh().regions == std::vector<int>{4, 1, 1});
  CHECK(file.mesh().groups.empty());
}

namespace {

const std::string kBox =
    "$PhysicalNames\n3\n2 1 \"low\"\n2 2 \"high\"\n3 3 \"air\"\n$EndPhysicalNames\n"
    "$Nodes\n8\n1 0 0 0\n2 1 0 0\n3 1 1 0\n4 0 1 0\n5 0 0 1\n6 1 0 1\n7 1 1 1\n8 0 1 1\n"
    "$EndNodes\n"
    "$Elements\n3\n1 3 2 1 1 1 2 3 4\n2 3 2 2 2 5 6 7 8\n3 5 2 3 1 1 2 3 4 5 6 7 8\n"
    "$EndElements\n";
const std::string kNodesOfBox = "4\n5 1\n6 2\n7 3\n8 4\n";

/// The partner of each group of a file of version 2.2 with such a section.
std::vector<std::string> partners(const FormatFolder& folder, const std::string& links) {
  const MeshFile file(folder.put("mesh.msh", "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n" + kBox +
                                                 "$Periodic\n" + links + "$EndPeriodic\n"));
  std::vector<std::string> result;
  for (const NodeGroup& group : file.mesh().groups) result.push_back(group.partner);
  return result;
}

}  // namespace

TEST_CASE("Periodic surfaces of a gmsh file are pairs of its physical groups", "[core][formats]") {
  using Names = std::vector<std::string>;
  const FormatFolder folder;
  CHECK(partners(folder, "1\n2 2 1\n" + kNodesOfBox) == Names{"", "low"});
  CHECK(partners(folder, "2\n1 6 5\n2\n5 1\n6 2\n2 2 1\nAffine 1 0 0 0 0 1 0 0 0 0 1 1 0 0 0 1\n" +
                             kNodesOfBox) == Names{"", "low"});
  // Two surfaces make up the side.
  CHECK(partners(folder, "2\n2 2 1\n3\n5 1\n6 2\n7 3\n2 9 8\n3\n7 3\n8 4\n5 1\n") ==
        Names{"", "low"});
  const Names none = {"", ""};
  CHECK(partners(folder, "0\n") == none);
  CHECK(partners(folder, "1\n1 2 1\n" + kNodesOfBox) == none);            // curves
  CHECK(partners(folder, "1\n2 2 1\n3\n5 1\n6 2\n7 3\n") == none);        // not all of it
  CHECK(partners(folder, "1\n2 2 1\n4\n5 1\n6 2\n7 3\n8 5\n") == none);   // of no group
  CHECK(partners(folder, "1\n2 2 1\n4\n5 1\n6 2\n7 3\n8 99\n") == none);  // damaged
  CHECK(partners(folder, "7\n2 2 1\n" + kNodesOfBox) == none);            // cut off
}

TEST_CASE("Periodic surfaces of gmsh's version 4 and of binary files", "[core][formats]") {
  const FormatFolder folder;
  const std::string entities =
      "$Entities\n0 0 2 1\n1 0 0 0 1 1 0 1 1 0 \n2 0 0 1 1 1 1 1 2 0 \n1 0 0 0 1 1 1 1 3 0 \n"
      "$EndEntities\n";
  const std::string nodes =
      "$Nodes\n1 8 1 8\n3 1 0 8\n1\n2\n3\n4\n5\n6\n7\n8\n"
      "0 0 0\n1 0 0\n1 1 0\n0 1 0\n0 0 1\n1 0 1\n1 1 1\n0 1 1\n$EndNodes\n";
  const std::string elements =
      "$Elements\n3 3 1 3\n2 1 3 1\n1 1 2 3 4\n2 2 3 1\n2 5 6 7 8\n3 1 5 1\n3 1 2 3 4 5 6 7 8\n"
      "$EndElements\n";
  const std::string names = kBox.substr(0, kBox.find("$Nodes"));
  for (const char* map : {"0", "16 1 0 0 0 0 1 0 0 0 0 1 1 0 0 0 1"}) {
    const MeshFile file(folder.put(
        "text.msh", "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n" + names + entities + nodes + elements +
                        "$Periodic\n1\n2 2 1\n" + map + "\n" + kNodesOfBox + "$EndPeriodic\n"));
    REQUIRE(file.mesh().groups.size() == 2);
    CHECK(file.mesh().groups[1].partner == "low");
    CHECK(file.mesh().groups[0].partner.empty());
  }
  for (const bool is_big_endian : {false, true}) {
    INFO(is_big_endian);
    BinaryText text(is_big_endian);
    text.text("$MeshFormat\n4.1 1 8\n").int32({1}).text("\n$EndMeshFormat\n" + names);
    text.text("$Entities\n").int64({0, 0, 2, 1});
    for (int tag = 1; tag <= 2; ++tag)
      text.int32({tag}).float64({0, 0, 0, 1, 1, 1}).int64({1}).int32({tag}).int64({0});
    text.int32({1}).float64({0, 0, 0, 1, 1, 1}).int64({1}).int32({3}).int64({0});
    text.text("\n$EndEntities\n$Nodes\n").int64({1, 8, 1, 8}).int32({3, 1, 0}).int64({8});
    text.int64({1, 2, 3, 4, 5, 6, 7, 8});
    for (const double z : {0.0, 1.0}) text.float64({0, 0, z, 1, 0, z, 1, 1, z, 0, 1, z});
    text.text("\n$EndNodes\n$Elements\n").int64({3, 3, 1, 3});
    text.int32({2, 1, 3}).int64({1, 1, 1, 2, 3, 4}).int32({2, 2, 3}).int64({1, 2, 5, 6, 7, 8});
    text.int32({3, 1, 5}).int64({1, 3, 1, 2, 3, 4, 5, 6, 7, 8});
    text.text("\n$EndElements\n$Periodic\n").int64({1}).int32({2, 2, 1});
    text.int64({2}).float64({1, 1}).int64({4, 5, 1, 6, 2, 7, 3, 8, 4}).text("\n$EndPeriodic\n");
    const MeshFile file(folder.put("binary.msh", text.bytes()));
    REQUIRE(file.mesh().groups.size() == 2);
    CHECK(file.mesh().groups[1].partner == "low");
  }
}

TEST_CASE("Physical groups part a gmsh mesh whose entities are all alike", "[core][formats]") {
  const FormatFolder folder;
  std::string text = kVersion2;
  text.replace(text.find("6 4 4 1 2 1 1"), 13, "6 4 4 5 1 1 1");
  const MeshFile file(folder.put("alike.msh", text));
  CHECK(file.mesh().regions == std::vector<int>{0, 7, 1, 5});
  CHECK(file.mesh().region_array == "physical group");
  CHECK(file.mesh().zone_of_block.empty());
}

TEST_CASE("Entities of a gmsh mesh are blocks of what its physical groups name",
          "[core][formats]") {
  const FormatFolder folder;
  const auto zones = [&](std::string_view first, std::string_view second) {
    std::string text = kVersion4;
    const std::size_t begin = text.find("$Entities"), end = text.find("$EndEntities");
    text.replace(begin, end - begin,
                 "$Entities\n0 0 0 2\n1 0 0 0 1 1 1 " + std::string(first) + " 0\n2 0 0 0 1 1 1 " +
                     std::string(second) + " 0\n");
    return MeshFile(folder.put("blocks.msh", text)).mesh().zone_of_block;
  };
  const auto none = zones("0", "0"), one = zones("1 7", "1 7"), two = zones("1 7", "2 7 8");
  REQUIRE(none.size() == 2);
  CHECK(none.at(1) == none.at(2));
  CHECK(one.at(1) == one.at(2));
  CHECK(two.at(1) != two.at(2));
  const auto old = MeshFile(folder.put("old.msh", kVersion2)).mesh().zone_of_block;
  CHECK(old.size() == 2);
}

TEST_CASE("Bad gmsh files are refused by place", "[core][formats]") {
  const FormatFolder folder;
  const auto refused = [&](std::string text, const std::string& old_text,
                           const std::string& new_text, std::initializer_list<std::string> parts) {
    text.replace(text.find(old_text), old_text.size(), new_text);
    require_refused(folder.put("bad.msh", text), parts);
  };
  refused(kVersion2, "2.2 0 8", "3.0 0 8",
          {"bad.msh", "line 5", "2.0 to 2.2 and 4.1", "gmsh FILE"});
  refused(kVersion2, "$Nodes\n6", "$Nodes\n7", {"line 20", "number of a node", "$EndNodes"});
  refused(kVersion2, "$Nodes\n6", "$Nodes\n-6", {"line 13", "negative"});
  refused(kVersion2, "20 1.0", "10 1.0", {"two nodes", "number 10"});
  refused(kVersion2, "10 20 30 1000000", "10 20 31 1000000", {"line 26", "node 31"});
  refused(kVersion2, "4 4 2 1 1 10", "4 29 2 1 1 10",
          {"line 26", "type 29", "tetrahedron of order"});
  refused(kVersion2, "4 4 2 1 1 10", "4 999 2 1 1 10", {"line 26", "type 999", "not known"});
  refused(kVersion2, "$EndNodeData", "$EndNode", {"line 33", "$NodeData", "cut off"});
  refused(kVersion2, "2 7 \"left wall\"", "2 7 left", {"quotes"});
  refused(kVersion4, "2 5 10 1000000", "2 6 10 1000000", {"line 16", "6", "there are 5"});
  refused(kVersion4, "3 3 1 3", "3 4 1 3", {"line 31", "4", "there are 3"});
  refused(kVersion4, "$EndEntities", "$EndEntitie", {"line 14", "$EndEntities"});
  require_refused(folder.put("bad.msh", "$NOD\n0\n$ENDNOD\n"), {"format 1", "gmsh FILE"});
  require_refused(folder.put("bad.msh", kVersion2.substr(0, kVersion2.find("$Elements"))),
                  {"no elements"});
  const std::string binary = binary_version_4(false);
  require_refused(folder.put("bad.msh", binary.substr(0, binary.find("$EndNodes") - 60)),
                  {"byte", "the file"});
}

TEST_CASE("Damaged gmsh files never crash the reader", "[core][formats]") {
  const FormatFolder folder;
  require_robust(folder.put("two.msh", kVersion2), folder);
  require_robust(folder.put("two.msh", kVersion4), folder);
  require_robust(folder.put("two.msh", binary_version_2(false)), folder);
  require_robust(folder.put("two.msh", binary_version_4(true)), folder);
}

}  // namespace cadmorph::test
