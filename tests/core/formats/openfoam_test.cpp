#include <algorithm>
#include <catch2/catch.hpp>
#include <set>

#include "core/errors.h"
#include "core/quality.h"
#include "tests/core/formats/foam_case.h"
#include "tests/core/formats/format_checks.h"
#include "tests/core/sample_meshes.h"

namespace fs = std::filesystem;

namespace cadmorph::test {
namespace {

const std::string kMesh = "case/constant/polyMesh";

std::string header(const std::string& foam_class, const std::string& rest) {
  return "FoamFile { version 2.0; format ascii; class " + foam_class + "; }\n" + rest;
}

// A cube below two tetrahedra, for which its upper face is cut in two: a polyhedron of 7 faces.
const std::string kPoints =
    header("vectorField",
           "// nine points\n9 (\n(0 0 0) (1 0 0) (1 1 0) (0 1 0)\n"
           "(0 0 1.0e0)(1 0 1)/* top */(1 1 1) (+0 1 1)\n( .5 0.5 2 )\n)\n");
const std::string kFaces = header(
    "faceList",
    "10\n(\n3(4 5 6) 3(4 6 7) 3(4 6 8)\n4(0 3 2 1) 4(0 1 5 4) 4(1 2 6 5) 4(2 3 7 6) 4{3 0 4 7}\n"
    "3(4 5 8) 3(5 6 8) 3(6 7 8) 3(7 4 8)\n)\n");

void put_polyhedron(const FormatFolder& folder) {
  std::string faces = kFaces;
  faces.replace(faces.find("10\n"), 3, "12\n");
  faces.replace(faces.find("4{3 0 4 7}"), 10, "4(3 0 4 7)");
  folder.put(kMesh + "/points", kPoints);
  folder.put(kMesh + "/faces", faces);
  folder.put(kMesh + "/owner", header("labelList", "12(0 0 2 0 0 0 0 0 1 1 2 2)\n"));
  folder.put(kMesh + "/neighbour", header("labelList", "3(1 2 1)"));
  folder.put(kMesh + "/boundary",
             header("polyBoundaryMesh",
                    "2(floor { type wall; nFaces 1; startFace 3; }\n"
                    "\"outside (all)\" { type symmetry; inGroups 1(symmetry); nFaces 8; startFace "
                    "4; })"));
  folder.put(kMesh + "/pointZones",
             header("regIOobject", "1(tip { type pointZone; pointLabels List<label> 1{8}; })"));
  folder.put(kMesh + "/faceZones",
             header("regIOobject",
                    "1(lid { type faceZone; faceLabels List<label> 2(0 1); flipMap List<bool> "
                    "2{0}; })"));
}

using Faces = std::set<std::vector<Index>>;

/// The faces of a cell, each turned to begin with its lowest node.
Faces faces_of(const Mesh& mesh, Index cell) {
  Faces faces;
  for (Facet& facet : cell_facets(mesh, cell)) {
    std::ranges::rotate(facet.nodes, std::ranges::min_element(facet.nodes));
    faces.insert(facet.nodes);
  }
  return faces;
}

/// A cube of blocks with a zone for each half.
FoamMesh blocks() {
  FoamMesh mesh = foam_mesh(testing::cube(CellType::Hexahedron, 3));
  mesh.points = testing::shaken(mesh.points, 0.05, 7);
  mesh.cell_zones.resize(2);
  for (Index c = 0; c < 27; ++c) mesh.cell_zones[c < 12 ? 0 : 1].push_back(c);
  return mesh;
}

/// Three pieces of the blocks that meet along edges, too.
std::vector<int> block_processors() {
  std::vector<int> processors;
  for (int c = 0; c < 27; ++c) processors.push_back(c % 3 == 0 ? 0 : c % 9 < 5 ? 1 : 2);
  return processors;
}

std::vector<FoamMesh> put_pieces(const FormatFolder& folder, const std::string& name,
                                 const FoamMesh& mesh, const FoamStyle& style = {}) {
  std::vector<FoamMesh> pieces = decomposed(mesh, block_processors());
  for (std::size_t p = 0; p < pieces.size(); ++p)
    put_foam_mesh(folder, name + "/processor" + std::to_string(p) + "/constant/polyMesh", pieces[p],
                  style);
  return pieces;
}

void forget_addressing(const FormatFolder& folder, const std::string& name) {
  for (const auto& entry : fs::recursive_directory_iterator(folder / name))
    if (entry.path().filename().string().ends_with("ProcAddressing")) fs::remove(entry.path());
}

}  // namespace

TEST_CASE("An OpenFOAM mesh gives its cells, patches and zones", "[core][formats]") {
  const FormatFolder folder;
  put_polyhedron(folder);
  const MeshFile file(folder / "case");
  const Mesh& mesh = file.mesh();
  CHECK(file.format() == "OpenFOAM");
  CHECK(file.mesh().is_of_finite_volumes);
  CHECK(mesh.types == std::vector{CellType::Polyhedron, CellType::Tetra, CellType::Tetra});
  CHECK(faces_of(mesh, 0) == Faces{{4, 5, 6},
                                   {4, 6, 7},
                                   {0, 3, 2, 1},
                                   {0, 1, 5, 4},
                                   {1, 2, 6, 5},
                                   {2, 3, 7, 6},
                                   {0, 4, 7, 3}});
  CHECK(faces_of(mesh, 1) == Faces{{4, 6, 5}, {4, 8, 6}, {4, 5, 8}, {5, 6, 8}});
  CHECK(mesh.points.row(8) == Eigen::RowVector3d(0.5, 0.5, 2));
  REQUIRE(mesh.groups.size() == 4);
  CHECK(mesh.groups[0].name == "floor");
  CHECK(mesh.groups[0].kind == "patch (wall)");
  CHECK(mesh.groups[0].nodes == std::vector<Index>{0, 1, 2, 3});
  CHECK(mesh.groups[1].name == "outside (all)");
  CHECK(mesh.groups[1].nodes.size() == 9);
  CHECK(mesh.groups[2].kind == "faceZone");
  CHECK(mesh.groups[2].nodes == std::vector<Index>{4, 5, 6, 7});
  CHECK(mesh.groups[3].kind == "pointZone");
  CHECK(mesh.groups[3].nodes == std::vector<Index>{8});
  CHECK(mesh.regions.empty());
}

TEST_CASE("Cyclic patches of OpenFOAM name each other", "[core][formats]") {
  const FormatFolder folder;
  FoamMesh mesh = blocks();
  mesh.patches[0].type = "cyclic";
  mesh.patches[0].more = "  neighbourPatch rest;\n";
  mesh.patches[1].type = "cyclicAMI";
  mesh.patches[1].more = "  neighbourPatch left;\n";
  put_foam_mesh(folder, kMesh, mesh);
  const MeshFile file(folder / "case");
  REQUIRE(file.mesh().groups.size() >= 2);
  CHECK(file.mesh().groups[0].kind == "patch (cyclic)");
  CHECK(file.mesh().groups[0].partner == "rest");
  CHECK(file.mesh().groups[1].partner.empty());
}

TEST_CASE("Cells of OpenFOAM come in VTK's node order", "[core][formats]") {
  for (const CellType type :
       {CellType::Tetra, CellType::Pyramid, CellType::Wedge, CellType::Hexahedron}) {
    const FormatFolder folder;
    Mesh wanted = testing::cube(type, 2);
    put_foam_mesh(folder, kMesh, foam_mesh(wanted));
    const MeshFile file(folder / "case");
    const Mesh& mesh = file.mesh();
    REQUIRE(mesh.types == wanted.types);
    CHECK(mesh.points == wanted.points);
    for (Index c = 0; c < mesh.cell_count(); ++c) REQUIRE(faces_of(mesh, c) == faces_of(wanted, c));
    const Orientation as_vtk(256, 1);
    CHECK(measure_quality(mesh, mesh.points, as_vtk).inverted == 0);
  }
}

TEST_CASE("OpenFOAM cases come back with other points alone", "[core][formats]") {
  const FormatFolder folder;
  put_polyhedron(folder);
  folder.put("case/system/controlDict", "application none;\n");
  folder.put("case/0/U", "uniform (0 0 0)");
  for (const char* given : {"case", "case/constant", "case/constant/polyMesh"})
    require_promise(folder / given, folder, std::string("out-") + fs::path(given).stem().string());
}

TEST_CASE("OpenFOAM's binary files come back in their own kind of numbers", "[core][formats]") {
  const FormatFolder folder;
  const auto promise = [&](const FoamStyle& style, const std::string& name, double tolerance) {
    put_foam_mesh(folder, name + "/constant/polyMesh", blocks(), style);
    require_promise(folder / name, folder, name + "-out", tolerance);
    const MeshFile file(folder / name);
    CHECK((file.mesh().points - blocks().points).cwiseAbs().maxCoeff() <= tolerance);
    CHECK(file.mesh().region_array == "cellZone");
    CHECK(std::ranges::count(file.mesh().regions, 1) == 12);
    CHECK(std::ranges::count(file.mesh().regions, 2) == 15);
  };
  constexpr double kSingle = 6e-8;  // half a digit of float32
  promise({}, "ascii", 0);
  promise({.is_binary = true}, "usual", 0);
  promise({.is_binary = true, .label_bits = 64}, "long", 0);
  promise({.is_binary = true, .scalar_bits = 32}, "single", kSingle);
  promise({.is_binary = true, .is_big_endian = true}, "big-endian", 0);
  promise({.is_compressed = true}, "compressed", 0);
  promise({.is_binary = true, .label_bits = 64, .is_compressed = true}, "both", 0);
}

TEST_CASE("Binary files of OpenFOAM without an architecture have the usual one",
          "[core][formats]") {
  const FormatFolder folder;
  put_foam_mesh(folder, kMesh, blocks(), {.is_binary = true});
  for (const auto& entry : fs::directory_iterator(folder / kMesh)) {
    std::string text = bytes_of(entry.path());
    const std::size_t at = text.find("    arch");
    text.erase(at, text.find('\n', at) + 1 - at);
    folder.put(kMesh + "/" + entry.path().filename().string(), text);
  }
  const MeshFile file(folder / "case");
  CHECK(file.mesh().points == blocks().points);
}

TEST_CASE("Zones of cells that leave some out are no regions", "[core][formats]") {
  const FormatFolder folder;
  FoamMesh mesh = blocks();
  mesh.cell_zones.pop_back();
  put_foam_mesh(folder, kMesh, mesh);
  const MeshFile file(folder / "case");
  CHECK(file.mesh().regions.empty());
  CHECK(file.mesh().groups.back().kind == "cellZone");
  CHECK(file.mesh().groups.back().nodes.size() == 32 + 8);  // nine blocks, then three
}

TEST_CASE("A decomposed case is the whole mesh to the last bit", "[core][formats]") {
  const FormatFolder folder;
  const FoamMesh whole = blocks();
  const FoamStyle style = GENERATE(FoamStyle{}, FoamStyle{.is_binary = true});
  put_foam_mesh(folder, "whole/constant/polyMesh", whole, style);
  const auto pieces = put_pieces(folder, "case", whole, style);
  put_pieces(folder, "both", whole, style);
  put_foam_mesh(folder, "both/constant/polyMesh", whole, style);

  const MeshFile one(folder / "whole");
  const Points moved = affine(one.mesh().points);
  for (const std::string name : {"case", "both"}) {
    require_promise(folder / name, folder, name + "-out");
    const MeshFile file(folder / name);
    REQUIRE(file.mesh().points == one.mesh().points);
    require_same_contents(file.mesh(), one.mesh());
    file.write(folder / "moved", moved);
    for (std::size_t p = 0; p < pieces.size(); ++p) {
      const MeshFile piece(folder / ("moved/processor" + std::to_string(p)));
      const std::vector<Index>& rows = pieces[p].point_addressing;
      REQUIRE(piece.mesh().node_count() == std::ssize(rows));
      for (std::size_t i = 0; i < rows.size(); ++i)
        REQUIRE(piece.mesh().points.row(Index(i)) == moved.row(rows[i]));
    }
    fs::remove_all(folder / "moved");
  }
}

TEST_CASE("One piece of a decomposed case is a mesh", "[core][formats]") {
  const FormatFolder folder;
  const auto pieces = put_pieces(folder, "case", blocks());
  const MeshFile file(folder / "case/processor1");
  CHECK(file.mesh().cell_count() == std::ssize(pieces[1].cell_addressing));
  CHECK(file.mesh().groups[2].name == "procBoundary1to0");
  CHECK(file.mesh().groups[2].kind == "patch (processor)");
  require_promise(folder / "case/processor1", folder, "out");
}

TEST_CASE("Pieces without addressing are joined at their processor patches", "[core][formats]") {
  const FormatFolder folder;
  const FoamMesh whole = blocks();
  const auto pieces = put_pieces(folder, "case", whole);
  forget_addressing(folder, "case");
  require_promise(folder / "case", folder, "case-out");
  const MeshFile file(folder / "case");
  const Mesh& mesh = file.mesh();
  CHECK_THAT(file.remarks().front(), Catch::Contains("processor patches"));
  CHECK(mesh.node_count() == whole.points.rows());
  CHECK(mesh.types == std::vector(27, CellType::Hexahedron));
  CHECK(foam_mesh(mesh).neighbour.size() == whole.neighbour.size());  // faces shared by two
  CHECK(mesh.groups.size() == 4);
  file.write(folder / "moved", affine(mesh.points));
  const Points moved = affine(whole.points);
  constexpr double kSum = 1e-14;  // of three products
  for (std::size_t p = 0; p < pieces.size(); ++p) {
    const MeshFile piece(folder / ("moved/processor" + std::to_string(p)));
    for (Index i = 0; i < piece.mesh().node_count(); ++i)
      CHECK((piece.mesh().points.row(i) - moved.row(pieces[p].point_addressing[i])).norm() < kSum);
  }
}

TEST_CASE("Pieces that do not fit together are refused", "[core][formats]") {
  const FormatFolder folder;
  const FoamMesh whole = blocks();
  put_pieces(folder, "case", whole);
  SECTION("one is missing") {
    fs::remove_all(folder / "case/processor1");
    require_refused(folder / "case", {"case", "processor1 is missing", "processor2"});
  }
  SECTION("the last is missing") {
    fs::remove_all(folder / "case/processor2");
    require_refused(folder / "case", {"case", "a folder is missing, or of another mesh"});
    forget_addressing(folder, "case");
    require_refused(folder / "case", {"processor0", "procBoundary0to2", "no other side"});
  }
  SECTION("one is of another mesh") {
    FoamMesh other = whole;
    other.points.col(2) *= 2;
    put_foam_mesh(folder, "case/processor2/constant/polyMesh",
                  decomposed(other, block_processors())[2]);
    require_refused(folder / "case", {"disagree about point", "decompose it anew"});
    forget_addressing(folder, "case");
    require_refused(folder / "case", {"procBoundary0to2", "does not lie on its other side"});
  }
  SECTION("they are not of the whole mesh") {
    FoamMesh other = whole;
    other.points.col(2) *= 2;
    put_foam_mesh(folder, kMesh, other);
    require_refused(folder / "case", {"processor", "up to", "decompose the case anew"});
    fs::remove_all(folder / kMesh);
    put_polyhedron(folder);
    require_refused(folder / "case", {"processor", "is not in the whole mesh"});
    forget_addressing(folder, "case");
    require_refused(folder / "case", {"processor0", "no pointProcAddressing"});
  }
  SECTION("they are in the collated form") {
    fs::remove_all(folder / "case");
    fs::create_directories(folder / "case/processors3/constant/polyMesh");
    require_refused(folder / "case", {"processors3", "collated", "-fileHandler uncollated"});
  }
}

TEST_CASE("The user is told what in a case stays that of the base", "[core][formats]") {
  const FormatFolder folder;
  put_polyhedron(folder);
  for (const char* name : {"0/U", "0.5/U", "10/U", "2/polyMesh/points"})
    folder.put(std::string("case/") + name, "none");
  fs::create_directories(folder / "case/processors3/constant/polyMesh");
  const MeshFile file(folder / "case");
  REQUIRE(file.remarks().size() == 3);
  CHECK_THAT(file.remarks()[0], Catch::Contains("processors3"));
  CHECK_THAT(file.remarks()[1], Catch::Contains("times 0.5, 2, 10 "));
  CHECK_THAT(file.remarks()[2], Catch::Contains("times 2 have a polyMesh"));
}

TEST_CASE("Bad OpenFOAM files are refused by file and line", "[core][formats]") {
  const FormatFolder folder;
  const auto refused = [&](const std::string& file, const std::string& old_text,
                           const std::string& new_text, std::initializer_list<std::string> parts) {
    put_polyhedron(folder);
    std::string text = bytes_of(folder / (kMesh + "/" + file));
    text.replace(text.find(old_text), old_text.size(), new_text);
    folder.put(kMesh + "/" + file, text);
    INFO(file << ": " << new_text);
    require_refused(folder / "case", parts);
  };
  refused("points", "FoamFile", "Foam", {"polyMesh/points", "line 1", "FoamFile"});
  refused("points", "ascii", "text", {"points", "line 1", "'text'", "ascii", "binary"});
  refused("points", "(1 1 0)", "(1 1)", {"points", "line 4", "a coordinate", "')'"});
  refused("points", "(1 1 0)", "(1 1 0 0)", {"points", "line 4", "')'", "three coordinates"});
  refused("points", "9 (", "8 (", {"points", "line 6", "')' after 8 points"});
  refused("points", "9 (", "999999999999 (", {"points", "line 3", "999999999999", "bytes follow"});
  refused("points", "/* top */", "/* top", {"points", "line 5", "'/*' has no end"});
  refused("faces", "4(0 1 5 4)", "4(0 1 5 9)", {"faces", "line 5", "node 9", "[0, 8]"});
  refused("faces", "3(4 5 6)", "2(4 5)", {"faces", "line 4", "face 0", "fewer than 3"});
  refused("faces", "4(0 1 5 4)", "4(0 1 5)", {"faces", "line 5", "node"});
  refused("owner", "12(0", "11(0", {"owner", "line 2", "')'", "owner cells"});
  refused("owner", "12(0", "13(0", {"owner", "line 2", "13, more than 12"});
  refused("owner", "12(0 0", "12(0 -1", {"owner", "line 2", "-1"});
  refused("owner", "1 1 2 2", "1 1 2 9", {"polyMesh", "cell 2 has 3 faces"});
  refused("boundary", "nFaces 8", "nFaces 9", {"boundary", "outside (all)", "12 faces"});
  refused("boundary", "nFaces 8", "#include", {"boundary", "line 3", "#include"});
  refused("boundary", "nFaces 8;", "", {"boundary", "nFaces"});
  refused("pointZones", "1{8}", "1{9}", {"pointZones", "line 2", "9", "[0, 8]"});
  put_polyhedron(folder);
  fs::remove(folder / (kMesh + "/neighbour"));
  require_refused(folder / "case", {"polyMesh", "'neighbour' is missing"});
  fs::create_directories(folder / "regions/constant/air/polyMesh");
  fs::create_directories(folder / "regions/constant/solid/polyMesh");
  require_refused(folder / "regions", {"regions", "constant/air constant/solid"});
}

TEST_CASE("Damaged OpenFOAM files never crash the reader", "[core][formats]") {
  const FormatFolder folder;
  put_polyhedron(folder);
  put_foam_mesh(folder, "binary/constant/polyMesh", blocks(), {.is_binary = true});
  put_pieces(folder, "pieces", blocks());
  for (const std::string file : {"points", "faces", "owner", "neighbour", "boundary"}) {
    require_robust_folder(folder / "case", "constant/polyMesh/" + file, folder);
    require_robust_folder(folder / "binary", "constant/polyMesh/" + file, folder);
    require_robust_folder(folder / "pieces", "processor1/constant/polyMesh/" + file, folder);
  }
  require_robust_folder(folder / "case", "constant/polyMesh/faceZones", folder);
  require_robust_folder(folder / "binary", "constant/polyMesh/cellZones", folder);
  for (const std::string item : {"point", "face", "cell"})
    require_robust_folder(folder / "pieces",
                          "processor1/constant/polyMesh/" + item + "ProcAddressing", folder);
}

TEST_CASE("A copy of a case replaces an earlier one and nothing else", "[core][formats]") {
  const FormatFolder folder;
  put_polyhedron(folder);
  const MeshFile file(folder / "case");
  const Points points = file.mesh().points;
  const auto refused = [&](const fs::path& target, const std::string& why) {
    INFO(target);
    REQUIRE_THROWS_WITH(file.write(target, points), Catch::Contains(why));
  };
  const std::string base = tree_of(folder / "case");
  refused(folder / "case", "it is the mesh read");
  refused(folder / "case/", "it is the mesh read");
  refused(folder / "case/out", "inside");
  refused(folder / "", "inside");
  folder.put("letters/letter", "Dear reader\n");
  refused(folder / "letters", "no case of OpenFOAM");
  folder.put("letter", "Dear reader\n");
  refused(folder / "letter", "a file of that name");
  file.write(folder / "out", affine(points));
  file.write(folder / "out", points);
  CHECK(tree_of(folder / "out") == base);
  folder.put("out/0.1/U", "results");
  refused(folder / "out", "0.1");
  CHECK(bytes_of(folder / "out/0.1/U") == "results");
  CHECK(tree_of(folder / "case") == base);
  for (const auto& entry : fs::directory_iterator(folder / ""))
    CHECK_THAT(entry.path().string(), !Catch::Contains(".tmp"));
}

TEST_CASE("Links in a case stay links, but never to the mesh of the base", "[core][formats]") {
  const FormatFolder folder;
  put_polyhedron(folder);
  fs::rename(folder / "case/constant/polyMesh", folder / "mesh");
  fs::create_directory_symlink("../../mesh", folder / "case/constant/polyMesh");
  folder.put("shared/scheme", "upwind");
  folder.put("case/system/solver", "fast");
  fs::create_symlink("../../shared/scheme", folder / "case/system/outside");
  fs::create_symlink("solver", folder / "case/system/inside");
  fs::create_symlink("nowhere", folder / "case/broken");
  const std::string base = bytes_of(folder / "mesh/points");
  const MeshFile file(folder / "case");
  fs::create_directories(folder / "deep/er");
  file.write(folder / "deep/er/out", affine(file.mesh().points));
  const fs::path out = folder / "deep/er/out";
  CHECK(bytes_of(folder / "mesh/points") == base);
  CHECK(!fs::is_symlink(out / "constant/polyMesh"));
  CHECK(MeshFile(out).mesh().points == affine(file.mesh().points));
  CHECK(fs::read_symlink(out / "system/inside") == "solver");
  CHECK(fs::read_symlink(out / "broken") == "nowhere");
  CHECK(fs::is_symlink(out / "system/outside"));
  CHECK(bytes_of(out / "system/outside") == "upwind");
}

}  // namespace cadmorph::test
