#pragma once

#include <vtkSmartPointer.h>
#include <vtkUnstructuredGrid.h>

#include <filesystem>
#include <utility>

#include "core/formats/vtk/layout.h"
#include "core/mesh.h"

namespace cadmorph {

using Grid = vtkSmartPointer<vtkUnstructuredGrid>;

/// Reads a .vtu or legacy .vtk file. Throws IoError.
std::pair<Grid, Layout> read_grid(const std::filesystem::path& path);

/// The grid as a mesh; `path` stands in messages. Throws IoError.
Mesh to_mesh(vtkUnstructuredGrid* grid, const std::filesystem::path& path);

}  // namespace cadmorph
