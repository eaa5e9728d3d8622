#include "apps/pipeline/morph_base.h"

#include <algorithm>

#include "core/blas.h"
#include "core/parallel.h"
#include "surface/motion_path.h"

namespace cadmorph {
namespace {

PipelineOptions with_progress_everywhere(PipelineOptions options) {
  if (!options.surface.association.progress)
    options.surface.association.progress = options.progress;
  if (!options.volume.rbf.progress) options.volume.rbf.progress = options.progress;
  return options;
}

// Counts cells of a lower dimension than the mesh, and nodes that they alone, or no cell, use.
void count_others(const Mesh& mesh, PipelineReport& report) {
  const int highest = dimension(mesh);
  report.has_solids = highest == 3;
  std::vector<char> is_used(static_cast<std::size_t>(mesh.node_count()), 0);
  for (Index c = 0; c < mesh.cell_count(); ++c) {
    if (dimension(mesh.types[c]) < highest)
      ++report.other_cells;
    else
      for (const Index node : mesh.cell(c)) is_used[node] = 1;
  }
  report.loose_nodes = std::ranges::count(is_used, 0);
}

}  // namespace

MorphBase::MorphBase(std::shared_ptr<const CadModel> base_cad, std::shared_ptr<const MeshFile> file,
                     PipelineOptions job_options, Points start)
    : options(with_progress_everywhere(std::move(job_options))),
      cad(std::move(base_cad)),
      mesh_file(std::move(file)) {
  if (start.size() > 0) set_start(std::move(start));
  PhaseClock clock(options.progress);
  const BaseInputs inputs{cad, *mesh_file, mesh(), options};
  static_cast<BaseSide&>(*this) = options.cache.empty() || moved
                                      ? set_up_base_side(inputs, clock)
                                      : cached_base_side(inputs, clock, report.cache);
  fill_report();
  report.phases = clock.phases();
}

void MorphBase::set_start(Points start) {
  if (start.rows() != mesh_file->mesh().node_count())
    throw InvalidInputError("a morph needs a start for each of the mesh's " +
                            std::to_string(mesh_file->mesh().node_count()) + " nodes");
  moved = mesh_file->mesh();
  moved->points = std::move(start);
}

void MorphBase::fill_report() {
  const Association& association = surface->association();
  report.base_cad = figures_of(*cad);
  report.mesh_file = mesh_file->path();
  report.mesh_format = mesh_file->format();
  report.remarks = mesh_file->remarks();
  for (const std::string& note : mesh_file->notes())
    report.notes.push_back(mesh_file->path().filename().string() + ": " + note);
  count_others(mesh(), report);
  report.nodes = mesh().node_count();
  report.cells = mesh().cell_count();
  report.vertex_nodes = association.vertex_nodes;
  report.edge_nodes = association.edge_nodes;
  report.face_nodes = association.face_nodes;
  report.amid_nodes = association.amid_nodes;
  report.unmatched_nodes = association.unmatched_nodes;
  report.interior_nodes = report.nodes - report.vertex_nodes - report.edge_nodes -
                          report.face_nodes - report.amid_nodes - report.unmatched_nodes;
  report.mesh_unit_mm = association.mesh_unit_mm;
  report.is_unit_detected = options.surface.association.mesh_unit_mm == 0;
  set_quality(report.before, quality, validity, checks);
  report.before.max_distance = association.max_distance;
  report.before.mean_distance = association.mean_distance;
  report.method = options.volume.method;
  report.kernel = options.volume.kernel;
  report.can_repair = options.can_repair;
  report.threads = thread_count();
  report.blas_kernel = blas_kernel();
  if (validity.invalid > 0) warn_of_inverted();
}

// Before the work goes on: what is inverted already may take long to no end.
void MorphBase::warn_of_inverted() {
  misordered = misordered_cells(mesh(), neighbours, orientation, validity.invalid_cells);
  std::string text = "the input mesh has " + std::to_string(validity.invalid) +
                     " inverted cells already, the first is cell " +
                     std::to_string(validity.invalid_cells.front());
  if (!misordered.empty())
    text += "; the nodes of " + std::to_string(misordered.size()) +
            " of them are in a wrong order (cell " + std::to_string(misordered.front()) +
            "): mend that where the mesh comes from, no repair is tried there";
  report.warnings.push_back(text);
  if (options.notice) options.notice(text);
}

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
  figures.worst_cell = quality.worst_cell;
  figures.inverted = quality.inverted;
  figures.invalid = validity.invalid;
  figures.checks = checks;
}

// New positions of the prescribed nodes alone.
Points MorphBase::prescribed(const Points& surface_positions) const {
  Points result(rows.size(), 3);
  for (std::size_t i = 0; i < rows.size(); ++i) result.row(i) = surface_positions.row(rows[i]);
  return result;
}

Points MorphBase::on_boundary(const Points& prescribed_positions) const {
  if (prescribed_positions.rows() != std::ssize(rows))
    throw InvalidInputError(std::to_string(prescribed_positions.rows()) + " positions for " +
                            std::to_string(rows.size()) + " surface nodes");
  Points result = mesh().points(boundary.nodes, Eigen::all);
  result(rows, Eigen::all) = prescribed_positions;
  return result;
}

std::vector<char> MorphBase::fixed_nodes() const {
  std::vector<char> is_fixed(mesh().node_count(), 0);
  for (const Index row : rows) is_fixed[boundary.nodes[row]] = 1;
  for (const Index c : misordered)
    for (const Index node : mesh().cell(c)) is_fixed[node] = 1;
  return is_fixed;
}

// Where faces turn, the surface follows them on the way; found out when it is first asked for.
SurfacePath MorphBase::path(const Points& prescribed_positions) const {
  const auto turning = std::make_shared<std::optional<MotionPath>>();
  return [this, turning, &prescribed_positions](double s) -> Points {
    if (!*turning) {
      turning->emplace(boundary, mesh().points(boundary.nodes, Eigen::all),
                       on_boundary(prescribed_positions), surface->association().facet_face);
    }
    return prescribed((**turning)(s));
  };
}

}  // namespace cadmorph
