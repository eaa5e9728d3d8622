#include <algorithm>

#include "apps/library/impl.h"
#include "apps/summary/summary.h"

namespace cadmorph::v1 {
namespace {

CadFigures figures_of(const cadmorph::CadFigures& cad) {
  return {.name = cad.file.string(),
          .unit = cad.unit,
          .faces = cad.faces,
          .edges = cad.edges,
          .vertices = cad.vertices,
          .solids = cad.solids,
          .diagonal_mm = cad.diagonal};
}

QualityFigures figures_of(const MeshFigures& mesh) {
  return {.max_distance_mm = mesh.max_distance,
          .mean_distance_mm = mesh.mean_distance,
          .min_scaled_jacobian = mesh.min_scaled_jacobian,
          .mean_scaled_jacobian = mesh.mean_scaled_jacobian,
          .worst_cell = mesh.worst_cell,
          .inverted_cells = mesh.inverted,
          .invalid_cells = mesh.invalid,
          .max_non_orthogonality_deg = mesh.checks.max_non_orthogonality_deg,
          .mean_non_orthogonality_deg = mesh.checks.mean_non_orthogonality_deg,
          .max_skewness = mesh.checks.max_skewness,
          .max_aspect_ratio = mesh.checks.max_aspect_ratio,
          .min_volume = mesh.checks.min_volume};
}

NodeFigures nodes_of(const PipelineReport& report) {
  return {.vertex = report.mesh.vertex_nodes,
          .edge = report.mesh.edge_nodes,
          .face = report.mesh.face_nodes,
          .amid_straight_edges = report.mesh.amid_nodes,
          .unmatched = report.mesh.unmatched_nodes,
          .interior = report.mesh.interior_nodes,
          .loose = report.mesh.loose_nodes};
}

Diagnosis diagnosis_of(const cadmorph::Diagnosis& found) {
  return {.bad_cells = found.bad_cells,
          .bad_cells_in_base = found.bad_in_base,
          .worst_cell = found.worst_cell,
          .location = found.location,
          .nearest_face = found.face + 1,
          .first_inversion = found.first_inversion,
          .advice = found.advice};
}

Outcome outcome_of(cadmorph::Outcome outcome) {
  switch (outcome) {
    case cadmorph::Outcome::Inverted:
      return Outcome::Inverted;
    case cadmorph::Outcome::PoorQuality:
      return Outcome::PoorQuality;
    default:
      return Outcome::Done;
  }
}

}  // namespace

Report report_of(const PipelineReport& report) {
  Report result;
  result.outcome = outcome_of(report.outcome);
  result.base_cad = figures_of(report.cad.base);
  result.variant_cad = figures_of(report.cad.variant);
  result.mesh_name = report.mesh.file.string();
  result.mesh_format = report.mesh.format;
  result.node_count = report.mesh.nodes;
  result.cell_count = report.mesh.cells;
  result.mesh_unit_mm = report.mesh.unit_mm;
  result.is_unit_detected = report.mesh.is_unit_detected;
  result.nodes = nodes_of(report);
  for (const cadmorph::GroupFigures& group : report.mesh.groups)
    result.groups.push_back({group.name, group.kind, group.nodes, group.max_displacement});
  result.matched_by = report.cad.matched_by;
  result.least_confidence = report.cad.least_confidence;
  result.before = figures_of(report.before);
  result.after = figures_of(report.after);
  result.max_displacement_mm = report.max_displacement;
  result.max_surface_displacement_mm = report.max_surface_displacement;
  if (report.method == MorphMethod::Rbf) result.solver = to_string(report.solver.solver);
  result.centres = report.solver.centres;
  result.iterations = report.solver.iterations;
  result.steps = report.stepping.steps;
  if (report.untangling)
    result.repaired_cells = report.untangling->before - report.untangling->after;
  if (report.improving)
    result.raised_cells = report.improving->poor_before - report.improving->poor_after;
  result.is_raised =
      report.best_mesh && std::ranges::any_of(report.best_mesh->attempts, &RaiseAttempt::is_taken);
  result.is_plain =
      report.stepping.steps <= 1 && !report.untangling && !report.improving && !result.is_raised;
  if (report.diagnosis) result.diagnosis = diagnosis_of(*report.diagnosis);
  result.warnings = report.run.warnings;
  result.notes = report.run.notes;
  for (const cadmorph::PhaseTime& phase : report.run.phases) {
    result.phases.push_back({phase.name, phase.seconds});
    result.seconds += phase.seconds;
  }
  result.threads = report.run.threads;
  result.blas_kernel = report.run.blas_kernel;
  return result;
}

}  // namespace cadmorph::v1
