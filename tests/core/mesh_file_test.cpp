#include "core/mesh_file.h"

#include <sys/resource.h>
#include <unistd.h>
#include <vtkCellArray.h>
#include <vtkCellData.h>
#include <vtkDoubleArray.h>
#include <vtkFieldData.h>
#include <vtkFloatArray.h>
#include <vtkIdTypeArray.h>
#include <vtkIntArray.h>
#include <vtkNew.h>
#include <vtkPointData.h>
#include <vtkShortArray.h>
#include <vtkSignedCharArray.h>
#include <vtkSmartPointer.h>
#include <vtkStringArray.h>
#include <vtkTypeInt64Array.h>
#include <vtkTypeUInt64Array.h>
#include <vtkUnsignedCharArray.h>
#include <vtkUnstructuredGrid.h>
#include <vtkUnstructuredGridReader.h>
#include <vtkUnstructuredGridWriter.h>
#include <vtkVariant.h>
#include <vtkXMLUnstructuredGridReader.h>
#include <vtkXMLUnstructuredGridWriter.h>

#include <catch2/catch.hpp>
#include <csignal>
#include <fstream>
#include <limits>
#include <random>
#include <sstream>

#include "core/cell_topology.h"
#include "core/errors.h"
#include "sample_meshes.h"

namespace fs = std::filesystem;
using namespace cadmorph;
using namespace cadmorph::testing;

namespace {

/// A folder that goes with the test.
class Folder {
 public:
  Folder() {
    std::string name = (fs::temp_directory_path() / "cadmorph-XXXXXX").string();
    path_ = mkdtemp(name.data());
  }
  ~Folder() { fs::remove_all(path_); }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;

  fs::path operator/(const std::string& name) const { return path_ / name; }
  const fs::path& path() const { return path_; }
  Index file_count() const {
    return std::distance(fs::directory_iterator(path_), fs::directory_iterator());
  }

 private:
  fs::path path_;
};

std::string contents(const fs::path& path) {
  std::ifstream stream(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

void put(const fs::path& path, const std::string& text) {
  std::ofstream(path, std::ios::binary) << text;
}

using Grid = vtkSmartPointer<vtkUnstructuredGrid>;

template <class Array, class Value>
vtkSmartPointer<Array> array(const char* name, int components, Index tuples, Value value) {
  auto result = vtkSmartPointer<Array>::New();
  result->SetName(name);
  result->SetNumberOfComponents(components);
  result->SetNumberOfTuples(tuples);
  for (Index i = 0; i < tuples * components; ++i) result->SetValue(i, value(i));
  return result;
}

/// Arrays of many types, names and uses, on points, cells and the whole.
void add_exotic_arrays(vtkUnstructuredGrid* grid, bool is_legacy) {
  const Index points = grid->GetNumberOfPoints(), cells = grid->GetNumberOfCells();
  vtkPointData* at_points = grid->GetPointData();
  vtkCellData* at_cells = grid->GetCellData();
  at_cells->AddArray(array<vtkIntArray>("CellEntityIds", 1, cells, [](Index i) { return i % 3; }));
  at_points->AddArray(
      array<vtkSignedCharArray>("tiny, signed", 1, points, [](Index i) { return i % 256 - 128; }));
  at_cells->AddArray(array<vtkTypeUInt64Array>("huge", 1, cells, [](Index i) {
    return std::numeric_limits<std::uint64_t>::max() - static_cast<std::uint64_t>(i);
  }));
  at_cells->AddArray(array<vtkShortArray>("pairs", 2, cells, [](Index i) { return -i; }));
  at_points->AddArray(
      array<vtkFloatArray>("single", 1, points, [](Index i) { return 0.1f * float(i); }));
  auto stress = array<vtkDoubleArray>("stress", 6, points, [](Index i) { return i / 3.0; });
  for (int i = 0; i < 6; ++i) stress->SetComponentName(i, ("s" + std::to_string(i)).c_str());
  at_points->AddArray(stress);
  auto velocity = array<vtkDoubleArray>("velocity", 3, points, [](Index i) { return 1e-300 * i; });
  at_points->SetVectors(velocity);
  at_points->SetGlobalIds(
      array<vtkIdTypeArray>("ids", 1, points, [](Index i) { return 1000000007 * i; }));
  at_cells->SetScalars(
      array<vtkDoubleArray>("pressure", 1, cells, [](Index i) { return std::sqrt(double(i)); }));
  at_cells->AddArray(array<vtkUnsignedCharArray>("vtkGhostType", 1, cells,
                                                 [](Index i) { return i % 5 == 0 ? 1 : 0; }));
  vtkFieldData* field = grid->GetFieldData();
  field->AddArray(array<vtkDoubleArray>("TimeValue", 1, 1, [](Index) { return 0.1; }));
  const auto text = [](Index i) { return vtkStdString(i % 2 ? "two words" : "<&\">"); };
  field->AddArray(array<vtkStringArray>("notes", 1, 3, text));
  if (!is_legacy) at_cells->AddArray(array<vtkStringArray>("labels", 1, cells, text));
}

/// A mixed mesh (tetrahedra, quadratic tetrahedra, a wedge, shells, a line; optionally a
/// polyhedron) with everything attached that a file may hold.
Grid exotic_grid(int point_type, bool has_polyhedron, bool is_legacy = false) {
  auto grid = Grid::New();
  const Mesh base = cube(CellType::QuadraticTetra, 2);
  vtkNew<vtkPoints> points;
  points->SetDataType(point_type);
  const Points positions = shaken(base.points, 0.01, 7);
  for (Index n = 0; n < positions.rows(); ++n) points->InsertNextPoint(positions.row(n).data());
  grid->SetPoints(points);
  grid->AllocateEstimate(base.cell_count() + 10, 10);
  const auto insert = [&](int type, const std::vector<vtkIdType>& ids) {
    grid->InsertNextCell(type, std::ssize(ids), ids.data());
  };
  for (Index c = 0; c < base.cell_count(); ++c) {
    const auto cell = base.cell(c);
    if (c % 2)
      insert(VTK_TETRA, {cell.begin(), cell.begin() + 4});
    else
      insert(VTK_QUADRATIC_TETRA, {cell.begin(), cell.end()});
  }
  insert(VTK_WEDGE, {0, 1, 2, 3, 4, 5});
  insert(VTK_TRIANGLE, {3, 5, 7});
  insert(VTK_POLYGON, {3, 5, 7, 9, 11});
  insert(VTK_LINE, {0, 1});
  insert(VTK_VERTEX, {4});
  if (has_polyhedron) {
    const std::vector<vtkIdType> faces = {3, 0, 1, 2, 3, 0, 2, 3, 3, 0, 3, 1, 3, 1, 3, 2};
    grid->InsertNextCell(VTK_POLYHEDRON, 4, faces.data());
  }
  add_exotic_arrays(grid, is_legacy);
  return grid;
}

struct Encoding {
  const char* name;
  int mode, compressor, header;
  bool is_base64;
};

const Encoding kEncodings[] = {
    {"ascii", vtkXMLWriter::Ascii, vtkXMLWriter::NONE, vtkXMLWriter::UInt32, false},
    {"binary", vtkXMLWriter::Binary, vtkXMLWriter::NONE, vtkXMLWriter::UInt32, false},
    {"binary zlib", vtkXMLWriter::Binary, vtkXMLWriter::ZLIB, vtkXMLWriter::UInt64, false},
    {"appended raw", vtkXMLWriter::Appended, vtkXMLWriter::NONE, vtkXMLWriter::UInt64, false},
    {"appended base64", vtkXMLWriter::Appended, vtkXMLWriter::NONE, vtkXMLWriter::UInt32, true},
    {"appended lz4", vtkXMLWriter::Appended, vtkXMLWriter::LZ4, vtkXMLWriter::UInt32, false},
    {"appended lzma", vtkXMLWriter::Appended, vtkXMLWriter::LZMA, vtkXMLWriter::UInt64, true},
    {"appended zlib", vtkXMLWriter::Appended, vtkXMLWriter::ZLIB, vtkXMLWriter::UInt32, false}};

void write_vtu(const fs::path& path, vtkUnstructuredGrid* grid, const Encoding& encoding) {
  vtkNew<vtkXMLUnstructuredGridWriter> writer;
  writer->SetInputData(grid);
  writer->SetFileName(path.c_str());
  writer->SetDataMode(encoding.mode);
  writer->SetCompressorType(encoding.compressor);
  writer->SetHeaderType(encoding.header);
  writer->SetEncodeAppendedData(encoding.is_base64);
  REQUIRE(writer->Write() == 1);
}

Grid read_vtu(const fs::path& path) {
  vtkNew<vtkXMLUnstructuredGridReader> reader;
  reader->SetFileName(path.c_str());
  reader->Update();
  return reader->GetOutput();
}

Grid read_vtk(const fs::path& path) {
  vtkNew<vtkUnstructuredGridReader> reader;
  reader->SetFileName(path.c_str());
  reader->ReadAllScalarsOn();
  reader->ReadAllVectorsOn();
  reader->ReadAllFieldsOn();
  reader->Update();
  return reader->GetOutput();
}

/// Text of a file's format marks: first tag, encoding of the points, of the appended data.
std::string marks(const fs::path& path) {
  const std::string text = contents(path);
  const auto tag = [&](const std::string& opening, std::size_t from = 0) {
    const auto begin = text.find(opening, from);
    return begin == std::string::npos ? std::string()
                                      : text.substr(begin, text.find('>', begin) - begin);
  };
  const auto points = text.find("<Points>");
  const std::string array = tag("<DataArray", points);
  const auto format = array.find("format=");
  return tag("<VTKFile") + array.substr(format, array.find(' ', format) - format) +
         tag("<AppendedData");
}

void require_same(vtkAbstractArray* a, vtkAbstractArray* b) {
  REQUIRE(std::string(a->GetName()) == b->GetName());
  CAPTURE(a->GetName());
  REQUIRE(a->GetDataTypeAsString() == std::string(b->GetDataTypeAsString()));
  REQUIRE(a->GetNumberOfComponents() == b->GetNumberOfComponents());
  REQUIRE(a->GetNumberOfTuples() == b->GetNumberOfTuples());
  REQUIRE(a->HasAComponentName() == b->HasAComponentName());
  if (a->HasAComponentName())
    for (int i = 0; i < a->GetNumberOfComponents(); ++i)
      REQUIRE(std::string(a->GetComponentName(i)) == b->GetComponentName(i));
  for (vtkIdType i = 0; i < a->GetNumberOfValues(); ++i)
    if (a->GetVariantValue(i) != b->GetVariantValue(i))
      FAIL("value " << i << ": " << a->GetVariantValue(i) << " is not " << b->GetVariantValue(i));
}

void require_same(vtkFieldData* a, vtkFieldData* b) {
  REQUIRE(a->GetNumberOfArrays() == b->GetNumberOfArrays());
  for (int i = 0; i < a->GetNumberOfArrays(); ++i)
    require_same(a->GetAbstractArray(i), b->GetAbstractArray(i));
}

void require_same_roles(vtkDataSetAttributes* a, vtkDataSetAttributes* b) {
  for (int role = 0; role < vtkDataSetAttributes::NUM_ATTRIBUTES; ++role) {
    const auto name = [&](vtkDataSetAttributes* data) {
      vtkAbstractArray* array = data->GetAbstractAttribute(role);
      return array ? std::string(array->GetName()) : std::string();
    };
    CAPTURE(vtkDataSetAttributes::GetAttributeTypeAsString(role));
    REQUIRE(name(a) == name(b));
  }
}

/// Everything but the coordinates.
void require_same(vtkUnstructuredGrid* a, vtkUnstructuredGrid* b) {
  REQUIRE(a->GetNumberOfPoints() == b->GetNumberOfPoints());
  REQUIRE(a->GetNumberOfCells() == b->GetNumberOfCells());
  vtkNew<vtkIdList> ids_a, ids_b;
  for (vtkIdType c = 0; c < a->GetNumberOfCells(); ++c) {
    REQUIRE(a->GetCellType(c) == b->GetCellType(c));
    a->GetFaceStream(c, ids_a);
    b->GetFaceStream(c, ids_b);
    REQUIRE(std::vector<vtkIdType>(ids_a->begin(), ids_a->end()) ==
            std::vector<vtkIdType>(ids_b->begin(), ids_b->end()));
  }
  require_same(a->GetPointData(), b->GetPointData());
  require_same(a->GetCellData(), b->GetCellData());
  require_same(a->GetFieldData(), b->GetFieldData());
  require_same_roles(a->GetPointData(), b->GetPointData());
  require_same_roles(a->GetCellData(), b->GetCellData());
}

/// Coordinates that need all of a double's digits.
Points awkward_points(Index count) {
  Points points = Points::Random(count, 3);
  points(0, 0) = 0.1;
  points(0, 1) = 1.0 / 3;
  points(0, 2) = std::nextafter(1.0, 2.0);
  points(1, 0) = 1e-310;
  points(1, 1) = -1e150;
  return points;
}

void require_points(vtkUnstructuredGrid* grid, const Points& points) {
  REQUIRE(grid->GetPoints()->GetDataType() == VTK_DOUBLE);
  REQUIRE(grid->GetNumberOfPoints() == points.rows());
  for (Index n = 0; n < points.rows(); ++n)
    for (int i = 0; i < 3; ++i) REQUIRE(grid->GetPoint(n)[i] == points(n, i));
}

/// Sets the largest size of a file that this process may write, while it lives.
class FileSizeLimit {
 public:
  explicit FileSizeLimit(rlim_t bytes) : handler_(std::signal(SIGXFSZ, SIG_IGN)) {
    getrlimit(RLIMIT_FSIZE, &before_);
    rlimit limit = before_;
    limit.rlim_cur = bytes;
    setrlimit(RLIMIT_FSIZE, &limit);
  }
  ~FileSizeLimit() {
    setrlimit(RLIMIT_FSIZE, &before_);
    std::signal(SIGXFSZ, handler_);
  }

 private:
  rlimit before_{};
  void (*handler_)(int);
};

void require_io_error(const fs::path& path, const std::string& text) {
  REQUIRE_THROWS_AS(MeshFile(path), IoError);
  REQUIRE_THROWS_WITH(MeshFile(path), Catch::Contains(path.filename().string()));
  REQUIRE_THROWS_WITH(MeshFile(path), Catch::Contains(text));
}

}  // namespace

TEST_CASE("a .vtu keeps all but its coordinates, in its own encoding", "[core][mesh_file]") {
  const Folder folder;
  for (const Encoding& encoding : kEncodings)
    for (const int point_type : {VTK_FLOAT, VTK_DOUBLE}) {
      CAPTURE(encoding.name, point_type);
      const Grid grid = exotic_grid(point_type, true);
      write_vtu(folder / "in.vtu", grid, encoding);
      const MeshFile file(folder / "in.vtu");
      const Points points = awkward_points(grid->GetNumberOfPoints());
      file.write(folder / "out.vtu", points);
      const Grid result = read_vtu(folder / "out.vtu");
      require_points(result, points);
      require_same(grid, result);
      REQUIRE(marks(folder / "out.vtu") == marks(folder / "in.vtu"));
      REQUIRE(folder.file_count() == 2);
      file.write(folder / "again.vtu", points);
      REQUIRE(contents(folder / "again.vtu") == contents(folder / "out.vtu"));
      fs::remove(folder / "again.vtu");
    }
}

TEST_CASE("a legacy .vtk keeps all but its coordinates", "[core][mesh_file]") {
  const Folder folder;
  for (const int type : {VTK_ASCII, VTK_BINARY})  // ascii is written as binary, for its digits
    for (const auto version : {vtkDataWriter::VTK_LEGACY_READER_VERSION_4_2,
                               vtkDataWriter::VTK_LEGACY_READER_VERSION_5_1}) {
      CAPTURE(type, static_cast<int>(version));
      const Grid grid = exotic_grid(VTK_DOUBLE, false, true);
      vtkNew<vtkUnstructuredGridWriter> writer;
      writer->SetInputData(grid);
      writer->SetFileType(type);
      writer->SetFileVersion(version);
      writer->SetFileName((folder / "in.vtk").c_str());
      REQUIRE(writer->Write() == 1);
      const MeshFile file(folder / "in.vtk");
      const Points points = awkward_points(grid->GetNumberOfPoints());
      file.write(folder / "out.vtk", points);
      const Grid result = read_vtk(folder / "out.vtk");
      require_points(result, points);
      require_same(read_vtk(folder / "in.vtk"), result);
      const auto version_line = [&](const char* name) {
        return contents(folder / name).substr(0, 26);
      };
      REQUIRE(version_line("out.vtk") == version_line("in.vtk"));
    }
}

TEST_CASE("the mesh has the file's nodes, cells and faces of polyhedra", "[core][mesh_file]") {
  const Folder folder;
  for (const int point_type : {VTK_FLOAT, VTK_DOUBLE}) {
    const Grid grid = exotic_grid(point_type, true);
    write_vtu(folder / "in.vtu", grid, kEncodings[3]);
    const MeshFile file(folder / "in.vtu");
    const Mesh& mesh = file.mesh();
    REQUIRE(file.path() == folder / "in.vtu");
    for (Index n = 0; n < mesh.node_count(); ++n)
      for (int i = 0; i < 3; ++i) REQUIRE(mesh.points(n, i) == grid->GetPoint(n)[i]);
    REQUIRE(mesh.cell_count() == grid->GetNumberOfCells());
    vtkNew<vtkIdList> ids;
    for (Index c = 0; c < mesh.cell_count(); ++c) {
      REQUIRE(static_cast<int>(mesh.types[c]) == grid->GetCellType(c));
      grid->GetCellPoints(c, ids);
      REQUIRE(std::equal(ids->begin(), ids->end(), mesh.cell(c).begin(), mesh.cell(c).end()));
    }
    REQUIRE(mesh.polyhedron_faces ==
            std::vector<Index>{3, 0, 1, 2, 3, 0, 2, 3, 3, 0, 3, 1, 3, 1, 3, 2});
    REQUIRE(mesh.polyhedron_offsets[mesh.cell_count() - 1] == 0);
    REQUIRE(mesh.region_array == "CellEntityIds");
    REQUIRE(mesh.region(4) == 1);
  }
}

TEST_CASE("a mesh of each cell type survives writing and reading", "[core][mesh_file]") {
  const Folder folder;
  for (CellType type : solid_types()) {
    CAPTURE(static_cast<int>(type));
    Mesh mesh = cube(type, 2);
    set_regions_by_x(mesh, 0.5);
    mesh.region_array = "MaterialIds";
    for (const char* name : {"mesh.vtu", "mesh.vtk"}) {
      write_mesh(folder / name, mesh);
      if (const auto of_vtk = as_vtk_has_it(mesh)) mesh = *of_vtk;
      const MeshFile file(folder / name);
      REQUIRE(file.mesh().points == mesh.points);
      REQUIRE(file.mesh().types == mesh.types);
      REQUIRE(file.mesh().offsets == mesh.offsets);
      // VTK's legacy format has but the faces of a polyhedron.
      if (type != CellType::Polyhedron || file.path().extension() == ".vtu")
        REQUIRE(file.mesh().connectivity == mesh.connectivity);
      REQUIRE(file.mesh().polyhedron_faces == mesh.polyhedron_faces);
      REQUIRE(file.mesh().regions == mesh.regions);
      REQUIRE(file.mesh().region_array == "MaterialIds");
    }
  }
}

TEST_CASE("regions are those of the cells of highest dimension", "[core][mesh_file]") {
  const Folder folder;
  Mesh mesh = cube(CellType::Hexahedron, 2);
  mesh.types.push_back(CellType::Quad);
  for (Index node : {0, 1, 4, 3}) mesh.connectivity.push_back(node);
  mesh.offsets.push_back(std::ssize(mesh.connectivity));
  std::vector<int> patches(8, 3), materials(9, 5);
  patches.push_back(4);
  materials[2] = -6;
  ExtraArrays extra;
  extra.cell_integers["gmsh:geometrical"] = patches;  // varies with the shell cell alone
  write_mesh(folder / "one.vtu", mesh, extra);
  REQUIRE(MeshFile(folder / "one.vtu").mesh().regions.empty());
  extra.cell_integers["MaterialIds"] = materials;
  write_mesh(folder / "two.vtu", mesh, extra);
  const MeshFile file(folder / "two.vtu");
  REQUIRE(file.mesh().regions == materials);
  REQUIRE(file.mesh().region_array == "MaterialIds");
}

TEST_CASE("extra arrays are added beside the file's own", "[core][mesh_file]") {
  const Folder folder;
  const Grid grid = exotic_grid(VTK_DOUBLE, true);
  write_vtu(folder / "in.vtu", grid, kEncodings[0]);
  const MeshFile file(folder / "in.vtu");
  const Index nodes = file.mesh().node_count(), cells = file.mesh().cell_count();
  ExtraArrays extra;
  extra.point_arrays["moved"] = RowMatrix::Random(nodes, 3);
  extra.cell_arrays["quality"] = RowMatrix::Random(cells, 1);
  extra.point_integers["entity"] = std::vector<int>(nodes, -7);
  extra.cell_integers["bad"] = std::vector<int>(cells, 1);
  for (const char* name : {"out.vtu", "again.vtu"}) {  // the second time they are there already
    MeshFile(folder / (std::string(name) == "out.vtu" ? "in.vtu" : "out.vtu"))
        .write(folder / name, file.mesh().points, extra);
    const Grid result = read_vtu(folder / name);
    REQUIRE(result->GetPointData()->GetNumberOfArrays() ==
            grid->GetPointData()->GetNumberOfArrays() + 2);
    REQUIRE(result->GetCellData()->GetNumberOfArrays() ==
            grid->GetCellData()->GetNumberOfArrays() + 2);
    require_same_roles(grid->GetPointData(), result->GetPointData());
    vtkDataArray* moved = result->GetPointData()->GetArray("moved");
    REQUIRE(moved->GetDataType() == VTK_DOUBLE);
    for (Index n = 0; n < nodes; ++n)
      for (int i = 0; i < 3; ++i)
        REQUIRE(moved->GetComponent(n, i) == extra.point_arrays["moved"](n, i));
    REQUIRE(result->GetPointData()->GetArray("entity")->GetComponent(nodes - 1, 0) == -7);
    REQUIRE(result->GetCellData()->GetArray("quality")->GetComponent(cells - 1, 0) ==
            extra.cell_arrays["quality"](cells - 1, 0));
  }
}

TEST_CASE("names of arrays may hold what XML has a meaning for", "[core][mesh_file]") {
  const Folder folder;
  write_vtu(folder / "in.vtu", exotic_grid(VTK_DOUBLE, true), kEncodings[0]);
  const MeshFile file(folder / "in.vtu");
  const std::string name = "inlet & <outlet> of \"A\" &amp;";
  ExtraArrays extra;
  extra.point_arrays[name] = RowMatrix::Random(file.mesh().node_count(), 1);
  file.write(folder / "once.vtu", file.mesh().points, extra);
  MeshFile(folder / "once.vtu").write(folder / "twice.vtu", file.mesh().points);
  for (const char* copy : {"once.vtu", "twice.vtu"}) {
    const auto arrays = MeshFile(folder / copy).arrays();
    CHECK(std::ranges::count(arrays, name, &DataArray::name) == 1);
  }
}

TEST_CASE("what does not fit the mesh is not written", "[core][mesh_file]") {
  const Folder folder;
  write_mesh(folder / "in.vtu", cube(CellType::Tetra, 1));
  const MeshFile file(folder / "in.vtu");
  Points points = file.mesh().points;
  REQUIRE_THROWS_AS(file.write(folder / "out.vtu", points.topRows(3)), InvalidInputError);
  ExtraArrays extra;
  extra.cell_integers["short"] = {1};
  REQUIRE_THROWS_AS(file.write(folder / "out.vtu", points, extra), InvalidInputError);
  points(3, 0) = std::numeric_limits<double>::quiet_NaN();
  REQUIRE_THROWS_AS(file.write(folder / "out.vtu", points), InvalidInputError);
  REQUIRE(folder.file_count() == 1);
}

TEST_CASE("files that can't be read say why", "[core][mesh_file]") {
  const Folder folder;
  require_io_error(folder / "missing.vtu", "no such file");
  require_io_error(folder.path(), "folder");
  put(folder / "empty.vtu", "");
  require_io_error(folder / "empty.vtu", "it is empty");
  put(folder / "garbage.vtu", std::string(5000, '\x81'));
  require_io_error(folder / "garbage.vtu", "does not begin as one");
  put(folder / "surface.vtp",
      "<?xml version=\"1.0\"?>\n<VTKFile type=\"PolyData\"><PolyData></PolyData></VTKFile>");
  require_io_error(folder / "surface.vtp", "PolyData");
  put(folder / "other.vtk",
      "# vtk DataFile Version 3.0\nx\nASCII\nDATASET STRUCTURED_POINTS\nDIMENSIONS 1 1 1\n");
  require_io_error(folder / "other.vtk", "STRUCTURED_POINTS");
  put(folder / "broken.vtu",
      "<VTKFile type=\"UnstructuredGrid\"><UnstructuredGrid><Piece></UnstructuredGrid></VTKFile>");
  require_io_error(folder / "broken.vtu", "damaged");
  if (geteuid() != 0) {
    write_mesh(folder / "locked.vtu", cube(CellType::Tetra, 1));
    fs::permissions(folder / "locked.vtu", fs::perms::none);
    require_io_error(folder / "locked.vtu", "ermission");
  }
}

TEST_CASE("a file cut off anywhere is refused", "[core][mesh_file]") {
  const Folder folder;
  for (const Encoding& encoding : kEncodings) {
    CAPTURE(encoding.name);
    write_vtu(folder / "whole.vtu", exotic_grid(VTK_DOUBLE, true), encoding);
    const std::string whole = contents(folder / "whole.vtu");
    for (const double part : {0.02, 0.3, 0.6, 0.9, 0.999}) {
      put(folder / "cut.vtu", whole.substr(0, static_cast<std::size_t>(part * whole.size())));
      REQUIRE_THROWS_AS(MeshFile(folder / "cut.vtu"), IoError);
    }
  }
}

TEST_CASE("a file with a hole in the middle is refused", "[core][mesh_file]") {
  const Folder folder;
  for (const Encoding& encoding : kEncodings) {
    CAPTURE(encoding.name);
    const Grid grid = exotic_grid(VTK_DOUBLE, false);
    grid->GetFieldData()->RemoveArray("notes");  // VTK's reader crashes on damaged strings
    grid->GetCellData()->RemoveArray("labels");
    write_vtu(folder / "whole.vtu", grid, encoding);
    const std::string whole = contents(folder / "whole.vtu");
    put(folder / "cut.vtu", whole.substr(0, whole.size() / 2) + whole.substr(whole.size() * 3 / 4));
    REQUIRE_THROWS_AS(MeshFile(folder / "cut.vtu"), Error);
  }
}

TEST_CASE("a cut legacy file is refused", "[core][mesh_file]") {
  const Folder folder;
  const Mesh mesh = cube(CellType::Tetra, 3);
  write_mesh(folder / "whole.vtk", mesh);
  const std::string whole = contents(folder / "whole.vtk");
  for (const double part : {0.01, 0.2, 0.5, 0.9}) {
    CAPTURE(part);
    put(folder / "cut.vtk", whole.substr(0, static_cast<std::size_t>(part * whole.size())));
    REQUIRE_THROWS_AS(MeshFile(folder / "cut.vtk"), Error);
  }
}

TEST_CASE("an empty mesh and a coordinate that is no number are invalid", "[core][mesh_file]") {
  const Folder folder;
  const auto grid = Grid::New();
  write_vtu(folder / "empty.vtu", grid, kEncodings[1]);
  REQUIRE_THROWS_AS(MeshFile(folder / "empty.vtu"), InvalidInputError);
  REQUIRE_THROWS_WITH(MeshFile(folder / "empty.vtu"), Catch::Contains("empty.vtu"));
  Mesh mesh = cube(CellType::Tetra, 1);
  mesh.points(3, 1) = std::numeric_limits<double>::quiet_NaN();
  write_mesh(folder / "nan.vtu", mesh);
  REQUIRE_THROWS_AS(MeshFile(folder / "nan.vtu"), InvalidInputError);
  REQUIRE_THROWS_WITH(MeshFile(folder / "nan.vtu"), Catch::Contains("node 3"));
}

TEST_CASE("a full disk leaves nothing behind and the old file whole", "[core][mesh_file]") {
  const Folder folder;
  for (const Encoding& encoding : kEncodings) {
    CAPTURE(encoding.name);
    write_vtu(folder / "in.vtu", exotic_grid(VTK_DOUBLE, true), encoding);
    const MeshFile file(folder / "in.vtu");
    const auto size = fs::file_size(folder / "in.vtu");
    put(folder / "out.vtu", "an older result");
    for (const auto limit : {std::uintmax_t{0}, std::uintmax_t{100}, size / 2, size - 20}) {
      CAPTURE(limit);
      const FileSizeLimit full(limit);
      REQUIRE_THROWS_AS(file.write(folder / "out.vtu", file.mesh().points), IoError);
      REQUIRE(contents(folder / "out.vtu") == "an older result");
      REQUIRE(folder.file_count() == 2);
    }
    file.write(folder / "out.vtu", file.mesh().points);
    REQUIRE(MeshFile(folder / "out.vtu").mesh().points == file.mesh().points);
    fs::remove(folder / "out.vtu");
  }
}

TEST_CASE("a full disk stops a legacy file too", "[core][mesh_file]") {
  const Folder folder;
  write_mesh(folder / "in.vtk", cube(CellType::Tetra, 3));
  const MeshFile file(folder / "in.vtk");
  const FileSizeLimit full(fs::file_size(folder / "in.vtk") - 1);
  REQUIRE_THROWS_AS(file.write(folder / "out.vtk", file.mesh().points), IoError);
  REQUIRE(folder.file_count() == 1);
}

TEST_CASE("places that can't be written to say why", "[core][mesh_file]") {
  const Folder folder;
  write_mesh(folder / "in.vtu", cube(CellType::Tetra, 1));
  const MeshFile file(folder / "in.vtu");
  const Points& points = file.mesh().points;
  REQUIRE_THROWS_WITH(file.write(folder.path(), points), Catch::Contains("folder"));
  REQUIRE_THROWS_WITH(file.write("/dev/full", points), Catch::Contains("regular"));
  REQUIRE_THROWS_AS(file.write(folder / "no/such/folder.vtu", points), IoError);
  REQUIRE(folder.file_count() == 1);
}

TEST_CASE("a file that is replaced keeps who may read it", "[core][mesh_file]") {
  const Folder folder;
  write_mesh(folder / "in.vtu", cube(CellType::Tetra, 1));
  put(folder / "old.vtu", "old");
  const auto mode = fs::perms::owner_read | fs::perms::owner_write | fs::perms::group_read;
  fs::permissions(folder / "old.vtu", mode);
  const MeshFile file(folder / "in.vtu");
  file.write(folder / "old.vtu", file.mesh().points);
  CHECK(fs::status(folder / "old.vtu").permissions() == mode);
}

TEST_CASE("a link to an older result stays a link", "[core][mesh_file]") {
  const Folder folder;
  write_mesh(folder / "in.vtu", cube(CellType::Tetra, 1));
  put(folder / "real.vtu", "old");
  fs::create_symlink(folder / "real.vtu", folder / "link.vtu");
  const MeshFile file(folder / "in.vtu");
  file.write(folder / "link.vtu", file.mesh().points);
  REQUIRE(fs::is_symlink(folder / "link.vtu"));
  REQUIRE(MeshFile(folder / "real.vtu").mesh().points == file.mesh().points);
}

TEST_CASE("a link to what is not there yet stays a link, and a ring of links is refused",
          "[core][mesh_file]") {
  const Folder folder;
  write_mesh(folder / "in.vtu", cube(CellType::Tetra, 1));
  const MeshFile file(folder / "in.vtu");
  fs::create_directory(folder / "results");
  fs::create_symlink("results/second.vtu", folder / "first.vtu");
  fs::create_symlink("new.vtu", folder / "results/second.vtu");
  file.write(folder / "first.vtu", file.mesh().points);
  CHECK(fs::is_symlink(folder / "first.vtu"));
  CHECK(fs::is_symlink(folder / "results/second.vtu"));
  CHECK(MeshFile(folder / "results/new.vtu").mesh().points == file.mesh().points);
  fs::create_symlink("b.vtu", folder / "a.vtu");
  fs::create_symlink("a.vtu", folder / "b.vtu");
  REQUIRE_THROWS_AS(file.write(folder / "a.vtu", file.mesh().points), IoError);
}

TEST_CASE("the input can be replaced by its own copy", "[core][mesh_file]") {
  const Folder folder;
  write_mesh(folder / "in.vtu", cube(CellType::Tetra, 1));
  const MeshFile file(folder / "in.vtu");
  const Points points = 2 * file.mesh().points;
  file.write(folder / "in.vtu", points);
  REQUIRE(MeshFile(folder / "in.vtu").mesh().points == points);
}

TEST_CASE("nothing is printed when a file is damaged", "[core][mesh_file]") {
  const Folder folder;
  write_vtu(folder / "whole.vtu", exotic_grid(VTK_DOUBLE, true), kEncodings[3]);
  std::string text = contents(folder / "whole.vtu");
  text.replace(text.find("offset=\""), 9, "offset=\"99999999");
  put(folder / "cut.vtu", text);
  std::fflush(stderr);
  const int before = dup(2);
  const fs::path log = folder / "log";
  REQUIRE(std::freopen(log.c_str(), "w", stderr) != nullptr);
  REQUIRE_THROWS_AS(MeshFile(folder / "cut.vtu"), Error);
  std::fflush(stderr);
  dup2(before, 2);
  close(before);
  REQUIRE(contents(log).empty());
}
