#include <vtkCell.h>
#include <vtkGenericCell.h>
#include <vtkNew.h>

#include <Eigen/Geometry>
#include <catch2/catch.hpp>
#include <map>
#include <string>

#include "tests/core/formats/format_checks.h"
#include "tests/core/formats/hdf5_writer.h"

namespace fs = std::filesystem;

namespace cadmorph::test {
namespace {

/// Makes CGNS files as the library's HDF5 form has them.
class CgnsWriter {
 public:
  explicit CgnsWriter(const fs::path& path, int cell_dimension = 3) : out_(path) {
    mark("/", "HDF5 MotherNode", "Root Node of HDF5 File", "MT");
    node("/CGNSLibraryVersion", "CGNSLibraryVersion_t", "R4");
    out_.singles("/CGNSLibraryVersion/ data", {3.4F});
    integers("/Base", "CGNSBase_t", {cell_dimension, 3});
  }

  Hdf5Writer& file() { return out_; }

  void node(const std::string& path, const std::string& label, const std::string& type = "MT") {
    out_.group(path);
    mark(path, path.substr(path.rfind('/') + 1), label, type);
  }
  void integers(const std::string& path, const std::string& label, const std::vector<int>& values,
                std::vector<hsize_t> shape = {}) {
    node(path, label, "I4");
    out_.integers(path + "/ data", values, {.shape = std::move(shape)});
  }
  void text(const std::string& path, const std::string& label, const std::string& text) {
    node(path, label, "C1");
    out_.bytes(path + "/ data", text);
  }
  void numbers(const std::string& path, const std::vector<double>& values, Storage storage = {}) {
    node(path, "DataArray_t", "R8");
    out_.numbers(path + "/ data", values, std::move(storage));
  }

  /// A zone with its points; `sizes` as CGNS has them, (3, dimensions).
  void zone(const std::string& path, const std::string& type, const std::vector<int>& sizes,
            const Points& points, const Storage& storage = {}) {
    integers(path, "Zone_t", sizes, {3, sizes.size() / 3});
    text(path + "/ZoneType", "ZoneType_t", type);
    node(path + "/GridCoordinates", "GridCoordinates_t");
    const char* names[] = {"CoordinateX", "CoordinateY", "CoordinateZ"};
    for (int c = 0; c < 3; ++c)
      numbers(path + "/GridCoordinates/" + names[c], {points.col(c).begin(), points.col(c).end()},
              storage);
  }
  void section(const std::string& path, int type, int first, int last,
               const std::vector<int>& connectivity, const std::vector<int>& offsets = {}) {
    integers(path, "Elements_t", {type, 0});
    integers(path + "/ElementRange", "IndexRange_t", {first, last});
    integers(path + "/ElementConnectivity", "DataArray_t", connectivity);
    if (!offsets.empty()) integers(path + "/ElementStartOffset", "DataArray_t", offsets);
  }
  void condition(const std::string& path, const std::string& list, const std::vector<int>& values,
                 std::vector<hsize_t> shape, const std::string& location = "Vertex") {
    text(path, "BC_t", "BCWall");
    integers(path + "/" + list, "IndexArray_t", values, std::move(shape));
    if (location != "Vertex") text(path + "/GridLocation", "GridLocation_t", location);
  }

 private:
  void mark(const std::string& path, const std::string& name, const std::string& label,
            const std::string& type) {
    out_.attribute(path, "name", name, 33);
    out_.attribute(path, "label", label, 33);
    out_.attribute(path, "type", type, 3);
    out_.attribute(path, "flags", std::vector<int>{1});
  }

  Hdf5Writer out_;
};

/// The points of a structured zone from `origin` on, i fastest.
Points grid(const Eigen::Array3i& size, const Eigen::RowVector3d& origin) {
  Points points(size.prod(), 3);
  Index at = 0;
  for (int k = 0; k < size[2]; ++k)
    for (int j = 0; j < size[1]; ++j)
      for (int i = 0; i < size[0]; ++i)
        points.row(at++) = origin + Eigen::RowVector3d(i, j, k) * 0.7;
  return points;
}

/// Two hexahedra, a prism on top of one, with a section of boundary faces and conditions of three
/// kinds; `storage` of the coordinates.
fs::path mixed_file(const fs::path& path, const Storage& storage = {}) {
  CgnsWriter out(path);
  Points points(14, 3);
  points.topRows(12) = grid({3, 2, 2}, {0.1, 0.2, 0.3});
  points.row(12) << 0.1, 0.5, 1.7;
  points.row(13) << 0.8, 0.5, 1.7;
  out.zone("/Base/Zone", "Unstructured", {14, 3, 0}, points, storage);
  out.section("/Base/Zone/Solids", 20, 1, 3, {17, 1, 2, 5,  4,  7,  8, 11, 10, 17, 2,  3, 6,
                                              5,  8, 9, 12, 11, 14, 7, 10, 13, 8,  11, 14});
  out.section("/Base/Zone/Floor", 7, 4, 5, {1, 2, 5, 4, 2, 3, 6, 5});
  out.node("/Base/Zone/ZoneBC", "ZoneBC_t");
  out.condition("/Base/Zone/ZoneBC/corner", "PointList", {1, 4}, {2, 1});
  out.condition("/Base/Zone/ZoneBC/half floor", "PointList", {5}, {1, 1}, "FaceCenter");
  out.condition("/Base/Zone/ZoneBC/all floor", "ElementRange", {4, 5}, {2, 1});
  out.text("/Base/Zone/ZoneBC/all floor/FamilyName", "FamilyName_t", "ground");
  return path;
}

/// A wall of polyhedra: two cubes as NFACE_n, or as parents of the faces with numbers from
/// `first_parent` on.
fs::path polyhedra_file(const fs::path& path, bool has_offsets, int first_parent = 0) {
  CgnsWriter out(path);
  out.zone("/Base/Zone", "Unstructured", {12, 2, 0}, grid({3, 2, 2}, {0, 0, 0}));
  const std::vector<std::vector<int>> faces = {
      {1, 4, 10, 7},  {2, 5, 11, 8}, {3, 6, 12, 9}, {1, 2, 8, 7},   {2, 3, 9, 8},  {4, 5, 11, 10},
      {5, 6, 12, 11}, {1, 2, 5, 4},  {2, 3, 6, 5},  {7, 8, 11, 10}, {8, 9, 12, 11}};
  const auto write = [&](const std::string& name, int type, int first,
                         const std::vector<std::vector<int>>& lists) {
    std::vector<int> connectivity, offsets{0};
    for (const auto& list : lists) {
      if (!has_offsets) connectivity.push_back(int(list.size()));
      connectivity.insert(connectivity.end(), list.begin(), list.end());
      offsets.push_back(int(connectivity.size()));
    }
    if (!has_offsets) offsets.clear();
    out.section("/Base/Zone/" + name, type, first, first + int(lists.size()) - 1, connectivity,
                offsets);
  };
  write("Inner", 22, 1, {faces[1]});
  write("Left", 22, 2, {faces[0]});
  write("Rest", 22, 3, {faces.begin() + 2, faces.end()});
  if (first_parent == 0) {
    write("Cells", 23, 12, {{2, 1, 4, 6, 8, 10}, {-1, 3, 5, 7, 9, 11}});
    return path;
  }
  const int a = first_parent, b = a + 1;
  const auto parents = [&](const std::string& name, const std::vector<int>& values) {
    out.integers("/Base/Zone/" + name + "/ParentElements", "DataArray_t", values,
                 {2, values.size() / 2});
  };
  parents("Inner", {a, b});
  parents("Left", {a, 0});
  parents("Rest", {b, a, b, a, b, a, b, a, b, 0, 0, 0, 0, 0, 0, 0, 0, 0});
  return path;
}

/// Two structured zones that meet in the plane of x = 1.4, the second with its indices turned:
/// its j runs along x, its i along y backwards.
fs::path structured_file(const fs::path& path, double gap = 0, double noise = 0) {
  CgnsWriter out(path);
  const Points first = grid({3, 3, 2}, {0, 0, 0});
  out.zone("/Base/A", "Structured", {3, 3, 2, 2, 2, 1, 0, 0, 0}, first);
  Points second(12, 3);
  Index at = 0;
  for (int k = 0; k < 2; ++k)
    for (int j = 0; j < 2; ++j)
      for (int i = 0; i < 3; ++i)
        second.row(at++) << first(2, 0) + 0.7 * j + gap + noise, first(3 * (2 - i), 1),
            first(9 * k, 2);
  out.zone("/Base/B", "Structured", {3, 2, 2, 2, 1, 1, 0, 0, 0}, second);
  out.node("/Base/A/ZoneGridConnectivity", "ZoneGridConnectivity_t");
  const std::string face = "/Base/A/ZoneGridConnectivity/to B";
  out.text(face, "GridConnectivity1to1_t", "B");
  out.integers(face + "/PointRange", "IndexRange_t", {3, 1, 1, 3, 3, 2}, {2, 3});
  out.integers(face + "/PointRangeDonor", "IndexRange_t", {3, 1, 1, 1, 1, 2}, {2, 3});
  out.integers(face + "/Transform", "\"int[IndexDimension]\"", {2, -1, 3});
  for (const char* zone : {"A", "B"}) {
    out.node(std::string("/Base/") + zone + "/ZoneBC", "ZoneBC_t");
    out.condition(
        std::string("/Base/") + zone + "/ZoneBC/floor", "PointRange",
        zone[0] == 'A' ? std::vector<int>{1, 1, 1, 3, 3, 1} : std::vector<int>{1, 1, 1, 2, 1, 1},
        {2, 3}, zone[0] == 'A' ? "Vertex" : "KFaceCenter");
  }
  return path;
}

const NodeGroup& group(const Mesh& mesh, const std::string& name) {
  for (const NodeGroup& group : mesh.groups)
    if (group.name == name) return group;
  FAIL("no group " << name);
  return mesh.groups.front();
}

using Nodes = std::vector<Index>;

}  // namespace

TEST_CASE("A CGNS file gives its cells, conditions and sections", "[core][formats]") {
  const FormatFolder folder;
  const MeshFile file(mixed_file(folder / "mixed.cgns"));
  const Mesh& mesh = file.mesh();
  CHECK(file.format() == "CGNS");
  CHECK(mesh.types == std::vector{CellType::Hexahedron, CellType::Hexahedron, CellType::Wedge});
  CHECK(mesh.connectivity ==
        Nodes{0, 1, 4, 3, 6, 7, 10, 9, 1, 2, 5, 4, 7, 8, 11, 10, 6, 9, 12, 7, 10, 13});
  CHECK(mesh.points.row(13) == Eigen::RowVector3d(0.8, 0.5, 1.7));
  CHECK(mesh.groups.size() == 5);
  CHECK(group(mesh, "corner").nodes == Nodes{0, 3});
  CHECK(group(mesh, "corner").kind == "boundary condition");
  CHECK(group(mesh, "half floor").nodes == Nodes{1, 2, 4, 5});
  CHECK(group(mesh, "all floor").nodes == Nodes{0, 1, 2, 3, 4, 5});
  CHECK(group(mesh, "ground").kind == "family");
  CHECK(group(mesh, "Floor").nodes == Nodes{0, 1, 2, 3, 4, 5});
  CHECK(group(mesh, "Floor").kind == "section");
  CHECK(mesh.regions.empty());
}

TEST_CASE("CGNS elements of second order are in VTK's order", "[core][formats]") {
  // The nodes that follow the corners, as the SIDS has them: the corners whose mean they are.
  using Means = std::vector<std::vector<int>>;
  const Means bottom = {{1, 2}, {2, 3}, {3, 4}, {4, 1}};
  const Means hexahedron = {{1, 2}, {2, 3}, {3, 4}, {4, 1}, {1, 5}, {2, 6},
                            {3, 7}, {4, 8}, {5, 6}, {6, 7}, {7, 8}, {8, 5}};
  Means full_hexahedron = hexahedron;
  for (const auto& face : Means{{1, 4, 3, 2},
                                {1, 2, 6, 5},
                                {2, 3, 7, 6},
                                {3, 4, 8, 7},
                                {1, 5, 8, 4},
                                {5, 6, 7, 8},
                                {1, 2, 3, 4, 5, 6, 7, 8}})
    full_hexahedron.push_back(face);
  const Means prism = {{1, 2}, {2, 3}, {3, 1}, {1, 4}, {2, 5}, {3, 6}, {4, 5}, {5, 6}, {6, 4}};
  Means full_prism = prism;
  for (const auto& face : Means{{1, 2, 5, 4}, {2, 3, 6, 5}, {3, 1, 4, 6}})
    full_prism.push_back(face);
  const Means pyramid = {{1, 2}, {2, 3}, {3, 4}, {4, 1}, {1, 5}, {2, 5}, {3, 5}, {4, 5}};
  Means full_pyramid = pyramid;
  full_pyramid.push_back({1, 2, 3, 4});
  Means full_quad = bottom;
  full_quad.push_back({1, 2, 3, 4});
  struct Kind {
    int number, corners;
    CellType type;
    Means means;
  };
  const Kind kind = GENERATE_COPY(
      Kind{6, 3, CellType::QuadraticTriangle, {{1, 2}, {2, 3}, {3, 1}}},
      Kind{8, 4, CellType::QuadraticQuad, bottom}, Kind{9, 4, CellType::BiquadraticQuad, full_quad},
      Kind{11, 4, CellType::QuadraticTetra, {{1, 2}, {2, 3}, {3, 1}, {1, 4}, {2, 4}, {3, 4}}},
      Kind{21, 5, CellType::QuadraticPyramid, pyramid},
      Kind{13, 5, CellType::BiquadraticQuadraticPyramid, full_pyramid},
      Kind{15, 6, CellType::QuadraticWedge, prism},
      Kind{16, 6, CellType::BiquadraticQuadraticWedge, full_prism},
      Kind{18, 8, CellType::QuadraticHexahedron, hexahedron},
      Kind{19, 8, CellType::TriquadraticHexahedron, full_hexahedron});
  INFO("element type " << kind.number);
  const bool has_middle = kind.type == CellType::BiquadraticQuadraticPyramid;  // which VTK has not
  const CellType of_vtk = has_middle ? CellType::QuadraticPyramid : kind.type;
  vtkNew<vtkGenericCell> cell;
  cell->SetCellType(int(of_vtk));
  const double* parametric = cell->GetParametricCoords();
  Points expected = Eigen::Map<const Points>(parametric, cell->GetNumberOfPoints(), 3);
  if (of_vtk == CellType::QuadraticPyramid)  // its parametric domain is collapsed at the apex
    for (int i = 0; i < 4; ++i) expected.row(9 + i) = (expected.row(i) + expected.row(4)) / 2;
  if (has_middle) {
    expected.conservativeResize(14, 3);
    expected.row(13) = expected.topRows(4).colwise().mean();
  }
  Points points(kind.corners + std::ssize(kind.means), 3);
  points.topRows(kind.corners) = expected.topRows(kind.corners);
  std::vector<int> nodes;
  for (Index i = 0; i < std::ssize(kind.means); ++i) {
    points.row(kind.corners + i).setZero();
    for (const int corner : kind.means[std::size_t(i)])
      points.row(kind.corners + i) +=
          points.row(corner - 1) / double(kind.means[std::size_t(i)].size());
  }
  for (int n = 1; n <= points.rows(); ++n) nodes.push_back(n);
  const FormatFolder folder;
  {
    CgnsWriter out(folder / "one.cgns", dimension(kind.type));
    out.zone("/Base/Zone", "Unstructured", {int(points.rows()), 1, 0}, points);
    out.section("/Base/Zone/Cells", kind.number, 1, 1, nodes);
  }
  const MeshFile file(folder / "one.cgns");
  const Mesh& mesh = file.mesh();
  REQUIRE(mesh.types == std::vector{kind.type});
  REQUIRE(std::ssize(mesh.cell(0)) == expected.rows());
  for (Index i = 0; i < expected.rows(); ++i) {
    INFO("node " << i << " of the cell");
    CHECK((mesh.points.row(mesh.cell(0)[std::size_t(i)]) - expected.row(i)).norm() < 1e-12);
  }
}

TEST_CASE("CGNS polyhedra have the faces of NGON_n", "[core][formats]") {
  const FormatFolder folder;
  const bool has_offsets = GENERATE(false, true);
  const int first_parent = GENERATE(0, 1, 12);  // 0: the cells are NFACE_n
  const MeshFile file(polyhedra_file(folder / "poly.cgns", has_offsets, first_parent));
  const Mesh& mesh = file.mesh();
  CHECK(mesh.types == std::vector{CellType::Polyhedron, CellType::Polyhedron});
  const auto facets = cell_facets(mesh, 1);
  REQUIRE(facets.size() == 6);
  CHECK(facets[0].nodes == Nodes{7, 10, 4, 1});  // of negative number: reversed
  CHECK(facets[1].nodes == Nodes{2, 5, 11, 8});
  // The face between the cells is no boundary, and the faces of Rest are.
  REQUIRE(mesh.groups.size() == 2);
  CHECK(mesh.groups[0].name == "Left");
  CHECK(mesh.groups[0].nodes == Nodes{0, 3, 6, 9});
  CHECK(mesh.groups[1].name == "Rest");
}

TEST_CASE("The second parent of a CGNS face sees its other side", "[core][formats]") {
  const FormatFolder folder;
  const Points points = grid({2, 2, 2}, {0, 0, 0});
  // The last face has its normal inwards, and the cell is its second parent.
  const std::vector<int> faces = {4, 1, 3, 4, 2, 4, 5, 6, 8, 7, 4, 1, 2, 6, 5,
                                  4, 3, 7, 8, 4, 4, 1, 5, 7, 3, 4, 2, 6, 8, 4};
  const auto write = [&](const std::vector<int>& parents, int cells = 1) {
    const fs::path path = folder / "cube.cgns";
    CgnsWriter out(path);
    out.zone("/Base/Zone", "Unstructured", {8, cells, 0}, points);
    out.section("/Base/Zone/Faces", 22, 1, 6, faces);
    out.integers("/Base/Zone/Faces/ParentElements", "DataArray_t", parents,
                 {2, parents.size() / 2});
    return path;
  };
  const MeshFile file(write({7, 7, 7, 7, 7, 0, 0, 0, 0, 0, 0, 7}));
  const auto facets = cell_facets(file.mesh(), 0);
  REQUIRE(facets.size() == 6);
  for (const auto& facet : facets) {
    const Points corners = file.mesh().points(facet.nodes, Eigen::all);
    const Eigen::RowVector3d u = corners.row(1) - corners.row(0),
                             v = corners.row(2) - corners.row(1);
    const Eigen::RowVector3d out = corners.colwise().mean() - points.colwise().mean();
    CHECK(u.cross(v).dot(out) > 0);
  }
  require_refused(write({7, 7, 7, 7, 7, 0, 0, 0, 0, 0, 0, 8}),
                  {"/Base/Zone'", "name 2 cells", "has 1"});
  require_refused(write({7, 7, 7, 7, 7, 7}), {"ParentElements", "6 numbers for 6 faces"});
}

TEST_CASE("Structured CGNS zones are joined where their interfaces say", "[core][formats]") {
  const FormatFolder folder;
  const double noise = GENERATE(0, 1e-9);
  const auto path = structured_file(folder / "zones.cgns", 0, noise);
  const MeshFile file(path);
  const Mesh& mesh = file.mesh();
  CHECK(mesh.node_count() == 18 + 6);
  CHECK(mesh.cell_count() == 4 + 2);
  CHECK(mesh.regions == std::vector<int>{1, 1, 1, 1, 2, 2});
  CHECK(mesh.zone_of_block == std::map<int, int>{{1, 0}, {2, 0}});
  CHECK(mesh.region_array == "zone");
  CHECK(group(mesh, "floor").nodes.size() == 9 + 3);
  CHECK(file.remarks().empty());
  // A node of both zones gets the same bits in both.
  Points moved = mesh.points;
  const Index shared = 2;
  CHECK(mesh.points.row(shared) == Eigen::RowVector3d(1.4, 0, 0));
  moved.row(shared) << 1 / 3., 1 / 7., 1 / 11.;
  file.write(folder / "out.cgns", moved);
  const MeshFile copy(folder / "out.cgns");
  CHECK(copy.mesh().node_count() == mesh.node_count());
  CHECK(copy.mesh().points.row(shared) == moved.row(shared));
}

TEST_CASE("Interfaces of CGNS zones that lie apart are not joined", "[core][formats]") {
  const FormatFolder folder;
  const MeshFile file(structured_file(folder / "periodic.cgns", 5));
  CHECK(file.mesh().node_count() == 18 + 12);
  REQUIRE(file.remarks().size() == 1);
  CHECK_THAT(file.remarks()[0], Catch::Contains("'to B'") && Catch::Contains("apart"));
}

TEST_CASE("CGNS files come back with other coordinates alone", "[core][formats]") {
  const FormatFolder folder;
  require_promise(mixed_file(folder / "mixed.cgns"), folder, "out.cgns");
  require_promise(mixed_file(folder / "chunks.cgns", {.shape = {14}, .chunk = {4}}), folder,
                  "out.cgns");
  require_promise(
      mixed_file(folder / "deflate.cgns", {.shape = {14}, .chunk = {4}, .is_compressed = true}),
      folder, "out.cgns");
  constexpr double kSingle = 1e-7;  // float32 keeps 24 bits
  require_promise(mixed_file(folder / "single.cgns", {.shape = {14}, .type = H5T_IEEE_F32LE}),
                  folder, "out.cgns", kSingle);
  require_promise(polyhedra_file(folder / "poly.cgns", true), folder, "out.cgns");
  require_promise(structured_file(folder / "zones.cgns"), folder, "out.cgns");
}

TEST_CASE("Bad CGNS files are refused by node", "[core][formats]") {
  const FormatFolder folder;
  const fs::path path = folder / "bad.cgns";
  const Points points = grid({2, 2, 2}, {0, 0, 0});
  const auto refused = [&](const auto& write, std::initializer_list<std::string> parts) {
    {
      CgnsWriter out(path);
      write(out);
    }
    require_refused(path, parts);
  };
  const auto with_section = [&](int type, int first, int last, const std::vector<int>& nodes) {
    return [=, &points](CgnsWriter& out) {
      out.zone("/Base/Zone", "Unstructured", {8, 1, 0}, points);
      out.section("/Base/Zone/Cells", type, first, last, nodes);
    };
  };
  refused([](CgnsWriter&) {}, {"bad.cgns", "no base", "zone"});
  refused(with_section(17, 1, 1, {1, 2, 4, 3, 5, 6, 8, 9}), {"/Base/Zone/Cells", "node 9"});
  refused(with_section(17, 1, 2, {1, 2, 4, 3, 5, 6, 8, 7}), {"/Base/Zone/Cells", "8 numbers"});
  refused(with_section(17, 1, 2000000000, {1, 2, 4, 3, 5, 6, 8, 7}), {"2000000000 elements"});
  refused(with_section(39, 1, 1, {1, 2, 4, 3}), {"element type 39"});
  refused(with_section(20, 1, 1, {40, 2, 4, 3}), {"element type 40"});
  refused(with_section(20, 1, 1, {10, 2, 4, 3}), {"/Base/Zone/Cells", "4 numbers"});
  refused(with_section(23, 1, 1, {4, 2, 4, 3, 1}), {"polyhedron 1", "face 2"});
  refused(
      [&](CgnsWriter& out) {
        out.zone("/Base/Zone", "Unstructured", {9, 1, 0}, points);
      },
      {"CoordinateX", "8 numbers", "9 vertices"});
  refused(
      [&](CgnsWriter& out) {
        out.zone("/Base/Zone", "Unstructured", {8, 1, 0}, points);
        out.numbers("/Base/Zone/GridCoordinates/CoordinateTheta", std::vector<double>(8));
      },
      {"CoordinateTheta", "Cartesian"});
  refused(
      [&](CgnsWriter& out) {
        out.zone("/Base/Zone", "Unstructured", {8, 1, 0}, points);
        out.integers("/Other", "CGNSBase_t", {3, 3});
        out.zone("/Other/Zone", "Unstructured", {8, 1, 0}, points);
      },
      {"2 bases", "Base, Other"});
  refused(
      [&](CgnsWriter& out) {
        out.node("/Base/Zone", "Zone_t", "LK");
        out.file().bytes("/Base/Zone/ file", "grid.cgns");
      },
      {"/Base/Zone", "link to another file"});
}

TEST_CASE("Damaged CGNS files never crash the reader", "[core][formats]") {
  const FormatFolder folder;
  require_robust(mixed_file(folder / "mixed.cgns"), folder);
  require_robust(structured_file(folder / "zones.cgns"), folder);
  require_robust(polyhedra_file(folder / "poly.cgns", false), folder);
  require_robust(polyhedra_file(folder / "parents.cgns", false, 12), folder);
}

}  // namespace cadmorph::test
