#include <Eigen/Geometry>
#include <catch2/catch.hpp>
#include <numbers>
#include <string>

#include "core/errors.h"
#include "tests/core/formats/format_checks.h"
#include "tests/core/formats/node_order_checks.h"

namespace fs = std::filesystem;

namespace cadmorph::test {
namespace {

// Numbers in any order, with gaps; keywords and numbers as people write them.
const std::string kDeck =
    "** a comment\n"
    "*Heading\n"
    " two tetrahedra, a wedge, and a spring\n"
    "*NODE , nset = All\n"
    "10, 0., 0, 0.0\r\n"
    "7,1.D0,,\n"
    "  30 ,  0 , +1.5E0\n"
    "** between\n"
    "4,,,1.\n"
    "5, 1, 1, 1, 0.6, 0.8, 0.\n"
    "11, 0.12345678901234567, -2., 3.\n"
    "12, 1, -2, 3\n"
    "13, 0, -3, 3\n"
    "*element, TYPE=c3d4,\n"
    " ELSET=Lower\n"
    "1, 10, 7, 30, 4\n"
    "*Element, type=C3D4, elset=upper\n"
    "3, 7, 30,\n"
    " 4, 5\n"
    "*ELEMENT, TYPE=SPRINGA, ELSET=springs\n"
    "90, 4, 5\n"
    "*ELEMENT, TYPE=C3D6\n"
    "20, 11, 12, 13, 10, 7, 30,\n"
    "*NSET, NSET=fixed, GENERATE\n"
    "4, 10, 3\n"
    "*NSET, NSET=both\n"
    "fixed, 12, 999\n"
    "*ELSET, ELSET=pair\n"
    "Upper, 20\n"
    "*SURFACE, NAME=faces, TYPE=ELEMENT\n"
    "Lower, S1\n"
    "20, S2\n"
    "*SOLID SECTION, ELSET=lower, MATERIAL=steel\n"
    "*SOLID SECTION, ELSET=pair, MATERIAL=air\n"
    "1.\n"
    "*STEP\n"
    "*NODE PRINT, NSET=all\n"
    "U\n"
    "*END STEP\n";

const std::string kParts =
    "*HEADING\n"
    "*PART, NAME=block\n"
    "*NODE\n"
    "1, 0, 0, 0\n2, 1, 0, 0\n3, 0, 1, 0\n4, 0, 0, 1\n"
    "*ELEMENT, TYPE=C3D4, ELSET=solid\n"
    "1, 1, 2, 3, 4\n"
    "*NSET, NSET=tip\n4\n"
    "*END PART\n"
    "*ASSEMBLY, NAME=whole\n"
    "*INSTANCE, NAME=left, PART=Block\n"
    "*END INSTANCE\n"
    "*INSTANCE, NAME=right, PART=block\n"
    "5., 0.25, 0.\n"
    "5., 0.25, 0., 5., 0.25, 1., 90.\n"
    "*END INSTANCE\n"
    "*NODE\n1, 9, 9, 9\n"
    "*NSET, NSET=tips\nleft.tip, right.4\n"
    "*ELSET, ELSET=_faces, INSTANCE=right\nsolid\n"
    "*SURFACE, NAME=faces\n_faces, S1\n"
    "*END ASSEMBLY\n";

std::string replaced(std::string text, const std::string& old_text, const std::string& new_text) {
  const std::size_t place = text.find(old_text);
  REQUIRE(place != std::string::npos);
  return text.replace(place, old_text.size(), new_text);
}

const NodeGroup& group_of(const Mesh& mesh, const std::string& name) {
  for (const NodeGroup& group : mesh.groups)
    if (group.name == name) return group;
  FAIL("no group " << name);
  return mesh.groups[0];
}

}  // namespace

TEST_CASE("An Abaqus deck gives its cells, points, sets and materials", "[core][formats]") {
  const FormatFolder folder;
  const MeshFile file(folder.put("deck.inp", kDeck));
  const Mesh& mesh = file.mesh();
  CHECK(file.format() == "Abaqus");
  CHECK(mesh.types == std::vector{CellType::Tetra, CellType::Tetra, CellType::Wedge});
  CHECK(mesh.connectivity == std::vector<Index>{0, 1, 2, 3, 1, 2, 3, 4, 5, 6, 7, 0, 1, 2});
  CHECK(mesh.points.row(1) == Eigen::RowVector3d(1, 0, 0));
  CHECK(mesh.points.row(2) == Eigen::RowVector3d(0, 1.5, 0));
  CHECK(mesh.points.row(3) == Eigen::RowVector3d(0, 0, 1));
  CHECK(mesh.regions == std::vector<int>{1, 2, 2});
  CHECK(mesh.region_array == "material");
  CHECK(node_name(mesh, 1) == "node 1 (number 7 of the file)");
  CHECK(cell_name(mesh, 2) == "cell 2 (element 20 of the file)");
  CHECK(group_of(mesh, "All").nodes.size() == 8);
  CHECK(group_of(mesh, "fixed").nodes == std::vector<Index>{0, 1, 3});
  CHECK(group_of(mesh, "both").nodes == std::vector<Index>{0, 1, 3, 6});
  CHECK(group_of(mesh, "pair").kind == "element set");
  CHECK(group_of(mesh, "pair").nodes == std::vector<Index>{0, 1, 2, 3, 4, 5, 6, 7});
  CHECK(group_of(mesh, "faces").kind == "surface");
  CHECK(group_of(mesh, "faces").nodes == std::vector<Index>{0, 1, 2});
  REQUIRE(file.remarks().size() == 2);
  CHECK_THAT(file.remarks()[0], Catch::Contains(": 1 SPRINGA"));
  CHECK_THAT(file.remarks()[1], Catch::Contains("normals"));
}

TEST_CASE("Couplings, rigid bodies and constraints of Abaqus tie nodes", "[core][formats]") {
  const FormatFolder folder;
  const auto read = [&](const std::string& lines) {
    return MeshFile(folder.put("ties.inp", replaced(kDeck, "*STEP\n", lines + "*STEP\n")));
  };
  using Ties = std::vector<Tie>;
  // Nodes 10, 7, 30, 4, 5, 11, 12, 13 are 0 to 7.
  CHECK(read("*COUPLING, CONSTRAINT NAME=c, REF NODE=13, SURFACE=Faces\n*KINEMATIC\n1, 6\n")
            .mesh()
            .ties == Ties{{7, {0, 2, 1}}});
  CHECK(read("*NSET, NSET=ref\n13\n*SURFACE, TYPE=NODE, NAME=nodes\nfixed, 1.\n11\n"
             "*COUPLING, REF NODE=REF, SURFACE=nodes\n*DISTRIBUTING\n")
            .mesh()
            .ties == Ties{{7, {3, 1, 0, 5}}});
  CHECK(read("*RIGID BODY, REF NODE=13, ELSET=upper\n").mesh().ties == Ties{{7, {1, 2, 3, 4}}});
  CHECK(read("*RIGID BODY, REF NODE=13, TIE NSET=fixed, PIN NSET=both\n").mesh().ties ==
        Ties{{7, {6, 3, 1, 0}}});
  CHECK(read("*RIGID BODY, REF NODE=13, NSET=fixed, ROT NODE=12\n").mesh().ties ==
        Ties{{7, {3, 1, 0, 6}}});
  CHECK(read("*KINEMATIC COUPLING, REF NODE=13\nfixed, 1, 3\n11, 1\n").mesh().ties ==
        Ties{{7, {3, 1, 0, 5}}});
  CHECK(read("*NSET, NSET=a\n11, 12\n*NSET, NSET=b\n4, 5\n*MPC\nBEAM, 13, 4\nlink, a, 10\n"
             "TIE, a, b\nSLIDER, 13, 4, 5\n")
            .mesh()
            .ties == Ties{{7, {3}}, {5, {0}}, {6, {0}}, {5, {3}}, {6, {4}}});

  const MeshFile old = read(
      "*ELEMENT, TYPE=DCOUP3D, ELSET=load\n91, 13\n*DISTRIBUTING COUPLING, ELSET=Load\n"
      "11, 1.\nfixed, 1.\n");
  CHECK(old.mesh().ties == Ties{{7, {5, 3, 1, 0}}});
  CHECK_THAT(old.remarks()[0], !Catch::Contains("DCOUP3D"));

  // What names nothing ties nothing; what is in other files is not looked for.
  CHECK(read("*COUPLING, REF NODE=13\n*COUPLING, REF NODE=99, SURFACE=faces\n*RIGID BODY\n"
             "*COUPLING, SURFACE=none, REF NODE=13\n*MPC, INPUT=none.inp\n*MPC\nBEAM\nBEAM, 13\n"
             "BEAM, both, fixed\n*KINEMATIC COUPLING, REF NODE=x.y\n,\n")
            .mesh()
            .ties.empty());
}

TEST_CASE("The element sets of a deck without sections are its regions", "[core][formats]") {
  const FormatFolder folder;
  const std::string text =
      "*NODE\n1, 0, 0, 0\n2, 1, 0, 0\n3, 0, 1, 0\n4, 0, 0, 1\n5, 1, 1, 1\n"
      "*ELEMENT, TYPE=C3D4, ELSET=porous\n1, 1, 2, 3, 4\n"
      "*ELEMENT, TYPE=C3D4, ELSET=air\n2, 2, 3, 4, 5\n";
  const MeshFile file(folder.put("zones.inp", text));
  CHECK(file.mesh().regions == std::vector<int>{1, 2});
  CHECK(file.mesh().region_array == "element set");
  const MeshFile one(folder.put(
      "one.inp",
      text + "*SOLID SECTION, ELSET=air, MATERIAL=a\n*SOLID SECTION, ELSET=porous, MATERIAL=a\n"));
  CHECK(one.mesh().regions.empty());
}

TEST_CASE("Abaqus decks come back with other coordinates alone", "[core][formats]") {
  const FormatFolder folder;
  require_promise(folder.put("deck.inp", kDeck), folder, "out.inp", 1e-16);
}

TEST_CASE("Moved coordinates of an Abaqus deck take the place of the old ones", "[core][formats]") {
  const FormatFolder folder;
  const MeshFile file(folder.put("deck.inp", kDeck));
  Points moved = file.mesh().points;
  moved(1, 1) = 0.5;                      // blank
  moved(2, 2) = -0.25;                    // not there
  moved(3, 0) = -0.00012345678901234567;  // more than 20 characters
  const CoordinateRounding rounding = file.write(folder / "out.inp", moved);
  CHECK(rounding.largest > 0);
  CHECK(rounding.relative < 1e-16);
  std::string expected = replaced(kDeck, "7,1.D0,,", "7,1.D0,0.5,");
  expected = replaced(expected, "  30 ,  0 , +1.5E0", "  30 ,  0 , +1.5E0, -0.25");
  expected = replaced(expected, "4,,,1.", "4,-.000123456789012346,,1.");
  CHECK(bytes_of(folder / "out.inp") == expected);
}

TEST_CASE("Second-order and shell elements of Abaqus have VTK's nodes", "[core][formats]") {
  const FormatFolder folder;
  // Nodes 1 to 20 of the quadratic hexahedron in Abaqus's order, by their places.
  const double places[20][3] = {{0, 0, 0}, {2, 0, 0}, {2, 2, 0}, {0, 2, 0}, {0, 0, 2},
                                {2, 0, 2}, {2, 2, 2}, {0, 2, 2}, {1, 0, 0}, {2, 1, 0},
                                {1, 2, 0}, {0, 1, 0}, {1, 0, 2}, {2, 1, 2}, {1, 2, 2},
                                {0, 1, 2}, {0, 0, 1}, {2, 0, 1}, {2, 2, 1}, {0, 2, 1}};
  std::string deck = "*NODE, NSET=all\n";
  std::string nodes;
  for (int i = 0; i < 20; ++i) {
    deck += std::to_string(i + 1);
    for (const double x : places[i]) deck += ", " + std::to_string(x);
    deck += "\n";
    nodes += ", " + std::to_string(i + 1) + (i == 14 ? ",\n" : "");
  }
  deck += "*ELEMENT, TYPE=C3D20R\n1" + nodes +
          "\n*ELEMENT, TYPE=S8R\n2, 1, 2, 3, 4, 9, 10, 11, 12\n"
          "*ELEMENT, TYPE=STRI65\n3, 1, 2, 3, 9, 10, 11\n"
          "*ELEMENT, TYPE=B32\n4, 1, 9, 2\n"
          "*ELEMENT, TYPE=T3D2\n5, 1, 2\n"
          "*SURFACE, NAME=top\n1, S2\n"
          "*SURFACE, NAME=side\n1, S6\n";
  const MeshFile file(folder.put("hexa.inp", deck));
  const Mesh& mesh = file.mesh();
  using enum CellType;
  REQUIRE(mesh.types ==
          std::vector{QuadraticHexahedron, QuadraticQuad, QuadraticTriangle, QuadraticEdge, Line});
  // VTK puts its mid-side nodes between these corners.
  constexpr int kEdges[12][2] = {{0, 1}, {1, 2}, {2, 3}, {3, 0}, {4, 5}, {5, 6},
                                 {6, 7}, {7, 4}, {0, 4}, {1, 5}, {2, 6}, {3, 7}};
  const auto cell = mesh.cell(0);
  for (int e = 0; e < 12; ++e) {
    const Eigen::RowVector3d middle = (mesh.points.row(cell[std::size_t(kEdges[e][0])]) +
                                       mesh.points.row(cell[std::size_t(kEdges[e][1])])) /
                                      2;
    CHECK(mesh.points.row(cell[std::size_t(8 + e)]) == middle);
  }
  CHECK(std::vector<Index>(mesh.cell(3).begin(), mesh.cell(3).end()) ==
        std::vector<Index>{0, 1, 8});
  for (const Index node : group_of(mesh, "top").nodes) CHECK(mesh.points(node, 2) == 2);
  CHECK(group_of(mesh, "top").nodes.size() == 8);
  for (const Index node : group_of(mesh, "side").nodes) CHECK(mesh.points(node, 0) == 0);
  CHECK(group_of(mesh, "side").nodes.size() == 8);
  require_promise(folder / "hexa.inp", folder, "out.inp", 1e-16);
}

TEST_CASE("Hexahedra of 27 nodes of Abaqus have VTK's nodes, and their faces", "[core][formats]") {
  const FormatFolder folder;
  const Points places = unit_cell(CellType::TriquadraticHexahedron);
  // Behind those of edges: the middle, then the faces S1 to S6.
  constexpr int kLast[] = {26, 24, 25, 22, 21, 23, 20};
  std::string deck = "*NODE\n", nodes;
  for (int n = 0; n < 27; ++n) {
    const int place = n < 20 ? n : kLast[n - 20];
    deck += std::to_string(n + 1);
    for (int k = 0; k < 3; ++k) deck += ", " + std::to_string(places(place, k));
    deck += "\n";
    nodes += ", " + std::to_string(n + 1) + (n == 14 ? ",\n" : "");
  }
  deck += "*ELEMENT, TYPE=C3D27\n1" + nodes + "\n*SURFACE, NAME=side\n1, S6\n";
  const MeshFile file(folder.put("hexa.inp", deck));
  const Mesh& mesh = file.mesh();
  REQUIRE(mesh.types == std::vector{CellType::TriquadraticHexahedron});
  require_middles(mesh, 0);
  CHECK(group_of(mesh, "side").nodes.size() == 9);
  for (const Index node : group_of(mesh, "side").nodes) CHECK(mesh.points(node, 0) == 0);
  require_promise(folder / "hexa.inp", folder, "out.inp", 1e-16);
}

TEST_CASE("Instances of an Abaqus deck lie where the assembly puts them", "[core][formats]") {
  const FormatFolder folder;
  const MeshFile file(folder.put("parts.inp", kParts));
  const Mesh& mesh = file.mesh();
  REQUIRE(mesh.node_count() == 9);
  CHECK(mesh.points.row(0) == Eigen::RowVector3d(9, 9, 9));
  CHECK(mesh.points.row(2) == Eigen::RowVector3d(1, 0, 0));
  // (1, 0, 0) moved to (6, 0.25, 0), turned by a right angle about the axis at (5, 0.25).
  CHECK((mesh.points.row(6) - Eigen::RowVector3d(5, 1.25, 0)).norm() < 1e-15);
  CHECK(group_of(mesh, "tips").nodes == std::vector<Index>{4, 8});
  CHECK(group_of(mesh, "RIGHT.tip").nodes == std::vector<Index>{8});
  CHECK(group_of(mesh, "faces").nodes == std::vector<Index>{5, 6, 7});

  SECTION("The assembly ties nodes of instances") {
    const MeshFile tied(
        folder.put("tied.inp", replaced(kParts, "*END ASSEMBLY",
                                        "*COUPLING, REF NODE=1, SURFACE=faces\n*KINEMATIC\n"
                                        "*MPC\nBEAM, left.tip, right.1\n*END ASSEMBLY")));
    CHECK(tied.mesh().ties == std::vector<Tie>{{0, {5, 7, 6}}, {4, {5}}});
  }
  SECTION("And so does a part, in each instance") {
    const MeshFile tied(
        folder.put("tied.inp", replaced(kParts, "*END PART",
                                        "*SURFACE, NAME=base\nsolid, S1\n"
                                        "*COUPLING, REF NODE=4, SURFACE=base\n*END PART")));
    CHECK(tied.mesh().ties == std::vector<Tie>{{4, {1, 3, 2}}, {8, {5, 7, 6}}});
  }
  SECTION("Instances that move alike in the part's own frame are written") {
    Points moved = mesh.points;
    moved.row(2) += Eigen::RowVector3d(0.25, 0, 0);
    moved.row(6) += Eigen::RowVector3d(0, 0.25, 0);
    file.write(folder / "out.inp", moved);
    CHECK(bytes_of(folder / "out.inp") == replaced(kParts, "2, 1, 0, 0", "2, 1.25, 0, 0"));
  }
  SECTION("Others are refused") {
    Points moved = mesh.points;
    moved(6, 1) += 0.25;
    REQUIRE_THROWS_WITH(file.write(folder / "out.inp", moved),
                        Catch::Contains("instance LEFT") && Catch::Contains("instance RIGHT"));
    CHECK(!fs::exists(folder / "out.inp"));
  }
}

TEST_CASE("A part of one instance is written in its own frame", "[core][formats]") {
  const FormatFolder folder;
  const std::string left = "*INSTANCE, NAME=left, PART=Block\n*END INSTANCE\n";
  require_promise(folder.put("one.inp", replaced(kParts, left, "")), folder, "out.inp", 1e-14);
}

TEST_CASE("Systems of coordinates of Abaqus are followed", "[core][formats]") {
  const FormatFolder folder;
  const std::string deck =
      "*HEADING\n"
      "*SYSTEM\n1, 2, 3, 1, 3, 3\n0, 2, 3\n"
      "*NODE\n1, 1, 0, 0\n2, 0, 2, 0\n"
      "*SYSTEM\n"
      "*NODE, SYSTEM=C\n3, 2, 90, 1\n4, 2, 270, 5\n"
      "*ELEMENT, TYPE=C3D4\n1, 1, 2, 3, 4\n";
  const MeshFile file(folder.put("systems.inp", deck));
  const Points& points = file.mesh().points;
  const auto is_at = [&](Index node, double x, double y, double z) {
    return (points.row(node) - Eigen::RowVector3d(x, y, z)).norm() < 1e-14;
  };
  CHECK(is_at(0, 1, 3, 3));
  CHECK(is_at(1, -1, 2, 3));
  CHECK(is_at(2, 0, 2, 1));
  CHECK(is_at(3, 0, -2, 5));
  require_promise(folder / "systems.inp", folder, "out.inp", 1e-14);
  Points moved = points;
  moved(3, 1) = -3;
  file.write(folder / "out.inp", moved);
  CHECK(bytes_of(folder / "out.inp").find("4, 3, 270, 5") != std::string::npos);
}

TEST_CASE("Files that an Abaqus deck includes are copied with it", "[core][formats]") {
  const FormatFolder folder;
  const std::string main =
      "*HEADING\n*NODE\n1, 0, 0, 0\n*INCLUDE, INPUT=sub/nodes.inc\n4, 0, 0, 1\n"
      "*INCLUDE, INPUT=cells.inc\n";
  const std::string nodes = "2, 1, 0, 0\n3, 0, 1, 0\n";
  folder.put("sub/nodes.inc", nodes);
  folder.put("cells.inc", "*ELEMENT, TYPE=C3D4\n1, 1, 2, 3, 4\n");
  const MeshFile file(folder.put("main.inp", main));
  const Mesh& mesh = file.mesh();
  CHECK(mesh.points.row(2) == Eigen::RowVector3d(0, 1, 0));
  CHECK(mesh.cell_count() == 1);
  fs::create_directories(folder / "out");

  REQUIRE_THROWS_WITH(file.check_target(folder / "out.inp"),
                      Catch::Contains("sub/nodes.inc") && Catch::Contains("another folder"));
  Points moved = mesh.points;
  moved(2, 1) = 1.5;
  moved(3, 2) = 2;
  REQUIRE_THROWS_AS(file.write(folder / "out.inp", moved), InvalidInputError);
  file.write(folder / "out/main.inp", moved);
  CHECK(bytes_of(folder / "out/main.inp") == replaced(main, "0, 0, 1", "0, 0, 2"));
  CHECK(bytes_of(folder / "out/sub/nodes.inc") == replaced(nodes, "0, 1, 0", "0, 1.5, 0"));
  CHECK(MeshFile(folder / "out/main.inp").mesh().points == moved);
  REQUIRE_THROWS_WITH(file.write(folder / "out/other.inp", moved),
                      Catch::Contains("is there already"));
  CHECK(!fs::exists(folder / "out/other.inp"));
  // Another copy takes the place of one before, with what it includes.
  moved(2, 1) = 1.25;
  file.write(folder / "out/main.inp", moved);
  CHECK(MeshFile(folder / "out/main.inp").mesh().points == moved);
  CHECK(file.needs_folder(folder / "out/main.inp"));
  CHECK(!file.needs_folder(folder / "out/main.vtu"));
}

TEST_CASE("An Abaqus deck includes files by paths as Windows writes them", "[core][formats]") {
  const FormatFolder folder;
  const std::string main = "*INCLUDE, INPUT=sub\\nodes.inc\n*ELEMENT, TYPE=S3\n1, 1, 2, 3\n";
  folder.put("sub/nodes.inc", "*NODE\n1, 0, 0, 0\n2, 1, 0, 0\n3, 0, 1, 0\n");
  const MeshFile file(folder.put("main.inp", main));
  fs::create_directories(folder / "out");
  Points moved = file.mesh().points;
  moved(2, 1) = 1.5;
  file.write(folder / "out/main.inp", moved);
  CHECK(bytes_of(folder / "out/main.inp") == main);
  CHECK(fs::exists(folder / "out/sub/nodes.inc"));
  CHECK(MeshFile(folder / "out/main.inp").mesh().points == moved);
  // A file of that very name comes first.
  folder.put("sub\\nodes.inc", "*NODE\n1, 0, 0, 5\n2, 1, 0, 5\n3, 0, 1, 5\n");
  CHECK(MeshFile(folder / "main.inp").mesh().points(0, 2) == 5);
}

TEST_CASE("Elements of Abaqus without thickness are no cells", "[core][formats]") {
  const FormatFolder folder;
  const MeshFile file(
      folder.put("glued.inp",
                 "*NODE\n1, 0, 0, 0\n2, 1, 0, 0\n3, 0, 1, 0\n4, 0, 0, -1\n"
                 "11, 0, 0, 0\n12, 1, 0, 0\n13, 0, 1, 0\n14, 0, 0, 1\n"
                 "*ELEMENT, TYPE=C3D4, ELSET=SOLID\n1, 1, 3, 2, 4\n2, 11, 12, 13, 14\n"
                 "*ELEMENT, TYPE=COH3D6, ELSET=GLUE\n3, 1, 2, 3, 11, 12, 13\n"));
  CHECK(file.mesh().types == std::vector(2, CellType::Tetra));
  CHECK(file.mesh().offsets == std::vector<Index>{0, 4, 8});
  CHECK(file.mesh().regions.size() != 3);
  CHECK_THAT(file.remarks(), Catch::VectorContains(std::string(
                                 "1 elements of no thickness (cohesive ones) are no cells of the "
                                 "mesh; their nodes follow the others")));
  Points moved = file.mesh().points;
  moved(6, 1) = 1.5;
  file.write(folder / "out.inp", moved);
  CHECK(bytes_of(folder / "out.inp").find("3, 1, 2, 3, 11, 12, 13") != std::string::npos);
}

TEST_CASE("A copy is compressed where its name says so", "[core][formats]") {
  const FormatFolder folder;
  const MeshFile file(folder.put("deck.inp", kDeck));
  Points moved = file.mesh().points;
  moved(3, 0) = 0.25;
  file.write(folder / "packed.inp.gz", moved);
  CHECK(bytes_of(folder / "packed.inp.gz").starts_with("\x1f\x8b"));
  const MeshFile packed(folder / "packed.inp.gz");
  CHECK(packed.mesh().points == moved);
  file.write(folder / "plain.inp", moved);
  packed.write(folder / "unpacked.inp", moved);
  CHECK(bytes_of(folder / "unpacked.inp") == bytes_of(folder / "plain.inp"));
}

TEST_CASE("Included files outside the deck's folder can't hold nodes that move",
          "[core][formats]") {
  const FormatFolder folder;
  folder.put("nodes.inc", "*NODE\n1, 0, 0, 0\n2, 1, 0, 0\n3, 0, 1, 0\n");
  const MeshFile file(
      folder.put("deck/main.inp", "*INCLUDE, INPUT=../nodes.inc\n*ELEMENT, TYPE=S3\n1, 1, 2, 3\n"));
  REQUIRE_THROWS_WITH(file.check_target(folder / "other/main.inp"), Catch::Contains("nodes.inc"));
  REQUIRE(file.remarks().size() == 1);
  CHECK_THAT(file.remarks()[0], Catch::Contains("../nodes.inc is not copied"));
}

TEST_CASE("Bad Abaqus decks are refused by line", "[core][formats]") {
  const FormatFolder folder;
  const auto refused = [&](const std::string& old_text, const std::string& new_text,
                           std::initializer_list<std::string> parts) {
    require_refused(folder.put("bad.inp", replaced(kDeck, old_text, new_text)), parts);
  };
  refused("1, 10, 7, 30, 4", "1, 10, 7, 30, 6", {"bad.inp", "line 16", "node 6", "not defined"});
  refused("1, 10, 7, 30, 4", "1, 10, 7, 30", {"line 16", "element 1", "3 of 4"});
  refused("1, 10, 7, 30, 4", "1, 10, 7, 30, 4, 5", {"line 16", "element 1", "5 nodes"});
  refused("1, 10, 7, 30, 4", "1, 10, x, 30, 4", {"line 16", "number of a node", "'x"});
  refused("TYPE=c3d4", "TYPE=C3D7", {"line 14", "'C3D7'"});
  refused("TYPE=c3d4", "SORT=c3d4", {"line 14", "TYPE="});
  refused("12, 1, -2, 3", "12, 1, two, 3", {"line 12", "a coordinate", "'two'"});
  refused("12, 1, -2, 3", "x, 1, 2, 3", {"line 12", "number of a node", "'x'"});
  refused("12, 1, -2, 3", "5, 1, -2, 3", {"line 12", "node 5", "defined before"});
  refused("*NSET, NSET=both", "*NGEN\n1, 10\n*NSET, NSET=both", {"line 26", "*NGEN", "*NODE"});
  refused("*NSET, NSET=both", "*ELGEN\n1, 10\n*NSET, NSET=both", {"line 26", "*ELGEN"});
  refused("*NODE , nset = All", "*NODE, NSET=a, SYSTEM=S", {"line 4", "SYSTEM=S"});
  refused("4, 10, 3\n", "4, x, 3\n", {"line 25", "first, last and step"});
  refused("*STEP\n", "*INCLUDE, INPUT=none.inc\n", {"line 36", "none.inc"});
  refused("*STEP\n", "*INCLUDE, INPUT=bad.inp\n", {"line 36", "includes itself"});
  require_refused(folder.put("bad.inp", replaced(kParts, "PART=block", "PART=none")),
                  {"line 16", "no part NONE"});
  require_refused(folder.put("bad.inp", replaced(kParts, "5., 0.25, 1., 90.", "5., 0.25, 0., 90.")),
                  {"line 16", "no length"});
  require_refused(folder.put("bad.inp", "*HEADING\n*STEP\n"), {"no nodes"});
}

TEST_CASE("Damaged Abaqus decks never crash the reader", "[core][formats]") {
  const FormatFolder folder;
  require_robust(folder.put("deck.inp", kDeck), folder);
  require_robust(folder.put("parts.inp", kParts), folder);
}

TEST_CASE("A node of Abaqus that stands twice at one place is one node", "[core][formats]") {
  const FormatFolder folder;
  const MeshFile file(
      folder.put("twice.inp", replaced(kDeck, "13, 0, -3, 3", "13, 0, -3, 3\n10, 0, 0., 0")));
  REQUIRE(file.mesh().node_count() == 8);
  Points moved = file.mesh().points;
  moved(0, 1) = 0.125;
  file.write(folder / "out.inp", moved);
  const std::string out = bytes_of(folder / "out.inp");
  CHECK(out.find("10, 0., 0.125, 0.0\r\n") != std::string::npos);
  CHECK(out.find("10, 0, 0.125, 0\n") != std::string::npos);
}

}  // namespace cadmorph::test
