#include "core/formats/vtk/reader.h"

#include <vtkCellArray.h>
#include <vtkCellData.h>
#include <vtkErrorCode.h>
#include <vtkIdTypeArray.h>
#include <vtkNew.h>
#include <vtkUnsignedCharArray.h>
#include <vtkUnstructuredGridReader.h>
#include <vtkXMLUnstructuredGridReader.h>

#include <algorithm>
#include <fstream>
#include <limits>
#include <optional>
#include <sstream>
#include <string>

#include "core/formats/mesh_format.h"
#include "core/formats/source_file.h"
#include "core/formats/vtk/messages.h"

namespace fs = std::filesystem;

namespace cadmorph {
namespace {

/// Cell arrays that tools keep region ids in, most telling first: one of a geometric entity divides
/// at least as finely as one of a material.
constexpr const char *kGmshEntities = "gmsh:geometrical", *kGmshGroups = "gmsh:physical";
constexpr const char* kRegionArrays[] = {
    "CellEntityIds", kGmshEntities, kGmshGroups,       "MaterialIds", "MaterialId",
    "material",      "Material",    "RegionIds",       "RegionId",    "region",
    "Region",        "regions",     "ElementBlockIds", "cell_tags",   "CellTags",
    "medit:ref",     "cell_ids",    "PartIds",         "PartId"};

constexpr std::size_t kHeaderBytes = 1024;  // a title has 256 characters

/// The word after DATASET at the start of a legacy file.
std::string legacy_type(const std::string& start) {
  std::istringstream words(start);
  std::string word;
  while (words >> word)
    if (word == "DATASET" && words >> word) return word;
  return {};
}

/// Whether the file's last characters hold XML's closing tag.
bool has_closing_tag(const fs::path& path) {
  constexpr std::streamoff kBytes = 4096;  // room for comments and blank lines after the tag
  std::ifstream stream(path, std::ios::binary | std::ios::ate);
  const std::streamoff size = stream.tellg();
  stream.seekg(std::max<std::streamoff>(0, size - kBytes));
  std::string text(static_cast<std::size_t>(std::min(kBytes, std::max<std::streamoff>(size, 0))),
                   '\0');
  stream.read(text.data(), static_cast<std::streamsize>(text.size()));
  return text.find("</VTKFile>") != std::string::npos;
}

template <class Reader>
Grid run_reader(Reader* reader, const fs::path& path) {
  SilentVtk vtk;
  reader->SetFileName(path.c_str());
  reader->Update();
  if (vtk.has_errors() || reader->GetErrorCode() != vtkErrorCode::NoError)
    fail_reading(path, "it is damaged or cut off (" + vtk.first_error() + ")");
  return reader->GetOutput();
}

Grid read_xml(const fs::path& path) {
  if (!has_closing_tag(path))
    fail_reading(path, "it is cut off: its closing tag is missing; write or copy it again");
  vtkNew<vtkXMLUnstructuredGridReader> reader;
  return run_reader(reader.Get(), path);
}

Grid read_legacy(const fs::path& path, Layout& layout) {
  vtkNew<vtkUnstructuredGridReader> reader;
  reader->ReadAllScalarsOn();
  reader->ReadAllVectorsOn();
  reader->ReadAllNormalsOn();
  reader->ReadAllTensorsOn();
  reader->ReadAllColorScalarsOn();
  reader->ReadAllTCoordsOn();
  reader->ReadAllFieldsOn();
  const Grid grid = run_reader(reader.Get(), path);
  layout.is_xml = false;
  if (reader->GetFileMajorVersion() < 5)
    layout.legacy_version = vtkDataWriter::VTK_LEGACY_READER_VERSION_4_2;
  return grid;
}

template <class Array>
std::vector<Index> to_indices(Array* array) {
  const auto* begin = array->GetPointer(0);
  return {begin, begin + array->GetNumberOfValues()};
}

void take_cells(vtkUnstructuredGrid* grid, Mesh& mesh) {
  vtkCellArray* cells = grid->GetCells();
  mesh.offsets = {0};
  if (!cells || !grid->GetCellTypesArray()) return;
  const vtkIdType count = grid->GetNumberOfCells();
  mesh.types.resize(count);
  for (vtkIdType c = 0; c < count; ++c)
    mesh.types[c] = static_cast<CellType>(grid->GetCellTypesArray()->GetValue(c));
  if (cells->IsStorage64Bit()) {
    mesh.offsets = to_indices(cells->GetOffsetsArray64());
    mesh.connectivity = to_indices(cells->GetConnectivityArray64());
  } else {
    mesh.offsets = to_indices(cells->GetOffsetsArray32());
    mesh.connectivity = to_indices(cells->GetConnectivityArray32());
  }
}

void take_polyhedra(vtkUnstructuredGrid* grid, const fs::path& path, Mesh& mesh) {
  if (std::ranges::find(mesh.types, CellType::Polyhedron) == mesh.types.end()) return;
  vtkIdTypeArray* faces = grid->GetFaces();
  vtkIdTypeArray* locations = grid->GetFaceLocations();
  const Index cells = mesh.cell_count();
  if (!faces || !locations || locations->GetNumberOfValues() != cells)
    fail_reading(path, "its polyhedra have no faces");
  const Index size = faces->GetNumberOfValues();
  mesh.polyhedron_offsets.assign(1, 0);
  for (Index c = 0; c < cells; ++c) {
    Index at = locations->GetValue(c);
    if (mesh.types[c] == CellType::Polyhedron) {
      if (at < 0 || at >= size)
        fail_reading(path, "polyhedron " + std::to_string(c) + " has no faces");
      for (Index left = faces->GetValue(at++); left > 0; --left) {
        const Index nodes = at < size ? faces->GetValue(at) : size;
        if (nodes < 0 || nodes >= size - at)
          fail_reading(path, "the faces of polyhedron " + std::to_string(c) + " are cut off");
        for (Index i = 0; i <= nodes; ++i) mesh.polyhedron_faces.push_back(faces->GetValue(at++));
      }
    }
    mesh.polyhedron_offsets.push_back(static_cast<Index>(mesh.polyhedron_faces.size()));
  }
}

void take_points(vtkUnstructuredGrid* grid, Mesh& mesh) {
  const Index count = grid->GetNumberOfPoints();
  mesh.points.resize(count, 3);
  for (Index n = 0; n < count; ++n) grid->GetPoint(n, mesh.points.row(n).data());
}

bool is_integral(vtkDataArray* array) {
  const int type = array->GetDataType();
  return type != VTK_FLOAT && type != VTK_DOUBLE && type != VTK_BIT;
}

/// Region ids from `array` when it has one integer a cell and they differ among the cells of the
/// mesh's highest dimension; else none.
std::vector<int> regions_from(vtkDataArray* array, const Mesh& mesh) {
  if (!array || !is_integral(array) || array->GetNumberOfComponents() != 1) return {};
  using Limits = std::numeric_limits<int>;
  const int highest = dimension(mesh);
  std::vector<int> regions(mesh.types.size());
  std::optional<int> first;
  bool has_several = false;
  for (Index c = 0; c < mesh.cell_count(); ++c) {
    const double id = array->GetComponent(c, 0);
    if (id < Limits::min() || id > Limits::max()) return {};
    regions[c] = static_cast<int>(id);
    if (dimension(mesh.types[c]) != highest) continue;
    if (!first) first = regions[c];
    has_several = has_several || regions[c] != *first;
  }
  return has_several ? regions : std::vector<int>{};
}

/// `groups`: of each cell, or nothing.
void take_blocks(vtkDataArray* groups, Mesh& mesh) {
  const std::vector<int> zones = regions_from(groups, mesh);
  for (Index c = 0; c < mesh.cell_count(); ++c)
    if (dimension(mesh.types[c]) == dimension(mesh))
      mesh.zone_of_block[mesh.regions[c]] = zones.empty() ? 0 : zones[c];
}

void take_regions(vtkUnstructuredGrid* grid, Mesh& mesh) {
  for (const char* name : kRegionArrays) {
    mesh.regions = regions_from(grid->GetCellData()->GetArray(name), mesh);
    if (mesh.regions.empty()) continue;
    mesh.region_array = name;
    if (mesh.region_array == kGmshEntities)
      take_blocks(grid->GetCellData()->GetArray(kGmshGroups), mesh);
    return;
  }
}

}  // namespace

std::pair<Grid, Layout> read_grid(const fs::path& path) {
  if (std::ifstream file(path, std::ios::binary); file.get() == 0x1f && file.get() == 0x8b)
    fail_reading(path, "it is packed by gzip, which VTK does not read; unpack it first");
  const std::string start = read_start(path, kHeaderBytes);
  if (start.starts_with("# vtk DataFile")) {
    if (const std::string type = legacy_type(start); type != "UNSTRUCTURED_GRID")
      fail_reading(path, "it holds a VTK data set " + (type.empty() ? "of no type" : type) +
                             ", not an UNSTRUCTURED_GRID; convert it to an unstructured grid");
    Layout layout;
    const Grid grid = read_legacy(path, layout);
    return {grid, layout};
  }
  const Layout layout = xml_layout(path);
  return {read_xml(path), layout};
}

Mesh to_mesh(vtkUnstructuredGrid* grid, const fs::path& path) {
  Mesh mesh;
  take_points(grid, mesh);
  take_cells(grid, mesh);
  if (std::ranges::find(mesh.types, CellType::BiquadraticQuadraticPyramid) != mesh.types.end())
    fail_reading(path, "it has cells of type 38, which VTK has not");
  take_polyhedra(grid, path, mesh);
  take_regions(grid, mesh);
  return mesh;
}

}  // namespace cadmorph
