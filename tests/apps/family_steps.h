#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "apps/pipeline/morph_job.h"

namespace cadmorph::testing {

/// A family of models/ at any change (1: step 20, 1.5: 150 % of the parameter range), made by the
/// models' own generator.
CadModel family_cad(const std::string& family, double change);

/// The same, written to a STEP file.
void write_family_step(const std::filesystem::path& path, const std::string& family, double change);

/// A job for a mesh of models/, `mesh` without its extension.
MorphJob family_job(const std::string& family, const std::string& mesh,
                    PipelineOptions options = {});

/// Cells that the exact test refuses, asked for anew.
Index invalid_cells(const Mesh& mesh, const Points& positions);

}  // namespace cadmorph::testing
