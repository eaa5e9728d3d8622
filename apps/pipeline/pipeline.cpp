#include "apps/pipeline/pipeline.h"

#include <algorithm>
#include <sstream>

#include "core/blas.h"
#include "core/parallel.h"
#include "surface/motion_path.h"

namespace cadmorph {
namespace {

namespace fs = std::filesystem;

// Inverted cells are few when they are at most one in so many.
constexpr Index kFewCells = 10'000;

CadFigures figures_of(const CadModel& cad) {
  return {.file = cad.file_name(),
          .unit = cad.file_unit(),
          .faces = static_cast<Index>(cad.faces().size()),
          .edges = static_cast<Index>(cad.edges().size()),
          .vertices = static_cast<Index>(cad.vertices().size()),
          .solids = cad.solid_count(),
          .diagonal = cad.diagonal()};
}

PipelineOptions with_progress_everywhere(PipelineOptions options) {
  if (!options.surface.association.progress)
    options.surface.association.progress = options.progress;
  if (!options.volume.rbf.progress) options.volume.rbf.progress = options.progress;
  return options;
}

// Rows of Boundary::nodes whose positions the surface morph prescribes.
std::vector<Index> prescribed_rows(const Association& association) {
  std::vector<Index> rows;
  for (Index i = 0; i < static_cast<Index>(association.is_free.size()); ++i)
    if (!association.is_free[i]) rows.push_back(i);
  return rows;
}

std::vector<Index> sorted_union(const std::vector<Index>& a, const std::vector<Index>& b) {
  std::vector<Index> result;
  std::ranges::set_union(a, b, std::back_inserter(result));
  return result;
}

std::vector<Index> sorted_difference(const std::vector<Index>& a, const std::vector<Index>& b) {
  std::vector<Index> result;
  std::ranges::set_difference(a, b, std::back_inserter(result));
  return result;
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

std::string short_number(double value) {
  std::ostringstream text;
  text << value;
  return text.str();
}

std::string percent(double share) {
  return std::to_string(static_cast<int>(std::floor(100 * share))) + " %";
}

// Names the file in an error about the mesh, which knows no file.
template <class Call>
auto about_file(const fs::path& file, Call&& call) {
  try {
    return call();
  } catch (const InvalidInputError& error) {
    throw InvalidInputError(file.string() + ": " + error.what());
  }
}

// Calls on the attempts without an error; what a call throws becomes its attempt's.
template <class Call>
void for_each_good(std::vector<MorphAttempt>& attempts, Call&& call) {
  for (std::size_t i = 0; i < attempts.size(); ++i) {
    if (attempts[i].error) continue;
    try {
      call(i, attempts[i].result);
    } catch (...) {
      attempts[i].error = std::current_exception();
    }
  }
}

}  // namespace

struct MorphJob::Impl {
  Impl(std::shared_ptr<const CadModel> base_cad, std::shared_ptr<const MeshFile> file,
       PipelineOptions job_options, Points start)
      : options(with_progress_everywhere(std::move(job_options))),
        base(std::move(base_cad)),
        mesh_file(std::move(file)) {
    if (start.size() > 0) set_start(std::move(start));
    PhaseClock clock(options.progress);
    clock.start("boundary");
    boundary = about_file(mesh_file->path(), [&] { return extract_boundary(mesh()); });
    clock.start("association");
    surface.emplace(base, mesh(), boundary, options.surface);
    clock.start("volume set-up");
    set_up_volume();
    clock.start("quality before");
    measure_base();
    fill_report();
    report.phases = clock.phases();
  }

  const Mesh& mesh() const { return moved ? *moved : mesh_file->mesh(); }

  void set_start(Points start) {
    if (start.rows() != mesh_file->mesh().node_count())
      throw InvalidInputError("a morph needs a start for each of the mesh's " +
                              std::to_string(mesh_file->mesh().node_count()) + " nodes");
    moved = mesh_file->mesh();
    moved->points = std::move(start);
  }

  void set_up_volume() {
    rows = prescribed_rows(surface->association());
    std::vector<Index> nodes;
    for (const Index row : rows) nodes.push_back(boundary.nodes[row]);
    volume.emplace(mesh(), std::move(nodes), options.volume);
  }

  void measure_base() {
    orientation = detect_orientation(mesh());
    neighbours = find_cell_neighbours(mesh());
    quality = measure_quality(mesh(), mesh().points, orientation);
    validity = check_validity(mesh(), mesh().points, orientation);
    set_quality(report.before, quality, validity,
                check_quality(mesh(), mesh().points, neighbours, orientation));
  }

  void fill_report() {
    const Association& association = surface->association();
    report.base_cad = figures_of(*base);
    report.mesh_file = mesh_file->path();
    report.nodes = mesh().node_count();
    report.cells = mesh().cell_count();
    report.vertex_nodes = association.vertex_nodes;
    report.edge_nodes = association.edge_nodes;
    report.face_nodes = association.face_nodes;
    report.unmatched_nodes = association.unmatched_nodes;
    report.interior_nodes = report.nodes - report.vertex_nodes - report.edge_nodes -
                            report.face_nodes - report.unmatched_nodes;
    report.mesh_unit_mm = association.mesh_unit_mm;
    report.is_unit_detected = options.surface.association.mesh_unit_mm == 0;
    report.before.max_distance = association.max_distance;
    report.before.mean_distance = association.mean_distance;
    report.method = options.volume.method;
    report.kernel = options.volume.kernel;
    report.threads = thread_count();
    report.blas_kernel = blas_info().kernel;
    if (validity.invalid > 0)
      report.warnings.push_back("the input mesh has " + std::to_string(validity.invalid) +
                                " inverted cells already, the first is cell " +
                                std::to_string(validity.invalid_cells.front()));
  }

  TopologyMatch match(const CadModel& variant, PipelineReport& figures) const {
    TopologyMatch result = match_topology(*base, variant, {.given_faces = options.face_map});
    figures.variant_cad = figures_of(variant);
    figures.matched_by = result.how;
    figures.alignment = result.alignment;
    if (!result.face_confidence.empty())
      figures.least_confidence = std::ranges::min(result.face_confidence);
    return result;
  }

  // New positions of the prescribed nodes alone.
  Points prescribed(const Points& surface_positions) const {
    Points result(rows.size(), 3);
    for (std::size_t i = 0; i < rows.size(); ++i) result.row(i) = surface_positions.row(rows[i]);
    return result;
  }

  std::vector<char> fixed_nodes() const {
    std::vector<char> is_fixed(mesh().node_count(), 0);
    for (const Index row : rows) is_fixed[boundary.nodes[row]] = 1;
    return is_fixed;
  }

  SteppingOptions stepping() const {
    SteppingOptions result = options.stepping;
    if (options.untangle == UntangleMode::Always && result.steps == 0) result.steps = 1;
    if (options.untangle == UntangleMode::Never) result.least_gain_share = 1;
    return result;
  }

  // Where faces turn, the surface follows them on the way; found out when it is first asked for.
  SurfacePath path(const Points& prescribed_positions) const {
    const auto turning = std::make_shared<std::optional<MotionPath>>();
    return [this, turning, &prescribed_positions](double s) -> Points {
      if (!*turning) {
        const Points start = mesh().points(boundary.nodes, Eigen::all);
        Points end = start;
        end(rows, Eigen::all) = prescribed_positions;
        turning->emplace(boundary, start, end, surface->association().facet_face);
      }
      return prescribed((**turning)(s));
    };
  }

  // Steps, then repair. When few elements are inverted, repair comes before further steps.
  void morph_volume(PhaseClock& clock, MorphResult& result, VolumeMorphResult* one_step) const {
    SteppingOptions how = stepping();
    const bool is_free = how.steps == 0 && options.untangle != UntangleMode::Never;
    if (is_free) how.few = std::max<Index>(1, mesh().cell_count() / kFewCells);
    step_and_untangle(result.surface_positions, how, clock, result, one_step);
    const SteppingAttempt last = result.report.stepping.attempts.back();
    const bool is_cut_short = last.inverted > last.held && last.inverted - last.held <= how.few;
    if (!is_free || !is_cut_short || result.validity.invalid <= last.held) return;
    how.few = 0;
    MorphResult more;
    step_and_untangle(result.surface_positions, how, clock, more, nullptr);
    if (more.validity.invalid >= result.validity.invalid) return;
    result.positions = std::move(more.positions);
    result.validity = std::move(more.validity);
    result.report.solver = std::move(more.report.solver);
    result.report.stepping = std::move(more.report.stepping);
    result.report.untangling = std::move(more.report.untangling);
  }

  void step_and_untangle(const Points& surface_positions, const SteppingOptions& how,
                         PhaseClock& clock, MorphResult& result,
                         VolumeMorphResult* one_step) const {
    clock.start("volume morph");
    SteppingResult stepped = morph_in_steps(mesh(), *volume, surface_positions, orientation, how,
                                            path(surface_positions), one_step);
    result.positions = std::move(stepped.positions);
    result.validity = stepped.report.validity;
    result.report.solver = stepped.report.rbf;
    result.report.stepping = std::move(stepped.report);
    clock.start("untangling");
    untangle_result(result);
  }

  void move_surface(const CadModel& variant, MorphResult& result) const {
    SurfaceMorphResult moved = surface->morph(variant, result.match);
    PipelineReport& figures = result.report;
    result.surface_positions = prescribed(moved.positions);
    result.surface_distance = std::move(moved.distance);
    figures.after.max_distance = moved.max_distance;
    figures.after.mean_distance = moved.mean_distance;
    figures.warnings.insert(figures.warnings.end(), moved.warnings.begin(), moved.warnings.end());
  }

  // In one step for all together; nothing where more steps were asked for.
  std::vector<VolumeMorphResult> first_steps(std::vector<MorphAttempt>& attempts) const {
    std::vector<VolumeMorphResult> result;
    if (stepping().steps > 1) return result;
    std::vector<Points> targets;
    for (const MorphAttempt& attempt : attempts)
      targets.push_back(attempt.result.surface_positions);
    try {
      result = volume->morph_each(targets);
    } catch (...) {
      for_each_good(attempts, [](std::size_t, const MorphResult&) { throw; });
    }
    return result;
  }

  void finish(MorphResult& result, VolumeMorphResult* one_step) const {
    PhaseClock clock(options.progress);
    morph_volume(clock, result, one_step);
    clock.start("quality after");
    measure(result);
    for (const PhaseTime& phase : clock.phases()) result.report.phases.push_back(phase);
  }

  void measure(MorphResult& result) const {
    result.quality = measure_quality(mesh(), result.positions, orientation);
    improve_result(result);
    PipelineReport& figures = result.report;
    set_quality(figures.after, result.quality, result.validity,
                check_quality(mesh(), result.positions, neighbours, orientation));
    figures.max_displacement =
        figures.mesh_unit_mm * (result.positions - mesh().points).rowwise().norm().maxCoeff();
    judge(result, result.surface_positions);
  }

  void untangle_result(MorphResult& result) const {
    if (options.untangle == UntangleMode::Never || result.validity.invalid == 0) return;
    UntangleOptions how;
    how.progress = options.progress;
    UntangleResult repaired = untangle(mesh(), result.positions, fixed_nodes(), orientation, how);
    result.report.untangling = repaired.report;
    result.positions = std::move(repaired.positions);
    result.validity = std::move(repaired.report.validity);
  }

  // Raises poor cells; keeps the result as it was where that does not lift the worst of them.
  void improve_result(MorphResult& result) const {
    if (!options.improve_below || result.validity.invalid > 0) return;
    UntangleOptions how;
    how.progress = options.progress;
    how.attempts = 1;
    how.poor_cells = cells_below(*options.improve_below, result.quality);
    const auto poor = static_cast<Index>(how.poor_cells.size());
    if (poor == 0) return;
    UntangleResult improved = untangle(mesh(), result.positions, fixed_nodes(), orientation, how);
    QualityReport now = measure_quality(mesh(), improved.positions, orientation);
    ImproveReport report{*options.improve_below, poor, poor, result.quality.min,
                         result.quality.min};
    if (improved.report.after == 0 && now.min > result.quality.min) {
      report.poor_after = static_cast<Index>(cells_below(report.below, now).size());
      report.min_after = now.min;
      result.positions = std::move(improved.positions);
      result.quality = std::move(now);
    }
    result.report.improving = report;
  }

  std::vector<Index> cells_below(double limit, const QualityReport& measured) const {
    std::vector<Index> result;
    for (Index c = 0; c < mesh().cell_count(); ++c)
      if (measured.values[c] < limit) result.push_back(c);
    return result;
  }

  // Cells the result is refused for: invalid ones, and those whose corners inverted on the way.
  std::vector<Index> inverted_cells(const MorphResult& result) const {
    return sorted_union(result.validity.invalid_cells,
                        sorted_difference(result.quality.inverted_cells, quality.inverted_cells));
  }

  std::vector<Index> poor_cells(const MorphResult& result) const {
    if (!options.min_scaled_jacobian) return {};
    return cells_below(*options.min_scaled_jacobian, result.quality);
  }

  std::vector<Index> bad_cells(const MorphResult& result) const {
    return sorted_union(inverted_cells(result), poor_cells(result));
  }

  void judge(MorphResult& result, const Points& surface_positions) const {
    const auto bad = bad_cells(result);
    if (bad.empty()) return;
    PipelineReport& figures = result.report;
    figures.outcome = inverted_cells(result).empty() ? Outcome::PoorQuality : Outcome::Inverted;
    const Points full = volume->morph(surface_positions);
    const auto positions_at = [&](double share) -> Points {
      return mesh().points + share * (full - mesh().points);
    };
    figures.diagnosis = diagnose(*base, mesh(), boundary, surface->association(), bad, orientation,
                                 fixed_nodes(), positions_at);
    figures.diagnosis->worst_cell = worst_of(bad, result.quality);
    figures.diagnosis->location = centre_of(figures.diagnosis->worst_cell, result.positions);
    figures.diagnosis->advice = advice(figures);
  }

  static Index worst_of(const std::vector<Index>& cells, const QualityReport& quality) {
    return *std::ranges::min_element(cells, {}, [&](Index c) {
      return std::isnan(quality.values[c]) ? 1.0 : quality.values[c];
    });
  }

  Eigen::Vector3d centre_of(Index cell, const Points& positions) const {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (const Index node : mesh().cell(cell)) sum += positions.row(node).transpose();
    return sum / static_cast<double>(mesh().cell(cell).size());
  }

  std::vector<std::string> advice(const PipelineReport& figures) const {
    std::vector<std::string> lines;
    if (figures.diagnosis->bad_in_base > 0)
      lines.push_back("repair the input mesh: " + std::to_string(figures.diagnosis->bad_in_base) +
                      " of these cells are inverted in it already");
    if (figures.diagnosis->held_cells > 0)
      lines.push_back(
          "refine the mesh: " + std::to_string(figures.diagnosis->held_cells) +
          " of these cells are held inverted by their surface nodes alone (all nodes lie on "
          "the surface, or a facet on it turns a corner inwards)");
    if (figures.outcome == Outcome::PoorQuality && !options.improve_below)
      lines.push_back("raise the poor cells: --improve " +
                      short_number(*options.min_scaled_jacobian));
    if (figures.outcome == Outcome::Inverted && options.untangle == UntangleMode::Never)
      lines.push_back("let the inverted cells be repaired: --untangle auto");
    if (figures.outcome == Outcome::Inverted && options.stepping.steps > 0)
      lines.push_back("let the number of steps grow: --steps auto");
    const double share = figures.diagnosis->first_inversion;
    if (share > 0 && share < 1)
      lines.push_back(
          "morph to a smaller change (below " + percent(share) +
          " of this one), go there by CAD models between (--via), or remesh there with more "
          "elements across the moved gap");
    return lines;
  }

  PipelineOptions options;
  std::shared_ptr<const CadModel> base;
  std::shared_ptr<const MeshFile> mesh_file;
  std::optional<Mesh> moved;  ///< the file's mesh where the job starts elsewhere
  Boundary boundary;
  Orientation orientation;
  CellNeighbours neighbours;
  QualityReport quality;
  ValidityReport validity;
  std::optional<SurfaceMorph> surface;
  std::optional<VolumeMorph> volume;
  std::vector<Index> rows;  ///< of Boundary::nodes, prescribed
  PipelineReport report;    ///< of the base side
};

MorphJob::MorphJob(std::shared_ptr<const CadModel> base, std::shared_ptr<const MeshFile> mesh,
                   PipelineOptions options, Points start)
    : impl_(std::make_unique<Impl>(std::move(base), std::move(mesh), std::move(options),
                                   std::move(start))) {}

MorphJob::~MorphJob() = default;
MorphJob::MorphJob(MorphJob&&) noexcept = default;

const CadModel& MorphJob::base() const { return *impl_->base; }
const Mesh& MorphJob::mesh() const { return impl_->mesh(); }
const Boundary& MorphJob::boundary() const { return impl_->boundary; }
const Association& MorphJob::association() const { return impl_->surface->association(); }
const CellNeighbours& MorphJob::neighbours() const { return impl_->neighbours; }
const Orientation& MorphJob::orientation() const { return impl_->orientation; }
const QualityReport& MorphJob::base_quality() const { return impl_->quality; }

MorphResult MorphJob::morph(const CadModel& variant) const {
  MorphAttempt attempt = std::move(morph_each({variant}).front());
  if (attempt.error) std::rethrow_exception(attempt.error);
  return std::move(attempt.result);
}

std::vector<MorphAttempt> MorphJob::morph_each(const std::vector<CadModel>& variants) const {
  const Impl& job = *impl_;
  PhaseClock clock(job.options.progress);
  std::vector<MorphAttempt> attempts(variants.size());
  clock.start("matching");
  for_each_good(attempts, [&](std::size_t i, MorphResult& result) {
    result.report = job.report;
    result.match = job.match(variants[i], result.report);
  });
  clock.start("surface morph");
  for_each_good(attempts,
                [&](std::size_t i, MorphResult& result) { job.move_surface(variants[i], result); });
  clock.start("volume morph");
  std::vector<VolumeMorphResult> first = job.first_steps(attempts);
  for (PhaseTime phase : clock.phases()) {
    phase.seconds /= static_cast<double>(std::max<std::size_t>(variants.size(), 1));
    for (MorphAttempt& attempt : attempts) attempt.result.report.phases.push_back(phase);
  }
  for_each_good(attempts, [&](std::size_t i, MorphResult& result) {
    job.finish(result, first.empty() ? nullptr : &first[i]);
  });
  return attempts;
}

namespace {

void add_diagnostics(const MorphJob& job, const Points& original, const MorphResult& result,
                     ExtraArrays& extra) {
  const Mesh& mesh = job.mesh();
  const Association& association = job.association();
  const auto& nodes = job.boundary().nodes;
  constexpr int kInterior = 3;
  std::vector<int> dimensions(mesh.node_count(), kInterior), entities(mesh.node_count(), 0);
  RowMatrix uv = RowMatrix::Zero(mesh.node_count(), 2);
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    if (association.is_free[i]) continue;
    dimensions[nodes[i]] = static_cast<int>(association.dimension[i]);
    entities[nodes[i]] = association.entity[i] + 1;
    if (association.entity[i] >= 0) uv.row(nodes[i]) = association.uv.row(i);
  }
  RowMatrix jacobians(mesh.cell_count(), 1);
  for (Index c = 0; c < mesh.cell_count(); ++c)
    jacobians(c, 0) = std::isnan(result.quality.values[c])
                          ? scaled_jacobian(mesh, result.positions, c)
                          : result.quality.values[c];
  extra.point_arrays["cadmorph_displacement"] = result.positions - original;
  extra.point_integers["cadmorph_cad_dimension"] = std::move(dimensions);
  extra.point_integers["cadmorph_cad_entity"] = std::move(entities);
  extra.point_arrays["cadmorph_uv"] = std::move(uv);
  extra.cell_arrays["cadmorph_scaled_jacobian"] = std::move(jacobians);
}

}  // namespace

DeformationTerms MorphJob::deformation(const MorphResult& result) const {
  const Impl& job = *impl_;
  DeformationTerms terms = about_file(job.mesh_file->path(), [&] {
    return record_deformation(mesh(), *job.volume, result.surface_positions,
                              result.report.stepping.steps, job.path(result.surface_positions));
  });
  terms.mesh_unit_mm = result.report.mesh_unit_mm;
  return terms;
}

fs::path MorphJob::write(const MorphResult& result, const fs::path& output,
                         bool has_diagnostics) const {
  ExtraArrays extra;
  if (has_diagnostics) add_diagnostics(*this, impl_->mesh_file->mesh().points, result, extra);
  fs::path path = output;
  if (result.report.outcome != Outcome::Done) {
    path = failed_path(output);
    std::vector<int> is_bad(mesh().cell_count(), 0);
    for (const Index c : impl_->bad_cells(result)) is_bad[c] = 1;
    extra.cell_integers["cadmorph_bad"] = std::move(is_bad);
  }
  try {
    impl_->mesh_file->write(path, result.positions, extra);
  } catch (const IoError& error) {
    throw OutputError(error.what());
  }
  return path;
}

}  // namespace cadmorph
