#include <catch2/catch.hpp>
#include <string>

#include "tests/core/formats/format_checks.h"

namespace cadmorph::test {
namespace {

// Two triangles and a quadrilateral, numbers and spaces as people write them.
const std::string kPlane =
    "% a comment\n"
    "NDIME= 2\n"
    "NELEM=  3\n"
    "9 0 1 4 3 0\n"
    "5\t1 2 4 1\n"
    "5 2 5 4 2   % last\n"
    "NPOIN= 6\r\n"
    "  0.0 0 0\n"
    "1.00000e+00  0.0 1\n"
    "+2 0 2\n"
    "0 1 3\n"
    "1.5E0 1.25 4\n"
    "2 1 5\n"
    "NMARK= 2\n"
    "MARKER_TAG= lower\n"
    "MARKER_ELEMS= 2\n"
    "3 0 1\n"
    "3 1 2\n"
    "MARKER_TAG=upper\n"
    "MARKER_ELEMS= 1\n"
    "3 3 4\n"
    "FFD_NBOX= 0\n";

const std::string kZones =
    "NZONE= 2\nIZONE= 1\nNDIME= 3\nNPOIN= 4\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n"
    "NELEM= 1\n10 0 1 2 3\nNMARK= 1\nMARKER_TAG= wall\nMARKER_ELEMS= 1\n5 0 2 1\n"
    "IZONE= 2\nNDIME= 3\nNPOIN= 4\n2 0 0\n3 0 0\n2 1 0\n2 0 1\n"
    "NELEM= 1\n10 0 1 2 3\nNMARK= 1\nMARKER_TAG= wall\nMARKER_ELEMS= 1\n5 1 2 3\n";

}  // namespace

TEST_CASE("An SU2 file gives its cells, points and markers", "[core][formats]") {
  const FormatFolder folder;
  const MeshFile file(folder.put("plane.su2", kPlane));
  const Mesh& mesh = file.mesh();
  CHECK(file.format() == "SU2");
  CHECK(mesh.types == std::vector{CellType::Quad, CellType::Triangle, CellType::Triangle});
  CHECK(mesh.connectivity == std::vector<Index>{0, 1, 4, 3, 1, 2, 4, 2, 5, 4});
  CHECK(mesh.points.row(4) == Eigen::RowVector3d(1.5, 1.25, 0));
  REQUIRE(mesh.groups.size() == 2);
  CHECK(mesh.groups[0].name == "lower");
  CHECK(mesh.groups[0].nodes == std::vector<Index>{0, 1, 2});
  CHECK(mesh.groups[1].name == "upper");
  CHECK(mesh.groups[1].nodes == std::vector<Index>{3, 4});
  CHECK(mesh.regions.empty());
  CHECK(file.remarks().size() == 1);  // of the FFD boxes
}

TEST_CASE("Zones of an SU2 file are regions of one mesh", "[core][formats]") {
  const FormatFolder folder;
  const MeshFile file(folder.put("zones.su2", kZones));
  const Mesh& mesh = file.mesh();
  CHECK(mesh.regions == std::vector<int>{1, 2});
  CHECK(mesh.connectivity == std::vector<Index>{0, 1, 2, 3, 4, 5, 6, 7});
  REQUIRE(mesh.groups.size() == 2);
  CHECK(mesh.groups[1].nodes == std::vector<Index>{5, 6, 7});
}

TEST_CASE("Partitions and periodic maps of an SU2 file stay", "[core][formats]") {
  const FormatFolder folder;
  const std::string keyword = GENERATE(as<std::string>(), "SEND_RECV", "SEND_TO");
  const auto path =
      folder.put("part.su2",
                 "AOA= 1.5\nNDIME = 2\nNELEM= 1  \n5 0 1 2 0\nNPOIN= 3 2\n0 0 0\n1 0 1\n0 1 2\n"
                 "NMARK= 2\nMARKER_TAG= wall\nMARKER_ELEMS= 1\n3 0 1\n"
                 "MARKER_TAG= SEND_RECEIVE\nMARKER_ELEMS= 2\n" +
                     keyword +
                     "= 2\n1 1 0\n1 2 0\n"
                     "NPERIODIC= 2\nPERIODIC_INDEX= 0\nPERIODIC_CENTER= 0 0 0\n");
  const MeshFile file(path);
  REQUIRE(file.mesh().groups.size() == 2);
  CHECK(file.mesh().groups[1].name == "SEND_RECEIVE");
  CHECK(file.mesh().groups[1].nodes == std::vector<Index>{1, 2});
  CHECK(file.remarks().size() == 1);
  require_promise(path, folder, "out.su2");
}

TEST_CASE("SU2 files come back with other coordinates alone", "[core][formats]") {
  const FormatFolder folder;
  require_promise(folder.put("plane.su2", kPlane), folder, "out.su2");
  require_promise(folder.put("zones.su2", kZones), folder, "out.su2");
}

TEST_CASE("What did not move keeps its characters in an SU2 file", "[core][formats]") {
  const FormatFolder folder;
  const MeshFile file(folder.put("plane.su2", kPlane));
  Points moved = file.mesh().points;
  moved(1, 1) = -0.1;
  file.write(folder / "out.su2", moved);
  std::string expected = kPlane;
  const std::string old_line = "1.00000e+00  0.0 1";
  expected.replace(expected.find(old_line), old_line.size(), "1.00000e+00  -0.1 1");
  CHECK(bytes_of(folder / "out.su2") == expected);
}

TEST_CASE("A compressed file comes back compressed", "[core][formats]") {
  const FormatFolder folder;
  folder.put("plane.su2", kPlane);
  REQUIRE(std::system(("gzip -k " + (folder / "plane.su2").string()).c_str()) == 0);
  require_promise(folder / "plane.su2.gz", folder, "out.su2.gz");
  CHECK(bytes_of(folder / "out.su2.gz").starts_with("\x1f\x8b"));
}

TEST_CASE("A plane SU2 mesh can't leave its plane", "[core][formats]") {
  const FormatFolder folder;
  const MeshFile file(folder.put("plane.su2", kPlane));
  Points moved = file.mesh().points;
  moved(2, 2) = 0.5;
  REQUIRE_THROWS_WITH(file.write(folder / "out.su2", moved), Catch::Contains("node 2"));
  CHECK(!std::filesystem::exists(folder / "out.su2"));
}

TEST_CASE("Bad SU2 files are refused by line", "[core][formats]") {
  const FormatFolder folder;
  const auto refused = [&](const std::string& old_text, const std::string& new_text,
                           std::initializer_list<std::string> parts) {
    std::string text = kPlane;
    text.replace(text.find(old_text), old_text.size(), new_text);
    require_refused(folder.put("bad.su2", text), parts);
  };
  refused("9 0 1 4 3 0", "9 0 1 6 3 0", {"bad.su2", "line 4", "node 6", "6 points"});
  refused("9 0 1 4 3 0", "9 0 -1 4 3 0", {"line 4", "node -1"});
  refused("9 0 1 4 3 0", "42 0 1 4 3 0", {"line 4", "element type 42"});
  refused("NPOIN= 6", "NPOIN= 7", {"line 14", "coordinate", "NMARK="});
  refused("NPOIN= 6", "NPOIN= 99999999999", {"line 7", "99999999999"});
  refused("1.5E0", "nought", {"line 12", "a coordinate", "'nought'"});
  refused("1.5E0", "nan", {"not finite", "node 4"});
  refused("NDIME= 2", "NDIME= 4", {"line 2", "dimension"});
}

TEST_CASE("Damaged SU2 files never crash the reader", "[core][formats]") {
  const FormatFolder folder;
  require_robust(folder.put("plane.su2", kPlane), folder);
  require_robust(folder.put("zones.su2", kZones), folder);
}

TEST_CASE("The copy of a file keeps its format", "[core][formats]") {
  const FormatFolder folder;
  const MeshFile file(folder.put("plane.su2", kPlane));
  REQUIRE_NOTHROW(file.write(folder / "out.vtu", file.mesh().points));
  const MeshFile vtu(folder / "out.vtu");
  CHECK(vtu.mesh().points == file.mesh().points);
  CHECK(vtu.mesh().connectivity == file.mesh().connectivity);
  REQUIRE_THROWS_WITH(vtu.write(folder / "out.su2", file.mesh().points),
                      Catch::Contains("SU2") && Catch::Contains(".vtu"));
}

TEST_CASE("Files of no format are refused", "[core][formats]") {
  const FormatFolder folder;
  require_refused(folder / "none.su2", {"none.su2", "there is no such file"});
  require_refused(folder.put("empty.su2", ""), {"empty.su2", "it is empty"});
  require_refused(folder.put("letter.txt", "Dear reader\n"), {"no format that is known", "SU2"});
  require_refused(folder.put("letter.su2", "Dear reader\n"), {"SU2", "does not begin as one"});
  require_refused(folder / "", {"folder"});
}

}  // namespace cadmorph::test
