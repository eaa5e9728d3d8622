#include <catch2/catch.hpp>
#include <string>

#include "tests/core/formats/binary_text.h"
#include "tests/core/formats/format_checks.h"

namespace cadmorph::test {
namespace {

// A cube with a pyramid on it, a prism beside it and a tetrahedron on the prism.
const std::string kText =
    "12 1 2 1 1 1 1\n"
    "0 0 0\n 1.0 0 0\n 1 1 0\n 0 1.00e0 0\n 0 0 1\n 1 0 1\n 1 1 1\n 0 1 1\n"
    " 0.5 0.5 2\n 2 0 0\n 2 0 1\n 1.5 0.25 2\n"
    "2 10 3\n"
    "1 2 3 4  1 2 6 5\n"
    "7 3 7\n"
    "6 11 7 12\n"
    "5 8 9 6 7\n"
    "2 10 3 6 11 7\n"
    "1 2 3 4 5 6 7 8\n";

/// The same, with reals of 4 or 8 bytes, with or without the marks of Fortran's records.
std::string binary(bool is_big_endian, int real_size, bool has_records) {
  BinaryText text(is_big_endian);
  const int body = 12 * 3 * real_size + 4 * (3 + 8 + 3 + 4 + 5 + 6 + 8);
  const auto mark = [&](int size) {
    if (has_records) text.int32({size});
  };
  mark(28);
  text.int32({12, 1, 2, 1, 1, 1, 1});
  mark(28);
  mark(body);
  const auto point = [&](double x, double y, double z) {
    if (real_size == 4)
      text.float32({float(x), float(y), float(z)});
    else
      text.float64({x, y, z});
  };
  for (const double z : {0.0, 1.0}) {
    point(0, 0, z);
    point(1, 0, z);
    point(1, 1, z);
    point(0, 1, z);
  }
  point(0.5, 0.5, 2);
  point(2, 0, 0);
  point(2, 0, 1);
  point(1.5, 0.25, 2);
  text.int32({2, 10, 3, 1, 2, 3, 4, 1, 2, 6, 5, 7, 3, 7, 6, 11, 7, 12, 5, 8, 9, 6, 7});
  text.int32({2, 10, 3, 6, 11, 7, 1, 2, 3, 4, 5, 6, 7, 8});
  mark(body);
  return text.bytes();
}

void require_contents(const Mesh& mesh) {
  using enum CellType;
  CHECK(mesh.types == std::vector{Tetra, Pyramid, Wedge, Hexahedron});
  // The third node of a pyramid in the file is its tip.
  CHECK(mesh.connectivity == std::vector<Index>{5, 10, 6, 11,         //
                                                4, 5,  6, 7,  8,      //
                                                1, 9,  2, 5,  10, 6,  //
                                                0, 1,  2, 3,  4,  5, 6, 7});
  CHECK(mesh.points.row(3) == Eigen::RowVector3d(0, 1, 0));
  CHECK(mesh.points.row(11) == Eigen::RowVector3d(1.5, 0.25, 2));
  REQUIRE(mesh.groups.size() == 2);
  CHECK(mesh.groups[0].name == "surface 7");
  CHECK(mesh.groups[0].kind == "surface");
  CHECK(mesh.groups[0].nodes == std::vector<Index>{0, 1, 2, 4, 5, 9});
  CHECK(mesh.groups[1].name == "surface 3");
  CHECK(mesh.groups[1].nodes == std::vector<Index>{0, 1, 2, 3});
}

}  // namespace

TEST_CASE("A UGRID file gives its cells, and its faces as surfaces", "[core][formats]") {
  const FormatFolder folder;
  const MeshFile file(folder.put("cube.ugrid", kText));
  CHECK(file.format() == "UGRID");
  require_contents(file.mesh());
}

TEST_CASE("Binary UGRID files of all kinds give what text does", "[core][formats]") {
  const FormatFolder folder;
  for (const bool is_big_endian : {true, false})
    for (const int real_size : {4, 8})
      for (const bool has_records : {false, true}) {
        const std::string extension = std::string(is_big_endian ? "." : ".l") +
                                      (has_records ? "r" : "b") + std::to_string(real_size) +
                                      ".ugrid";
        INFO(extension);
        const std::string bytes = binary(is_big_endian, real_size, has_records);
        require_contents(MeshFile(folder.put("cube" + extension, bytes)).mesh());
        require_contents(MeshFile(folder.put("cube.ugrid", bytes)).mesh());
        require_promise(folder / ("cube" + extension), folder, "out" + extension,
                        real_size == 4 ? 1e-7 : 0);
      }
}

TEST_CASE("A UGRID file of faces alone has them as cells", "[core][formats]") {
  const FormatFolder folder;
  const MeshFile file(folder.put("faces.ugrid",
                                 "5 1 1 0 0 0 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n2 0 0\n"
                                 "2 5 3\n1 2 3 4\n1 2\n"));
  CHECK(file.mesh().types == std::vector{CellType::Triangle, CellType::Quad});
  CHECK(file.mesh().connectivity == std::vector<Index>{1, 4, 2, 0, 1, 2, 3});
  REQUIRE(file.mesh().groups.size() == 2);
  CHECK(file.mesh().groups[1].nodes == std::vector<Index>{0, 1, 2, 3});
}

TEST_CASE("UGRID files come back with other coordinates alone", "[core][formats]") {
  const FormatFolder folder;
  require_promise(folder.put("cube.ugrid", kText), folder, "out.ugrid");
  // What programs append stays.
  const std::filesystem::path longer = folder.put("long.b8.ugrid", binary(true, 8, false) + "more");
  require_promise(longer, folder, "out.b8.ugrid");
  CHECK(MeshFile(longer).remarks().size() == 1);
}

TEST_CASE("Bad UGRID files are refused by place", "[core][formats]") {
  const FormatFolder folder;
  const auto refused = [&](const std::string& old_text, const std::string& new_text,
                           std::initializer_list<std::string> parts) {
    std::string text = kText;
    text.replace(text.find(old_text), old_text.size(), new_text);
    require_refused(folder.put("bad.ugrid", text), parts);
  };
  refused("12 1 2", "13 1 2", {"bad.ugrid", "line"});
  refused("12 1 2", "99999999 1 2", {"line 1", "number of nodes", "99999999"});
  refused("2 10 3\n", "2 13 3\n", {"line 14", "node 13", "[1, 12]"});
  refused("1.5 0.25", "1.5 x", {"line 13", "a coordinate", "'x'"});
  const std::string bytes = binary(true, 8, false);
  require_refused(folder.put("bad.lb8.ugrid", bytes), {"byte 0", ".b8.ugrid"});
  require_refused(folder.put("bad.b8.ugrid", bytes.substr(0, bytes.size() - 1)),
                  {"byte 0", std::to_string(bytes.size()), "cut off"});
  require_refused(folder.put("bad.ugrid", bytes.substr(0, bytes.size() - 1)),
                  {"byte 0", "cut off"});
  std::string wrong = bytes;
  wrong[bytes.size() - 1] = 13;
  require_refused(folder.put("bad.b8.ugrid", wrong),
                  {"byte " + std::to_string(bytes.size() - 4), "node 13"});
  const std::string records = binary(true, 8, true);
  std::string parts = records + records;
  parts[36] = 1;
  require_refused(folder.put("bad.r8.ugrid", parts), {"byte 36", "record"});
}

TEST_CASE("Damaged UGRID files never crash the reader", "[core][formats]") {
  const FormatFolder folder;
  require_robust(folder.put("cube.ugrid", kText), folder);
  require_robust(folder.put("cube.b8.ugrid", binary(true, 8, false)), folder);
  require_robust(folder.put("cube.lr4.ugrid", binary(false, 4, true)), folder);
}

}  // namespace cadmorph::test
