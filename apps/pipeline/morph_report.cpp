#include "apps/pipeline/morph_report.h"

#include <algorithm>

namespace cadmorph {

CadFigures figures_of(const CadModel& cad) {
  return {.file = cad.file_name(),
          .unit = cad.file_unit(),
          .faces = static_cast<Index>(cad.faces().size()),
          .edges = static_cast<Index>(cad.edges().size()),
          .vertices = static_cast<Index>(cad.vertices().size()),
          .solids = cad.solid_count(),
          .diagonal = cad.diagonal()};
}

void set_quality(MeshFigures& figures, const QualityReport& quality, const ValidityReport& validity,
                 const QualityChecks& checks) {
  figures.min_scaled_jacobian = quality.min;
  figures.mean_scaled_jacobian = quality.mean;
  figures.worst_twentieth = worst_cells(quality).worst_twentieth;
  figures.poor = std::ranges::count_if(quality.values, [](double q) { return q < kPoor; });
  figures.worst_cell = quality.worst_cell;
  figures.inverted = quality.inverted;
  figures.invalid = validity.invalid;
  figures.checks = checks;
}

}  // namespace cadmorph
