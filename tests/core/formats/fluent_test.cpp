#include <algorithm>
#include <bit>
#include <catch2/catch.hpp>
#include <charconv>
#include <cstring>
#include <set>

#include "core/quality.h"
#include "tests/core/formats/foam_case.h"
#include "tests/core/formats/format_checks.h"
#include "tests/core/formats/hdf5_writer.h"
#include "tests/core/sample_meshes.h"

namespace cadmorph::test {
namespace {

// Two squares; the right one was divided into an upper and a lower half, so that the edge 2-5
// between them became 2-7 and 7-5. Cell 2 is the square that was divided.
const std::string kPlane =
    "(0 \"a ) comment \\\" in quotation marks\")\n"
    "(2 2)\n"
    "(10 (0 1 8 0))\n"
    "(10 (1 1 6 1 2)(\n0 0\n1.0e+00 0\n2 0\n0 1\n1 1\n2 1))\n"
    "(10 (1 7 8 1 2)\n(\n1 .5\n2 0.5\n)\n)\n"
    "(12 (0 1 4 0 0))\n(12 (2 1 1 1 3))\n(12 (9 2 2 20 3))(12 (2 3 4 1 0)(\n3 3))\n"
    "(13 (0 1 E 0 0))\n"
    "(13 (5 1 3 2 2)(\n2 7 4 1\n7 5 3 1\n7 8 4 3))\n"
    "(13 (3 4 A 3 0)(\n2 2 1 1 0\n2 1 4 1 0\n2 4 5 1 0\n2 5 6 3 0\n2 6 8 3 0\n2 8 3 4 0\n"
    "2 3 2 4 0))\n"
    "(13 (7 B B 1f 2)(\n2 5 2 1))\n"
    "(59 (B B 7 5)(\n2 1 2))\n"
    "(37 (\n((model \"(\")) ))\n"
    "(45 (2 fluid water)())\n(39 (3 wall hull 1)((a . b)))\n(45 (5 interior inside)())\n";

/// How a Fluent file is written.
struct Style {
  int precision = 0;  ///< of its sections: 0 text, 2 single, 3 double
  bool is_big_endian = false;
  /// Faces of one size, which is told once; those on the border first, their smallest nodes first.
  bool is_from_node_1 = false;
};

class FluentWriter {
 public:
  explicit FluentWriter(const Style& style) : style_(style) {}

  std::string write(const FoamMesh& mesh, Index cells) {
    text_ = "(0 \"made by hand\")\n(2 3)\n" + declaration("10", mesh.points.rows()) +
            declaration("12", cells) + declaration("13", std::ssize(mesh.faces));
    begin("10", 1, 1, mesh.points.rows(), "1 3");
    for (Index i = 0; i < mesh.points.rows(); ++i) {
      for (int c = 0; c < 3; ++c) put(mesh.points(i, c));
      end_line();
    }
    end("10");
    text_ += "(12 (2 1 " + hex(cells) + " 1 0))\n";
    const auto add_inner = [&] { add_faces(mesh, 3, 2, 0, std::ssize(mesh.neighbour)); };
    if (!style_.is_from_node_1) add_inner();
    Index zone = 4;
    for (const FoamMesh::Patch& patch : mesh.patches)
      add_faces(mesh, zone++, 3, patch.start, patch.count);
    if (style_.is_from_node_1) add_inner();
    return text_ + "(45 (4 wall left)())\n(45 (5 wall rest)())\n";
  }

 private:
  static std::string hex(Index value) {
    char digits[16];
    return {digits, std::to_chars(digits, digits + 16, value, 16).ptr};
  }
  static std::string declaration(const std::string& section, Index count) {
    return "(" + section + " (0 1 " + hex(count) + " 0))\n";
  }
  std::string number(const std::string& section) const {
    return style_.precision == 0 ? section : std::to_string(style_.precision) + "0" + section;
  }
  void begin(const std::string& section, Index zone, Index first, Index last,
             const std::string& rest) {
    text_.append("(").append(number(section)).append(" (");
    for (const Index value : {zone, first, last}) text_.append(hex(value)).append(" ");
    text_.append(rest).append(")\n(");
  }
  void end(const std::string& section) {
    text_ +=
        style_.precision == 0 ? "))\n" : ")\nEnd of Binary Section   " + number(section) + ")\n";
  }
  void end_line() {
    if (style_.precision == 0) text_ += "\n";
  }
  template <class Number>
  void put_bytes(Number value) {
    char bytes[sizeof value];
    std::memcpy(bytes, &value, sizeof value);
    if (style_.is_big_endian != (std::endian::native == std::endian::big))
      std::reverse(bytes, bytes + sizeof value);
    text_.append(bytes, sizeof bytes);
  }
  void put(double value) {
    if (style_.precision == 2) return put_bytes(float(value));
    if (style_.precision == 3) return put_bytes(value);
    char digits[32];
    text_.append(digits, std::to_chars(digits, digits + 32, value).ptr);
    text_ += " ";
  }
  void put_integer(Index value) {
    if (style_.precision > 0) return put_bytes(std::int32_t(value));
    text_ += hex(value) + " ";
  }
  void add_faces(const FoamMesh& mesh, Index zone, Index type, Index start, Index count) {
    const std::string form = style_.is_from_node_1 ? hex(std::ssize(mesh.faces[start])) : "5";
    begin("13", zone, start + 1, start + count, hex(type) + " " + form);
    for (Index f = start; f < start + count; ++f) {
      std::vector<Index> face = mesh.faces[f];
      std::ranges::reverse(face);  // the normal points into c0
      if (style_.is_from_node_1)
        std::ranges::rotate(face, std::ranges::min_element(face));
      else
        put_integer(std::ssize(face));
      for (const Index node : face) put_integer(node + 1);
      put_integer(mesh.owner[f] + 1);
      put_integer(f < std::ssize(mesh.neighbour) ? mesh.neighbour[f] + 1 : 0);
      end_line();
    }
    end("13");
  }

  Style style_;
  std::string text_;
};

void put_hdf5(const std::filesystem::path& path, const FoamMesh& mesh, int cells,
              const Storage& storage = {}) {
  Hdf5Writer file(path);
  for (const char* group :
       {"/meshes", "/meshes/1", "/meshes/1/nodes", "/meshes/1/nodes/coords", "/meshes/1/faces",
        "/meshes/1/faces/nodes", "/meshes/1/faces/nodes/1", "/meshes/1/faces/c0",
        "/meshes/1/faces/c1", "/meshes/1/faces/zoneTopology", "/meshes/1/cells",
        "/meshes/1/cells/zoneTopology"})
    file.group(group);
  file.attribute("/meshes/1", "dimension", std::vector{3});
  file.attribute("/meshes/1", "cellCount", std::vector{cells});
  const auto add_range = [&](const std::string& object, int first, std::size_t count) {
    file.attribute(object, "minId", std::vector{first});
    file.attribute(object, "maxId", std::vector{first + int(count) - 1});
  };
  // The nodes in two parts, the second one first.
  const auto half = std::size_t(mesh.points.rows() / 2);
  const auto add_nodes = [&](const std::string& name, std::size_t begin, std::size_t count) {
    const double* values = mesh.points.data() + 3 * begin;
    Storage rows = storage;
    rows.shape = {count, 3};
    file.numbers("/meshes/1/nodes/coords/" + name, {values, values + 3 * count}, rows);
    add_range("/meshes/1/nodes/coords/" + name, int(begin) + 1, count);
  };
  add_nodes("4", half, std::size_t(mesh.points.rows()) - half);
  add_nodes("7", 0, half);
  std::vector<int> sizes, nodes, c0, c1;
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    sizes.push_back(int(mesh.faces[f].size()));
    for (auto node = mesh.faces[f].rbegin(); node != mesh.faces[f].rend(); ++node)
      nodes.push_back(int(*node) + 1);
    c0.push_back(int(mesh.owner[f]) + 1);
    if (f < mesh.neighbour.size()) c1.push_back(int(mesh.neighbour[f]) + 1);
  }
  file.integers("/meshes/1/faces/nodes/1/nnodes", sizes);
  file.integers("/meshes/1/faces/nodes/1/nodes", nodes);
  add_range("/meshes/1/faces/nodes/1", 1, sizes.size());
  file.integers("/meshes/1/faces/c0/1", c0);
  add_range("/meshes/1/faces/c0/1", 1, c0.size());
  file.integers("/meshes/1/faces/c1/1", c1);
  add_range("/meshes/1/faces/c1/1", 1, c1.size());
  const auto add_zones = [&](const std::string& what, const std::vector<std::vector<int>>& lists,
                             const std::string& names) {
    const std::string group = "/meshes/1/" + what + "/zoneTopology/";
    const char* const list_names[] = {"id", "minId", "maxId", "zoneType"};
    for (std::size_t i = 0; i < lists.size(); ++i) file.integers(group + list_names[i], lists[i]);
    file.bytes(group + "name", names);
  };
  const int inside = int(c1.size()), all = int(c0.size());
  const int left = inside + int(mesh.patches[0].count);
  add_zones("faces", {{3, 4, 5}, {1, inside + 1, left + 1}, {inside, left, all}, {2, 3, 10}},
            "interior;left;rest");
  add_zones("cells", {{2, 6}, {1, cells / 2 + 1}, {cells / 2, cells}, {1, 17}}, "air;steel");
}

using Faces = std::set<std::vector<Index>>;

Faces faces_of(const Mesh& mesh, Index cell) {
  Faces faces;
  for (Facet& facet : cell_facets(mesh, cell)) {
    std::ranges::rotate(facet.nodes, std::ranges::min_element(facet.nodes));
    faces.insert(facet.nodes);
  }
  return faces;
}

void require_cells(const Mesh& mesh, const Mesh& wanted) {
  REQUIRE(mesh.types == wanted.types);
  for (Index c = 0; c < mesh.cell_count(); ++c) REQUIRE(faces_of(mesh, c) == faces_of(wanted, c));
  CHECK(measure_quality(mesh, mesh.points, Orientation(256, 1)).inverted == 0);
}

}  // namespace

TEST_CASE("A plane Fluent file gives its cells and zones", "[core][formats]") {
  const FormatFolder folder;
  const MeshFile file(folder.put("plane.cas", kPlane));
  const Mesh& mesh = file.mesh();
  CHECK(file.format() == "Fluent");
  CHECK(mesh.types == std::vector{CellType::Polygon, CellType::Quad, CellType::Quad});
  // Counter-clockwise rings from some node on; the edge with a node in the middle has both halves.
  const auto ring = [&](Index c) {
    std::vector<Index> nodes(mesh.cell(c).begin(), mesh.cell(c).end());
    std::ranges::rotate(nodes, std::ranges::min_element(nodes));
    return nodes;
  };
  CHECK(ring(0) == std::vector<Index>{0, 1, 6, 4, 3});
  CHECK(ring(1) == std::vector<Index>{4, 6, 7, 5});
  CHECK(ring(2) == std::vector<Index>{1, 2, 7, 6});
  CHECK(mesh.points.row(6) == Eigen::RowVector3d(1, 0.5, 0));
  REQUIRE(mesh.groups.size() == 1);
  CHECK(mesh.groups[0].name == "hull");
  CHECK(mesh.groups[0].kind == "face zone (wall)");
  CHECK(mesh.groups[0].nodes == std::vector<Index>{0, 1, 2, 3, 4, 5, 7});
  require_promise(folder / "plane.cas", folder, "out.cas");
}

TEST_CASE("Fluent files in text and in bytes give the same cells", "[core][formats]") {
  for (const CellType type :
       {CellType::Tetra, CellType::Pyramid, CellType::Wedge, CellType::Hexahedron}) {
    const FormatFolder folder;
    const Mesh wanted = testing::cube(type, 2);
    const FoamMesh mesh = foam_mesh(wanted);
    const auto read = [&](const Style& style, double tolerance) {
      const auto path =
          folder.put("mesh.msh", FluentWriter(style).write(mesh, wanted.cell_count()));
      const MeshFile file(path);
      require_cells(file.mesh(), wanted);
      CHECK((file.mesh().points - wanted.points).cwiseAbs().maxCoeff() <= tolerance);
      REQUIRE(file.mesh().groups.size() == 2);
      CHECK(file.mesh().groups[0].name == "left");
      CHECK(std::ranges::all_of(file.mesh().groups[0].nodes,
                                [&](Index node) { return wanted.points(node, 0) == 0; }));
      require_promise(path, folder, "out.msh", tolerance);
    };
    constexpr double kSingle = 6e-8;  // half a digit of float32
    read({}, 0);
    read({.precision = 3}, 0);
    read({.precision = 3, .is_big_endian = true}, 0);
    read({.precision = 2}, kSingle);
    if (type == CellType::Tetra || type == CellType::Hexahedron)
      read({.precision = 3, .is_big_endian = true, .is_from_node_1 = true}, 0);
  }
}

TEST_CASE("Periodic zones of a Fluent file name their shadows", "[core][formats]") {
  const FormatFolder folder;
  const Mesh wanted = testing::cube(CellType::Hexahedron, 2);
  const std::string text = FluentWriter({}).write(foam_mesh(wanted), wanted.cell_count());
  const MeshFile plain(folder.put("plain.msh", text));
  const MeshFile file(folder.put("mesh.msh", text + "(18 (1 1 4 5)(\n 1 2\n))\n"));
  REQUIRE(file.mesh().groups.size() == 2);
  CHECK(plain.mesh().groups[0].partner.empty());
  CHECK(file.mesh().groups[0].partner == "rest");
  CHECK(file.mesh().groups[1].partner.empty());
}

TEST_CASE("Fluent's HDF5 files give cells and zones", "[core][formats]") {
  const FormatFolder folder;
  const Mesh wanted = testing::cube(CellType::Wedge, 2);
  const FoamMesh mesh = foam_mesh(wanted);
  put_hdf5(folder / "plain.msh.h5", mesh, int(wanted.cell_count()));
  put_hdf5(folder / "packed.cas.h5", mesh, int(wanted.cell_count()),
           {.shape = {}, .chunk = {4, 3}, .is_compressed = true});
  for (const char* name : {"plain.msh.h5", "packed.cas.h5"}) {
    const MeshFile file(folder / name);
    CHECK(file.format() == "Fluent HDF5");
    CHECK(file.mesh().points == wanted.points);
    require_cells(file.mesh(), wanted);
    REQUIRE(file.mesh().groups.size() == 4);
    CHECK(file.mesh().groups[1].name == "rest");
    CHECK(file.mesh().groups[1].kind == "face zone (velocity-inlet)");
    CHECK(file.mesh().groups[3].name == "steel");
    CHECK(file.mesh().regions.front() == 2);
    CHECK(file.mesh().regions.back() == 6);
    require_promise(folder / name, folder, std::string("out-") + name);
  }
  require_robust(folder / "plain.msh.h5", folder);
}

TEST_CASE("Bad Fluent files are refused by line", "[core][formats]") {
  const FormatFolder folder;
  const auto refused = [&](const std::string& old_text, const std::string& new_text,
                           std::initializer_list<std::string> parts) {
    std::string text = kPlane;
    text.replace(text.find(old_text), old_text.size(), new_text);
    INFO(new_text);
    require_refused(folder.put("bad.cas", text), parts);
  };
  refused("(2 2)", "(2 4)", {"bad.cas", "line 2", "the dimension"});
  refused("2 0\n0 1\n", "2 zero\n0 1\n", {"line 7", "a coordinate", "'zero'"});
  refused("(10 (1 1 6 1 2)", "(10 (1 1 5 1 2)", {"line 10", "')'"});
  refused("(10 (1 1 6 1 2)", "(10 (1 1 FFFFFFF 1 2)", {"line 4", "268435455 items"});
  refused("(10 (1 7 8 1 2)", "(10 (1 8 9 1 2)", {"nodes 1 to 9", "8 are listed"});
  refused("2 7 4 1\n", "2 9 4 1\n", {"node 9", "8 nodes"});
  refused("2 7 4 1\n", "2 7 5 1\n", {"cell 5", "4 cells"});
  refused("2 7 4 1\n", "2 7 x 1\n", {"line 23", "a cell of a face", "'x'"});
  refused("2 8 3 4 0", "2 8 3 3 0", {"cell 1", "no ring"});
  refused("(37 (\n((", "(37 (\n(((", {"line 38", "no end"});
}

TEST_CASE("Damaged Fluent files never crash the reader", "[core][formats]") {
  const FormatFolder folder;
  require_robust(folder.put("plane.cas", kPlane), folder);
  const Mesh cube = testing::cube(CellType::Wedge, 1);
  require_robust(folder.put("cube.msh", FluentWriter({.precision = 3}).write(foam_mesh(cube), 2)),
                 folder);
}

}  // namespace cadmorph::test
