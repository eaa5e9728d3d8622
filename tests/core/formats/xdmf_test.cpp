#include <catch2/catch.hpp>
#include <string>

#include "tests/core/formats/format_checks.h"
#include "tests/core/formats/hdf5_writer.h"

namespace fs = std::filesystem;

namespace cadmorph::test {
namespace {

const std::string kPoints = "0 0 0  1 0 0\n 1 1 0\t0 1.0e0 0\n 0.5 0.5 1 0.5 0.5 -1.25";
// A pyramid, a tetrahedron, a triangle, a line and a vertex.
const std::string kMixed = "7 0 1 2 3 4  6 0 1 2 5  4 0 1 5  2 2 3 4  1 1 5";

std::string item(const std::string& format, const std::string& text) {
  return "<DataItem Format=\"" + format + "\" Dimensions=\"6 3\">\n" + text + "\n</DataItem>";
}

std::string xml(const std::string& geometry, const std::string& topology,
                const std::string& type = "Mixed") {
  return "<?xml version=\"1.0\"?>\n<Xdmf Version=\"3.0\">\n<Domain>\n<Grid Name=\"a\">\n"
         "<Topology TopologyType=\"" +
         type + "\">\n" + topology + "</Topology>\n<Geometry GeometryType=\"XYZ\">\n" + geometry +
         "\n</Geometry>\n<!-- kept -->\n</Grid>\n</Domain>\n</Xdmf>\n";
}

fs::path inline_file(const FormatFolder& folder) {
  return folder.put("inline.xdmf", xml(item("XML", kPoints), item("XML", kMixed)));
}

/// Points and topology in one HDF5 file.
fs::path heavy_file(const FormatFolder& folder, const Storage& storage = {.shape = {6, 3}}) {
  {
    Hdf5Writer out(folder / "heavy.h5");
    out.numbers("/points", {0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0, .5, .5, 1, .5, .5, -1.25}, storage);
    out.integers("/cells", {0, 1, 2, 4, 0, 2, 3, 4, 0, 1, 2, 5}, {.shape = {3, 4}});
  }
  return folder.put("heavy.xdmf", xml(item("HDF", "heavy.h5:/points"),
                                      item("HDF", " heavy.h5:/cells"), "Tetrahedron"));
}

}  // namespace

TEST_CASE("An XDMF file gives its cells", "[core][formats]") {
  const FormatFolder folder;
  const MeshFile light(inline_file(folder));
  CHECK(light.format() == "XDMF");
  CHECK(light.mesh().types == std::vector{CellType::Pyramid, CellType::Tetra, CellType::Triangle,
                                          CellType::Line, CellType::Vertex});
  CHECK(light.mesh().connectivity ==
        std::vector<Index>{0, 1, 2, 3, 4, 0, 1, 2, 5, 0, 1, 5, 3, 4, 5});
  CHECK(light.mesh().points.row(5) == Eigen::RowVector3d(0.5, 0.5, -1.25));
  const MeshFile heavy(heavy_file(folder));
  CHECK(heavy.mesh().types == std::vector(3, CellType::Tetra));
  CHECK(heavy.mesh().points == light.mesh().points);
}

TEST_CASE("XDMF files come back with other coordinates alone", "[core][formats]") {
  const FormatFolder folder;
  fs::create_directory(folder / "copy");
  fs::create_directory(folder / "back-copy");
  require_promise(inline_file(folder), folder, "copy/out.xdmf");
  // By the same name in another folder the HDF5 file keeps its name, and the XML its bytes.
  const fs::path heavy = heavy_file(folder);
  require_promise(heavy, folder, "copy/heavy.xdmf");
  MeshFile(heavy).write(folder / "copy/heavy.xdmf", MeshFile(heavy).mesh().points);
  CHECK(bytes_of(folder / "copy/heavy.h5") == bytes_of(folder / "heavy.h5"));
  require_promise(heavy_file(folder, {.shape = {6, 3}, .chunk = {4, 3}, .is_compressed = true}),
                  folder, "copy/heavy.xdmf");
}

TEST_CASE("XDMF copies in one folder have an HDF5 file each", "[core][formats]") {
  const FormatFolder folder;
  const MeshFile file(heavy_file(folder));
  fs::create_directory(folder / "copies");
  const Points a = affine(file.mesh().points), b = 2 * a;
  file.write(folder / "copies/a.xdmf", a);
  file.write(folder / "copies/b.xdmf", b);
  CHECK(MeshFile(folder / "copies/a.xdmf").mesh().points == a);
  CHECK(MeshFile(folder / "copies/b.xdmf").mesh().points == b);
  file.write(folder / "copies/a.xdmf", b);  // in place of the one before
  CHECK(MeshFile(folder / "copies/a.xdmf").mesh().points == b);
  const std::string foreign = folder.put("copies/c.h5", "of somebody else");
  REQUIRE_THROWS_WITH(file.write(folder / "copies/c.xdmf", a),
                      Catch::Contains("c.h5") && Catch::Contains("there already"));
  CHECK(bytes_of(foreign) == "of somebody else");
  CHECK(!fs::exists(folder / "copies/c.xdmf"));
}

TEST_CASE("Beside the original an XDMF copy has its own HDF5 file", "[core][formats]") {
  const FormatFolder folder;
  const MeshFile file(heavy_file(folder));
  const std::string original = bytes_of(folder / "heavy.h5");
  const Points moved = affine(file.mesh().points);
  file.write(folder / "moved.xdmf", moved);
  CHECK(bytes_of(folder / "heavy.h5") == original);
  CHECK(MeshFile(folder / "moved.xdmf").mesh().points == moved);
  std::string expected = bytes_of(folder / "heavy.xdmf");
  for (const char* name : {"heavy.h5:/cells", "heavy.h5:/points"})
    expected.replace(expected.find(name), 8, "moved.h5");
  CHECK(bytes_of(folder / "moved.xdmf") == expected);
  // In place of the original, its HDF5 file changes too.
  file.write(folder / "heavy.xdmf", moved);
  CHECK(MeshFile(folder / "heavy.xdmf").mesh().points == moved);
  // Never over an HDF5 file of another.
  fs::rename(folder / "heavy.xdmf", folder / "other.xdmf");
  const std::string before = bytes_of(folder / "heavy.h5");
  const MeshFile other(folder / "other.xdmf");
  other.write(folder / "heavy.xdmf", file.mesh().points);
  CHECK(bytes_of(folder / "heavy.h5") == before);
  CHECK(MeshFile(folder / "heavy.xdmf").mesh().points == file.mesh().points);
}

TEST_CASE("Bad XDMF files are refused by line", "[core][formats]") {
  const FormatFolder folder;
  const auto refused = [&](const std::string& text, std::initializer_list<std::string> parts) {
    require_refused(folder.put("bad.xdmf", text), parts);
  };
  const std::string points = item("XML", kPoints);
  refused(xml(points, item("XML", "7 0 1 2 3 6")), {"bad.xdmf", "node 6", "6 points"});
  refused(xml(points, item("XML", "16 0 1 2 3 6")), {"element type 16", "position 0"});
  refused(xml(points, item("XML", "7 0 1 2")), {"position 0", "more nodes than follow"});
  refused(xml(points, item("XML", "7 0 a 2")), {"line 7", "'a'"});
  refused(xml(points, item("XML", "0 1 2"), "3DRectMesh"), {"3drectmesh", "not known"});
  refused(xml(item("Binary", "points.bin"), item("XML", kMixed)), {"binary", "HDF or XML"});
  refused(xml(item("XML", "1 2 3 4"), item("XML", kMixed)), {"4 numbers"});
  refused(xml(item("HDF", "none.h5:/points"), item("XML", kMixed)),
          {"bad.xdmf", "none.h5", "No such file"});
  refused(xml(item("HDF", "none.h5"), item("XML", kMixed)), {"FILE:/DATASET", "none.h5"});
  refused("<Xdmf><Domain><Grid/><Grid/></Domain></Xdmf>", {"one Grid", "found 2"});
  refused("<Xdmf><Domain>", {"XML is damaged"});
}

TEST_CASE("Damaged XDMF files never crash the reader", "[core][formats]") {
  const FormatFolder folder;
  require_robust(inline_file(folder), folder);
  require_robust(heavy_file(folder), folder);
}

}  // namespace cadmorph::test
