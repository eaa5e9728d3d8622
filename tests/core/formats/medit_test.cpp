#include <catch2/catch.hpp>
#include <string>

#include "tests/core/formats/binary_text.h"
#include "tests/core/formats/format_checks.h"
#include "tests/core/formats/node_order_checks.h"

namespace cadmorph::test {
namespace {

using enum CellType;

// A prism below a tetrahedron, faces of two references, a section and quotes that are not read.
const std::string kText =
    "# by hand\n"
    "MeshVersionFormatted 2\n"
    "Dimension\n3\n"
    "Identifier \"Vertices of nothing\"\n"
    "Vertices\n7\n"
    "0 0 0 1\n1.0 0 0 1\n0 1.00e0 0 1\n0 0 1 2\n1 0 1 2\n0 1 1 2\n0 0 2 3\n"
    "Corners\n2\n1\n2\n"
    "Edges\n1\n1 2 8\n"
    "Triangles # faces\n2\n1 3 2 4\n4 5 7 -5\n"
    "Quadrilaterals\n1\n1 2 5 4 4\n"
    "Tetrahedra\n1\n4 5 6 7 2\n"
    "Prisms\n1\n1 2 3 4 5 6 1\n"
    "BoundingBox\n0 0 0 1 1 2\n"
    "End\n"
    "Vertices\n";

/// The bytes of a binary file, keyword by keyword.
class MeditBytes {
 public:
  MeditBytes(int version, bool is_big_endian) : version_(version), bytes_(is_big_endian) {
    bytes_.int32({1, version});
  }

  MeditBytes& keyword(int code, std::size_t size) {
    const std::size_t next = bytes_.bytes().size() + 4 + (version_ < 3 ? 4 : 8) + size;
    bytes_.int32({code});
    if (version_ < 3)
      bytes_.int32({int(next)});
    else
      bytes_.int64({std::int64_t(next)});
    return *this;
  }
  MeditBytes& integers(std::initializer_list<int> values) {
    for (const int value : values) {
      if (version_ < 4)
        bytes_.int32({value});
      else
        bytes_.int64({value});
    }
    return *this;
  }
  MeditBytes& vertex(double x, double y, double z, int reference) {
    if (version_ < 2)
      bytes_.float32({float(x), float(y), float(z)});
    else
      bytes_.float64({x, y, z});
    return integers({reference});
  }
  std::size_t int_size() const { return version_ < 4 ? 4 : 8; }
  std::size_t real_size() const { return version_ < 2 ? 4 : 8; }
  BinaryText& raw() { return bytes_; }

 private:
  int version_;
  BinaryText bytes_;
};

/// The mesh of kText.
std::string binary(int version, bool is_big_endian) {
  MeditBytes file(version, is_big_endian);
  const std::size_t i = file.int_size(), r = file.real_size();
  file.keyword(3, 4).raw().int32({3});
  file.keyword(4, i + 7 * (3 * r + i)).integers({7});
  file.vertex(0, 0, 0, 1).vertex(1, 0, 0, 1).vertex(0, 1, 0, 1).vertex(0, 0, 1, 2);
  file.vertex(1, 0, 1, 2).vertex(0, 1, 1, 2).vertex(0, 0, 2, 3);
  file.keyword(13, 3 * i).integers({2, 1, 2});
  file.keyword(5, 4 * i).integers({1, 1, 2, 8});
  file.keyword(6, 9 * i).integers({2, 1, 3, 2, 4, 4, 5, 7, -5});
  file.keyword(7, 6 * i).integers({1, 1, 2, 5, 4, 4});
  file.keyword(8, 6 * i).integers({1, 4, 5, 6, 7, 2});
  file.keyword(9, 8 * i).integers({1, 1, 2, 3, 4, 5, 6, 1});
  file.keyword(126, 3 * i).integers({2, 77, 78});
  file.raw().int32({54, 0});
  if (version > 2) file.raw().int32({0});
  return file.raw().bytes();
}

void require_contents(const MeshFile& file) {
  const Mesh& mesh = file.mesh();
  CHECK(file.format() == "Medit");
  CHECK(mesh.types == std::vector{Tetra, Wedge});
  CHECK(mesh.connectivity == std::vector<Index>{3, 4, 5, 6, 0, 1, 2, 3, 4, 5});
  CHECK(mesh.regions == std::vector<int>{2, 1});
  CHECK(mesh.points.row(6) == Eigen::RowVector3d(0, 0, 2));
  REQUIRE(mesh.groups.size() == 2);
  CHECK(mesh.groups[0].name == "reference 4");
  CHECK(mesh.groups[0].kind == "reference");
  CHECK(mesh.groups[0].nodes == std::vector<Index>{0, 1, 2, 3, 4});
  CHECK(mesh.groups[1].name == "reference -5");
  CHECK(mesh.groups[1].nodes == std::vector<Index>{3, 4, 6});
  CHECK(file.remarks().size() == 1);  // BoundingBox or ByteFlow
}

}  // namespace

TEST_CASE("A Medit file gives its cells and references", "[core][formats]") {
  const FormatFolder folder;
  require_contents(MeshFile(folder.put("two.mesh", kText)));
}

TEST_CASE("Binary Medit files of all versions give what text does", "[core][formats]") {
  const FormatFolder folder;
  for (const int version : {1, 2, 3, 4})
    for (const bool is_big_endian : {false, true}) {
      INFO("version " << version << (is_big_endian ? ", big endian" : ""));
      const auto path = folder.put("two.meshb", binary(version, is_big_endian));
      require_contents(MeshFile(path));
      require_promise(path, folder, "out.meshb", version == 1 ? 1e-7 : 0);
    }
}

TEST_CASE("Second-order Medit elements come in VTK's node order", "[core][formats]") {
  const FormatFolder folder;
  // As gmsh 4.8.4 writes them.
  const MeshFile file(folder.put(
      "one.mesh",
      "MeshVersionFormatted 2\nDimension 3\nVertices 10\n"
      "0 0 0 1\n1 0 0 2\n0 1 0 3\n0 0 1 4\n.5 0 0 1\n.5 .5 0 2\n0 .5 0 3\n0 0 .5 4\n.5 0 .5 5\n"
      "0 .5 .5 6\nTrianglesP2\n1\n2 3 4 6 10 9 3\nTetrahedraP2\n1\n1 3 4 2 7 10 8 5 6 9 1\nEnd\n"));
  const Mesh& mesh = file.mesh();
  REQUIRE(mesh.types == std::vector{QuadraticTetra});
  require_middles(mesh, 0);
  REQUIRE(mesh.groups.size() == 1);
  CHECK(mesh.groups[0].nodes == std::vector<Index>{1, 2, 3, 5, 8, 9});
}

TEST_CASE("A plane Medit mesh has its edges as groups", "[core][formats]") {
  const FormatFolder folder;
  const auto path = folder.put("plane.mesh",
                               "MeshVersionFormatted 1\nDimension 2\nVertices\n4\n"
                               "0 0 1\n1 0 1\n1 1 1\n0 1 1\nTriangles\n2\n1 2 3 5\n1 3 4 6\n"
                               "Edges\n2\n1 2 7\n2 3 7\nEnd\n");
  const MeshFile file(path);
  CHECK(file.mesh().types == std::vector{Triangle, Triangle});
  CHECK(file.mesh().regions == std::vector<int>{5, 6});
  REQUIRE(file.mesh().groups.size() == 1);
  CHECK(file.mesh().groups[0].name == "edge reference 7");
  CHECK(file.mesh().groups[0].nodes == std::vector<Index>{0, 1, 2});
  require_promise(path, folder, "out.mesh");
}

TEST_CASE("Medit files come back with other coordinates alone", "[core][formats]") {
  const FormatFolder folder;
  require_promise(folder.put("two.mesh", kText), folder, "out.mesh");
}

TEST_CASE("What Medit does not know is said", "[core][formats]") {
  const FormatFolder folder;
  std::string text = kText;
  text.replace(text.find("Prisms"), 6, "Prims");
  const MeshFile file(folder.put("two.mesh", text));
  REQUIRE(file.remarks().size() == 2);
  CHECK_THAT(file.remarks().front(), Catch::Contains("'Prims' is not known"));
}

TEST_CASE("Bad Medit files are refused by place", "[core][formats]") {
  const FormatFolder folder;
  const auto refused = [&](const std::string& old_text, const std::string& new_text,
                           std::initializer_list<std::string> parts) {
    std::string text = kText;
    text.replace(text.find(old_text), old_text.size(), new_text);
    require_refused(folder.put("bad.mesh", text), parts);
  };
  refused("Formatted 2", "Formatted 5", {"bad.mesh", "line 2", "version", "5"});
  refused("Vertices\n7", "Vertices\n8", {"line 15", "a coordinate", "'Corners'"});
  refused("4 5 6 7 2", "4 5 6 8 2", {"line 31", "vertex 8", "only 7"});
  refused("4 5 6 7 2", "4 5 6 0 2", {"line 31", "vertex 0"});
  refused("Prisms", "PrismsP2", {"line 32", "PrismsP2", "first order"});
  refused("Dimension\n3", "Dimension\n4", {"line 4", "dimension 4"});
  refused("Dimension\n3", "", {"vertices before the dimension"});
  // More nodes than the keyword's elements have.
  refused("4 5 6 7 2", "4 5 6 7 2 3", {"line 31", "number in place of a keyword"});
  require_refused(folder.put("bad.mesh", "MeshVersionFormatted 2\nDimension 3\nEnd\n"),
                  {"no vertices"});
  const std::string bytes = binary(2, false);
  require_refused(folder.put("bad.meshb", bytes.substr(0, 100)), {"byte 20", "cut off"});
  std::string longer = bytes;
  longer[28] = 8;  // vertices
  require_refused(folder.put("bad.meshb", longer), {"byte 20", "reach into the next"});
}

TEST_CASE("Damaged Medit files never crash the reader", "[core][formats]") {
  const FormatFolder folder;
  require_robust(folder.put("two.mesh", kText), folder);
  for (const int version : {1, 2, 3, 4})
    require_robust(folder.put("two.meshb", binary(version, version == 3)), folder);
}

}  // namespace cadmorph::test
