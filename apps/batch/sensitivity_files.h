#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "apps/pipeline/design_velocity.h"

namespace cadmorph {

/// Reads a table of parameters: comma-separated, its first line names the columns name, plus, minus
/// and step, in any order; others are left out. Relative paths are from the table's folder. Throws
/// IoError; InvalidInputError with the line where a column, name, file or number is missing, a
/// number is not positive, or a name stands twice.
std::vector<DesignParameter> read_parameters(const std::filesystem::path& table);

/// Reads dJ/dX of the nodes of a mesh: of a .csv the columns Sensitivity_x, _y, _z of the
/// nodes PointID (0-based; 0 for the others; without _z 0), whose x, y, z must be the mesh's; else
/// the point array with that name, or the only one of three components, of a mesh file with as many
/// nodes. Throws IoError, InvalidInputError.
Sensitivity read_sensitivity(const std::filesystem::path& file, const std::string& array,
                             const MeshFile& mesh);

}  // namespace cadmorph
