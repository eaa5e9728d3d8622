#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "apps/pipeline/phase_clock.h"
#include "apps/pipeline/pipeline.h"

namespace cadmorph {

/// What a job finds out about the base CAD and the base mesh.
struct BaseSide {
  Boundary boundary;
  std::optional<SurfaceMorph> surface;
  std::optional<VolumeMorph> volume;
  std::vector<Index> rows;  ///< of Boundary::nodes: nodes whose positions the surface prescribes
  Orientation orientation;
  CellNeighbours neighbours;
  QualityReport quality;
  ValidityReport validity;
  QualityChecks checks;
};

/// What it is found out from.
struct BaseInputs {
  std::shared_ptr<const CadModel> cad;
  const MeshFile& file;
  const Mesh& mesh;  ///< the file's, or one with other positions
  const PipelineOptions& options;
};

/// Sets up the base side; announces its phases. Throws what MorphJob does.
BaseSide set_up_base_side(const BaseInputs& inputs, PhaseClock& clock);

/// The same by way of the file options.cache (docs/batch.md): reads it where it holds just this
/// base side, else sets up and writes it. The result is the same to the last bit. A file that can't
/// be used or written is told in `report`, no error; but one that is no cache is left as it is:
/// InvalidInputError.
BaseSide cached_base_side(const BaseInputs& inputs, PhaseClock& clock, CacheReport& report);

}  // namespace cadmorph
