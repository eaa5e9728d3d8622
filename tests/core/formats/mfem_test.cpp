#include <algorithm>
#include <catch2/catch.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "tests/core/formats/format_checks.h"
#include "tests/core/formats/node_order_checks.h"

namespace cadmorph::test {
namespace {

using enum CellType;

// A hexahedron, a prism beside it and a tetrahedron on the prism, in three regions.
const std::string kTopology =
    "dimension\n3\n\n"
    "# by hand\n"
    "elements\n3\n1 5 0 1 2 3 4 5 6 7\n2 6 1 8 2 5 9 6\n7 4 8 2 9 10\n\n"
    "boundary\n3\n3 3 0 1 2 3\n4 3 0 1 5 4\n4 3 1 8 9 5\n\n"
    "vertices\n11\n";

const std::string kStraight = "MFEM mesh v1.0\n\n" + kTopology +
                              "3\n0 0 0\n1.0 0 0\n1 1 0\n0 1.00e0 0\n0 0 1\n1 0 1\n1 1 1\n0 1 1\n"
                              "2 0 0\n2 0 1\n3 1 0\n";

// Twice the coordinates of the nodes of that mesh in the order of MFEM's dofs, written out by a
// program apart: continuous of order 2, discontinuous of order 1 and 2.
const std::string kOrder2 =
    "000200220020002202222022400402620100210120010102212122012001201221021300310302312401"
    "510311420511110101211121011112301311111";
const std::string kDiscontinuous1 = "000200020220002202022222200400220202402222400220402620";
const std::string kDiscontinuous2 =
    "000100200010110210020120220001101201011111211021121221002102202012112212022122222200"
    "300400210310220201301401211311221202302402212312222400310220401311402510420511620";

/// The mesh above with its nodes as a grid function of `digits` / 2.
std::string curved(const std::string& collection, const std::string& digits, bool is_by_component) {
  std::ostringstream text;
  text << "MFEM mesh v1.0\n\n"
       << kTopology << "\nnodes\nFiniteElementSpace\nFiniteElementCollection: " << collection
       << "\nVDim: 3\nOrdering: " << (is_by_component ? 0 : 1) << "\n\n";
  const std::size_t rows = digits.size() / 3;
  for (std::size_t i = 0; i < digits.size(); ++i) {
    const std::size_t place = is_by_component ? 3 * (i % rows) + i / rows : i;
    text << 0.5 * (digits[place] - '0') << (is_by_component || i % 3 == 2 ? '\n' : ' ');
  }
  return text.str();
}

void require_corners(const Mesh& mesh) {
  const MeshFile straight(FormatFolder().put("straight.mesh", kStraight));
  for (Index c = 0; c < 3; ++c) {
    const auto expected = straight.mesh().cell(c);
    for (std::size_t i = 0; i < expected.size(); ++i)
      CHECK(mesh.points.row(mesh.cell(c)[i]) == straight.mesh().points.row(expected[i]));
  }
}

void require_quadratic(const Mesh& mesh) {
  CHECK(mesh.types ==
        std::vector{TriquadraticHexahedron, BiquadraticQuadraticWedge, QuadraticTetra});
  CHECK(mesh.node_count() == 41);
  require_corners(mesh);
  for (Index c = 0; c < 3; ++c) require_middles(mesh, c);
  REQUIRE(mesh.groups.size() == 2);
  CHECK(mesh.groups[0].nodes.size() == 9);
  CHECK(mesh.groups[1].nodes.size() == 15);
  for (const Index node : mesh.groups[0].nodes) CHECK(mesh.points(node, 2) == 0);
  for (const Index node : mesh.groups[1].nodes) CHECK(mesh.points(node, 1) == 0);
}

// Three squares in a row, the last joined to the first: 4 columns of points, 3 of vertices.
const std::string kPeriodic =
    "MFEM mesh v1.0\n\ndimension\n2\n\nelements\n3\n1 3 0 1 4 3\n1 3 1 2 5 4\n1 3 2 0 3 5\n\n"
    "boundary\n1\n9 1 0 3\n\nvertices\n6\n\nnodes\nFiniteElementSpace\n"
    "FiniteElementCollection: L2_T1_2D_P1\nVDim: 2\nOrdering: 1\n"
    "0 0 1 0 0 1 1 1\n1 0 2 0 1 1 2.0 1\n2 0 3 0 2 1 3 1\n";

}  // namespace

TEST_CASE("An MFEM mesh gives its cells, attributes and boundary", "[core][formats]") {
  const FormatFolder folder;
  const MeshFile file(folder.put("straight.mesh", kStraight));
  const Mesh& mesh = file.mesh();
  CHECK(file.format() == "MFEM");
  CHECK(mesh.types == std::vector{Hexahedron, Wedge, Tetra});
  CHECK(mesh.connectivity ==
        std::vector<Index>{0, 1, 2, 3, 4, 5, 6, 7, 1, 8, 2, 5, 9, 6, 8, 2, 9, 10});
  CHECK(mesh.regions == std::vector<int>{1, 2, 7});
  REQUIRE(mesh.groups.size() == 2);
  CHECK(mesh.groups[0].name == "boundary 3");
  CHECK(mesh.groups[0].kind == "boundary attribute");
  CHECK(mesh.groups[0].nodes == std::vector<Index>{0, 1, 2, 3});
  CHECK(mesh.groups[1].nodes == std::vector<Index>{0, 1, 4, 5, 8, 9});
}

TEST_CASE("Sets of boundary attributes of an MFEM mesh are groups", "[core][formats]") {
  const FormatFolder folder;
  std::string text = kStraight;
  text.replace(text.find("v1.0"), 4, "v1.3");
  text.insert(text.find("boundary"), "attribute_sets\n1\n\"solid parts\" 2 1 2\n\n");
  text.insert(text.find("vertices\n"), "bdr_attribute_sets\n1\n\"the wall\" 2 3 4\n\n");
  text += "\nmfem_mesh_end\n";
  const MeshFile file(folder.put("sets.mesh", text));
  REQUIRE(file.mesh().groups.size() == 3);
  CHECK(file.mesh().groups[2].name == "the wall");
  CHECK(file.mesh().groups[2].nodes == std::vector<Index>{0, 1, 2, 3, 4, 5, 8, 9});
  require_promise(folder / "sets.mesh", folder, "out.mesh");
}

TEST_CASE("Curved MFEM meshes come in VTK's node order", "[core][formats]") {
  const FormatFolder folder;
  for (const bool is_by_component : {true, false})
    for (const char* name : {"H1_3D_P2", "Quadratic", "H1@U_3D_P2", "L2_T1_3D_P2"}) {
      INFO(name << (is_by_component ? ", by component" : ""));
      const bool is_discontinuous = name[0] == 'L';
      const auto path =
          folder.put("curved.mesh",
                     curved(name, is_discontinuous ? kDiscontinuous2 : kOrder2, is_by_component));
      require_quadratic(MeshFile(path).mesh());
      require_promise(path, folder, "out.mesh");
    }
}

TEST_CASE("Discontinuous MFEM nodes at one place are one node", "[core][formats]") {
  const FormatFolder folder;
  const auto path = folder.put("nodes.mesh", curved("L2_T1_3D_P1", kDiscontinuous1, false));
  const MeshFile file(path);
  CHECK(file.mesh().types == std::vector{Hexahedron, Wedge, Tetra});
  CHECK(file.mesh().node_count() == 11);
  require_corners(file.mesh());
  require_promise(path, folder, "out.mesh");
}

TEST_CASE("A periodic MFEM mesh has nodes of its own on each side", "[core][formats]") {
  const FormatFolder folder;
  const auto path = folder.put("periodic.mesh", kPeriodic);
  const MeshFile file(path);
  const Mesh& mesh = file.mesh();
  CHECK(mesh.node_count() == 8);
  for (Index c = 0; c < 3; ++c) {
    const auto cell = mesh.cell(c);
    const double x = double(c);
    CHECK(mesh.points.row(cell[0]) == Eigen::RowVector3d(x, 0, 0));
    CHECK(mesh.points.row(cell[1]) == Eigen::RowVector3d(x + 1, 0, 0));
    CHECK(mesh.points.row(cell[2]) == Eigen::RowVector3d(x + 1, 1, 0));
    CHECK(mesh.points.row(cell[3]) == Eigen::RowVector3d(x, 1, 0));
  }
  CHECK(mesh.cell(0)[1] == mesh.cell(1)[0]);
  CHECK(mesh.cell(2)[1] != mesh.cell(0)[0]);
  REQUIRE(mesh.groups.size() == 1);
  for (const Index node : mesh.groups[0].nodes)
    CHECK((mesh.points(node, 0) == 0 || mesh.points(node, 0) == 3));
  CHECK(mesh.groups[0].nodes.size() == 4);
  require_promise(path, folder, "out.mesh");

  // All copies of a node move together.
  Points moved = mesh.points;
  moved(mesh.cell(0)[1], 0) = 1.25;
  file.write(folder / "out.mesh", moved);
  std::string expected = kPeriodic;
  expected.replace(expected.find("0 0 1 0"), 7, "0 0 1.25 0");
  expected.replace(expected.find("\n1 0 2 0 "), 9, "\n1.25 0 2 0 ");
  CHECK(bytes_of(folder / "out.mesh") == expected);
}

TEST_CASE("MFEM files come back with other coordinates alone", "[core][formats]") {
  const FormatFolder folder;
  require_promise(folder.put("straight.mesh", kStraight), folder, "out.mesh");
}

TEST_CASE("Bad MFEM files are refused by line", "[core][formats]") {
  const FormatFolder folder;
  const auto refused = [&](std::string text, const std::string& old_text,
                           const std::string& new_text, std::initializer_list<std::string> parts) {
    text.replace(text.find(old_text), old_text.size(), new_text);
    require_refused(folder.put("bad.mesh", text), parts);
  };
  const std::string order_2 = curved("H1_3D_P2", kOrder2, false);
  refused(kStraight, "mesh v1.0", "NC mesh v1.0", {"bad.mesh", "line 1", "non-conforming"});
  refused(kStraight, "mesh v1.0", "NURBS mesh v1.0", {"line 1", "NURBS", "SetCurvature"});
  refused(kStraight, "mesh v1.0", "mesh v9.0", {"line 1", "MFEM mesh v9.0"});
  refused(kStraight, "vertices", "vertex_parents\n0\n\nvertices", {"hanging nodes"});
  refused(kStraight, "8 2 9 10", "8 2 9 11", {"vertex 11", "only 11"});
  refused(kStraight, "7 4 8", "7 3 8", {"line 11", "geometry type 3", "dimension 3"});
  refused(kStraight, "7 4 8", "7 9 8", {"line 11", "geometry type 9"});
  refused(kStraight, "vertices\n11", "vertices\n12", {"a coordinate", "end of the file"});
  refused(kStraight, "vertices\n11", "vertices\n99999999", {"99999999", "cut off"});
  refused(order_2, "H1_3D_P2", "L2_T1_3D_P3", {"line 24", "L2_T1_3D_P3", "SetCurvature(2)"});
  refused(order_2, "H1_3D_P2", "L2_3D_P2", {"line 24", "L2_3D_P2"});
  refused(order_2, "H1_3D_P2", "H1Pos_3D_P2", {"line 24", "H1Pos_3D_P2"});
  refused(order_2, "H1_3D_P2", "H1_3D_P1", {"more values", "11 nodes"});
  refused(curved("H1_3D_P1", kOrder2.substr(0, 33), false), "H1_3D_P1", "H1_3D_P2",
          {"41 nodes", "cut off"});
  refused(order_2, "7 4 8 2 9 10", "7 7 8 2 9 10 1", {"pyramids"});
  refused(order_2, "vertices\n11", "vertices\n9999999999", {"not in"});
}

// What a collection of third order tells beyond the corners is a number of further values.
TEST_CASE("MFEM meshes above second order are read by their corners", "[core][formats]") {
  const FormatFolder folder;
  const MeshFile second(folder.put("second.mesh", curved("H1_3D_P2", kOrder2, false)));
  const auto path = folder.put("third.mesh", curved("H1_3D_P3", kOrder2, false));
  const MeshFile third(path);
  CHECK(third.mesh().points == second.mesh().points);
  CHECK(third.mesh().cell_count() == second.mesh().cell_count());
  for (Index c = 0; c < third.mesh().cell_count(); ++c) {
    const auto corners = third.mesh().cell(c);
    CHECK(std::ranges::equal(corners, second.mesh().cell(c).first(corners.size())));
    CHECK(dimension(third.mesh().types[c]) == dimension(second.mesh().types[c]));
  }
  REQUIRE(third.remarks().size() == 1);
  CHECK_THAT(third.remarks().front(), Catch::Contains("order 3"));
  require_promise(path, folder, "out.mesh");
}

TEST_CASE("Damaged MFEM files never crash the reader", "[core][formats]") {
  const FormatFolder folder;
  require_robust(folder.put("straight.mesh", kStraight), folder);
  require_robust(folder.put("curved.mesh", curved("H1_3D_P2", kOrder2, true)), folder);
  require_robust(folder.put("nodes.mesh", curved("L2_T1_3D_P1", kDiscontinuous1, false)), folder);
  require_robust(folder.put("periodic.mesh", kPeriodic), folder);
}

}  // namespace cadmorph::test
