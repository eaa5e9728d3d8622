#pragma once

#include <filesystem>

#include "apps/pipeline/morph_job.h"

namespace cadmorph {

/// A mesh file written.
struct WrittenMesh {
  std::filesystem::path path = {};
  std::filesystem::path diagnostics = {};  ///< the file beside with its arrays; may be none
  CoordinateRounding rounding = {};
};

/// Writes a result: to `output` when it is good, else, with the inverted cells marked in the cell
/// array cadmorph_bad, to `<stem>.failed.<ext>` beside. `has_diagnostics` adds the arrays
/// cadmorph_displacement, _cad_dimension (0 vertex, 1 edge, 2 face, 3 interior, -1 on no CAD
/// entity), _cad_entity (1-based as in `cadmorph match`; 0: none there), _uv and _scaled_jacobian;
/// the displacement from the file's positions, the entities of the result's base CAD. A format that
/// has no arrays keeps them in `<stem>.diagnostics.vtu` beside. Throws OutputError;
/// InvalidInputError where the format's numbers are too coarse (see MeshFile::write).
WrittenMesh write_result(const MorphResult& result, const std::filesystem::path& output,
                         bool has_diagnostics = false);

}  // namespace cadmorph
