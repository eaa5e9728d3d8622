#include <vtkCellArray.h>
#include <vtkCellData.h>
#include <vtkDoubleArray.h>
#include <vtkFieldData.h>
#include <vtkIdTypeArray.h>
#include <vtkIntArray.h>
#include <vtkNew.h>
#include <vtkPointData.h>
#include <vtkSmartPointer.h>
#include <vtkUnsignedCharArray.h>
#include <vtkUnstructuredGrid.h>
#include <vtkVariant.h>

#include <algorithm>
#include <string>
#include <utility>

#include "core/cell_topology.h"
#include "core/errors.h"
#include "core/formats/formats.h"
#include "core/formats/mesh_format.h"
#include "core/formats/vtk/layout.h"
#include "core/formats/vtk/reader.h"
#include "core/formats/vtk/writer.h"

namespace fs = std::filesystem;

namespace cadmorph {
namespace {

vtkSmartPointer<vtkPoints> to_vtk(const Points& points) {
  auto result = vtkSmartPointer<vtkPoints>::New();
  result->SetDataTypeToDouble();
  result->SetNumberOfPoints(points.rows());
  std::copy_n(points.data(), points.size(),
              vtkDoubleArray::SafeDownCast(result->GetData())->GetPointer(0));
  return result;
}

void check_rows(const std::string& name, Index rows, Index expected) {
  if (rows != expected)
    throw InvalidInputError("the array '" + name + "' to write has " + std::to_string(rows) +
                            " rows, not " + std::to_string(expected));
}

void add_arrays(vtkDataSetAttributes* data, Index count,
                const std::map<std::string, RowMatrix>& arrays,
                const std::map<std::string, std::vector<int>>& integers) {
  for (const auto& [name, values] : arrays) {
    check_rows(name, values.rows(), count);
    vtkNew<vtkDoubleArray> array;
    array->SetName(name.c_str());
    array->SetNumberOfComponents(static_cast<int>(values.cols()));
    array->SetNumberOfTuples(count);
    std::copy_n(values.data(), values.size(), array->GetPointer(0));
    data->AddArray(array);
  }
  for (const auto& [name, values] : integers) {
    check_rows(name, std::ssize(values), count);
    vtkNew<vtkIntArray> array;
    array->SetName(name.c_str());
    array->SetNumberOfTuples(count);
    std::ranges::copy(values, array->GetPointer(0));
    data->AddArray(array);
  }
}

void add_extra(vtkUnstructuredGrid* grid, const ExtraArrays& extra) {
  add_arrays(grid->GetPointData(), grid->GetNumberOfPoints(), extra.point_arrays,
             extra.point_integers);
  add_arrays(grid->GetCellData(), grid->GetNumberOfCells(), extra.cell_arrays, extra.cell_integers);
}

vtkSmartPointer<vtkIdTypeArray> to_vtk(const std::vector<Index>& values) {
  auto array = vtkSmartPointer<vtkIdTypeArray>::New();
  array->SetNumberOfValues(std::ssize(values));
  std::ranges::copy(values, array->GetPointer(0));
  return array;
}

DataArray to_array(vtkAbstractArray* source, ArrayLocation location) {
  DataArray result{.name = source->GetName() ? source->GetName() : "",
                   .location = location,
                   .type = source->GetDataTypeAsString()};
  const Index tuples = source->GetNumberOfTuples();
  if (auto* numbers = vtkDataArray::SafeDownCast(source)) {
    const int type = numbers->GetDataType();
    result.is_integral = type != VTK_FLOAT && type != VTK_DOUBLE;
    result.values.resize(tuples, numbers->GetNumberOfComponents());
    for (Index i = 0; i < tuples; ++i) numbers->GetTuple(i, result.values.row(i).data());
    if (result.is_integral && numbers->GetDataTypeSize() == sizeof(std::int64_t)) {
      const auto* first = static_cast<const std::int64_t*>(numbers->GetVoidPointer(0));
      result.wide_integers.assign(first, first + numbers->GetNumberOfValues());
    }
  } else {
    for (Index i = 0; i < source->GetNumberOfValues(); ++i)
      result.texts.push_back(source->GetVariantValue(i).ToString());
  }
  return result;
}

void add_to(std::vector<DataArray>& arrays, vtkFieldData* data, ArrayLocation location) {
  for (int i = 0; i < data->GetNumberOfArrays(); ++i)
    arrays.push_back(to_array(data->GetAbstractArray(i), location));
}

/// Sets the cells with VTK's form of polyhedron faces: the number of faces before them.
void set_cells(const Mesh& mesh, vtkUnstructuredGrid* grid) {
  vtkNew<vtkUnsignedCharArray> types;
  for (CellType type : mesh.types) types->InsertNextValue(static_cast<unsigned char>(type));
  vtkNew<vtkCellArray> cells;
  cells->SetData(to_vtk(mesh.offsets), to_vtk(mesh.connectivity));
  if (mesh.polyhedron_faces.empty()) {
    grid->SetCells(types, cells);
    return;
  }
  std::vector<Index> locations, faces;
  for (Index c = 0; c < mesh.cell_count(); ++c) {
    const Index end = mesh.polyhedron_offsets[c + 1];
    const bool is_polyhedron = mesh.types[c] == CellType::Polyhedron;
    locations.push_back(is_polyhedron ? std::ssize(faces) : -1);
    if (!is_polyhedron) continue;
    const auto count = faces.size();
    faces.push_back(0);
    for (Index at = mesh.polyhedron_offsets[c]; at < end; at += mesh.polyhedron_faces[at] + 1)
      ++faces[count];
    faces.insert(faces.end(), mesh.polyhedron_faces.begin() + mesh.polyhedron_offsets[c],
                 mesh.polyhedron_faces.begin() + end);
  }
  grid->SetCells(types, cells, to_vtk(locations), to_vtk(faces));
}

// VTK's writer keeps the range of each array beside it, and writes arrays that have one in another
// form: have them all, so that the first file has the bytes of later ones.
void take_ranges(vtkUnstructuredGrid* grid) {
  for (vtkFieldData* data : {static_cast<vtkFieldData*>(grid->GetPointData()),
                             static_cast<vtkFieldData*>(grid->GetCellData()), grid->GetFieldData()})
    for (int i = 0; i < data->GetNumberOfArrays(); ++i) {
      double range[2];
      if (vtkDataArray* array = data->GetArray(i)) array->GetRange(range, -1);
    }
}

class VtkCopier : public MeshCopier {
 public:
  VtkCopier(Grid grid, const Layout& layout) : grid_(std::move(grid)), layout_(layout) {}

  void write(const fs::path& target, const Points& /*before*/, const Points& after) const override {
    write_arrays(target, after, {});
  }
  bool takes_arrays() const override { return true; }
  void write_arrays(const fs::path& target, const Points& after,
                    const ExtraArrays& extra) const override {
    vtkNew<vtkUnstructuredGrid> grid;
    grid->ShallowCopy(grid_);
    take_ranges(grid);
    grid->SetPoints(to_vtk(after));
    add_extra(grid, extra);
    write_grid(grid, layout_, target);
  }
  std::vector<DataArray> arrays() const override {
    std::vector<DataArray> result;
    add_to(result, grid_->GetPointData(), ArrayLocation::Point);
    add_to(result, grid_->GetCellData(), ArrayLocation::Cell);
    add_to(result, grid_->GetFieldData(), ArrayLocation::Field);
    return result;
  }

 private:
  Grid grid_;
  Layout layout_;
};

Recognition recognise(const FileStart& start) {
  const bool is_vtk = start.bytes.starts_with("# vtk DataFile") ||
                      start.bytes.substr(0, 4096).find("<VTKFile") != std::string::npos;
  return is_vtk ? Recognition::Sure : Recognition::No;
}

ReadMesh read(const fs::path& path) {
  const auto [grid, layout] = read_grid(path);
  ReadMesh result;
  result.mesh = to_mesh(grid, path);
  result.copier = std::make_unique<VtkCopier>(grid, layout);
  return result;
}

}  // namespace

const MeshFormat& vtk_format() {
  static const MeshFormat format{
      .name = "VTK", .extensions = {".vtu", ".vtk"}, .recognise = recognise, .read = read};
  return format;
}

void write_mesh(const fs::path& path, const Mesh& mesh, const ExtraArrays& extra) {
  vtkNew<vtkUnstructuredGrid> grid;
  grid->SetPoints(to_vtk(mesh.points));
  const std::optional<Mesh> other = as_vtk_has_it(mesh);
  set_cells(other ? *other : mesh, grid);
  ExtraArrays arrays = extra;
  if (!mesh.regions.empty())
    arrays.cell_integers.emplace(mesh.region_array.empty() ? "RegionId" : mesh.region_array,
                                 mesh.regions);
  add_extra(grid, arrays);
  write_grid(grid, {.compressor = vtkXMLWriter::ZLIB}, path);
}

}  // namespace cadmorph
