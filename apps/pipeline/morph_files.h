#pragma once

#include <filesystem>
#include <functional>
#include <vector>

#include "apps/pipeline/morph_job.h"
#include "apps/pipeline/step_queue.h"
#include "apps/pipeline/write_result.h"

namespace cadmorph {

/// Largest memory of this process so far, bytes.
double peak_memory();

/// Time since this process was started, seconds.
double process_seconds();

struct MorphFiles {
  std::filesystem::path base_cad, variant_cad, mesh, output;
  bool has_diagnostics = false;
  std::vector<std::filesystem::path> via = {};  ///< CAD models on the way, in order

  CadReader read_cad = {};

  /// Called with the result before it is written: for what shows more than the figures.
  std::function<void(const MorphResult& result)> on_result = {};

  /// Called with the result of each morph of the series, unless it was refused.
  std::function<void(const MorphResult& result)> on_leg = {};

  /// Writes something else than the mesh to `output`; returns what was written, if anything.
  std::function<WrittenMesh(const MorphResult& result)> write = {};

  /// All that is read.
  std::vector<std::filesystem::path> inputs() const;
};

/// The whole trip: reads the STEP files and the mesh, morphs, writes. With CAD models on the way:
/// morphs from each to the next, the mesh associated anew with the model it has reached, its unit
/// kept; a leg that leaves inverted elements ends the trip and is refused; quality asked for is
/// asked of the last alone. Throws IoError, CadError or InvalidInputError for an input (a face map
/// has no meaning in a series), OutputError for the output, and what MorphJob throws.
PipelineReport morph_files(const MorphFiles& files, const PipelineOptions& options = {});

}  // namespace cadmorph
