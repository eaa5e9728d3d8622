#pragma once

#include <vtkUnstructuredGrid.h>

#include <filesystem>

#include "core/formats/vtk/layout.h"

namespace cadmorph {

/// Writes the grid: as .vtu or .vtk where `path` ends so, else in the layout's format. The file
/// appears whole or not at all. Throws IoError, leaving nothing behind.
void write_grid(vtkUnstructuredGrid* grid, const Layout& layout, const std::filesystem::path& path);

}  // namespace cadmorph
