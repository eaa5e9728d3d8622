#include "apps/pipeline/pipeline.h"

#include <algorithm>
#include <cmath>
#include <mutex>
#include <sstream>

#include "apps/pipeline/morph_derivative.h"
#include "apps/pipeline/refusal.h"
#include "apps/pipeline/volume_stage.h"
#include "core/errors.h"

namespace cadmorph {
namespace {

namespace fs = std::filesystem;

// A file may name another unit than its numbers are in.
void check_unit(const CadModel& base, const CadModel& variant, PipelineReport& figures) {
  constexpr double kOtherUnit = 5;  // cm for mm and the like
  const double ratio = variant.diagonal() / base.diagonal();
  if (base.file_unit() == variant.file_unit() || (ratio < kOtherUnit && ratio * kOtherUnit > 1))
    return;
  std::ostringstream text;
  text << variant.file_name() << " (unit " << variant.file_unit() << ") is " << ratio
       << " times the size of " << base.file_name() << " (unit " << base.file_unit()
       << "): if that is not meant, one of them names the wrong unit";
  figures.warnings.push_back(text.str());
}

void warn_of_merge(const CadModel& model, PipelineReport& figures) {
  if (model.merged_face_count() == 0) return;
  figures.warnings.push_back(model.file_name() + ": " + std::to_string(model.merged_face_count()) +
                             " faces were merged with others of the same surface, for the other "
                             "model has them in one piece");
}

TopologyMatch match(const MorphBase& base, const CadModel& variant, PipelineReport& figures) {
  TopologyMatch result = match_topology(*base.cad, variant, {.given_faces = base.options.face_map});
  figures.variant_cad = figures_of(variant);
  check_unit(*base.cad, variant, figures);
  warn_of_merge(*base.cad, figures);
  warn_of_merge(variant, figures);
  figures.matched_by = result.how;
  figures.alignment = result.alignment;
  if (!result.face_confidence.empty())
    figures.least_confidence = std::ranges::min(result.face_confidence);
  return result;
}

void move_surface(const MorphBase& base, const CadModel& variant, MorphResult& result) {
  result.surface = base.surface->morph(variant, result.match);
  result.surface_positions = base.prescribed(result.surface.positions);
  result.report.warnings.insert(result.report.warnings.end(), result.surface.warnings.begin(),
                                result.surface.warnings.end());
  for (const auto& [what, faces] : result.surface.remedies) {
    std::string note = what + ": ";
    for (const std::string& face : faces) note += (face == faces.front() ? "" : "; ") + face;
    result.report.notes.push_back(std::move(note));
  }
}

// Numbers of CAD entities as `cadmorph match` prints them, from 1.
class EntityNumbers {
 public:
  explicit EntityNumbers(const CadModel& matched) : skeleton_(matched.skeleton()) {}

  // 0 for no entity, and for a vertex that only cuts a smooth edge of `match`.
  int operator()(CadDimension dimension, int entity) const {
    if (entity < 0) return 0;
    if (dimension == CadDimension::Vertex) return skeleton_.corner_of_vertex[entity] + 1;
    if (dimension == CadDimension::Edge) return skeleton_.curve_of_edge[entity] + 1;
    return entity + 1;
  }

 private:
  const CadSkeleton& skeleton_;
};

void add_diagnostics(const MorphJob& job, const Points& original, const MorphResult& result,
                     ExtraArrays& extra) {
  const Mesh& mesh = job.mesh();
  const Association& association = job.association();
  const auto& nodes = job.boundary().nodes;
  constexpr int kInterior = 3;
  std::vector<int> dimensions(mesh.node_count(), kInterior), entities(mesh.node_count(), 0);
  RowMatrix uv = RowMatrix::Zero(mesh.node_count(), 2);
  const CadModel matched = result.match.joins_edges ? job.base().with_joined_edges() : job.base();
  const EntityNumbers number(matched);
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    if (association.is_free[i]) continue;
    dimensions[nodes[i]] = static_cast<int>(association.dimension[i]);
    entities[nodes[i]] = number(association.dimension[i], association.entity[i]);
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

bool is_topology_error(const std::exception_ptr& error) {
  if (!error) return false;
  try {
    std::rethrow_exception(error);
  } catch (const TopologyError&) {
    return true;
  } catch (...) {
    return false;
  }
}

}  // namespace

// The job of the base CAD with its cut faces merged, from the first variant on that asks for it.
struct MorphJob::Merged {
  std::mutex mutex;
  std::optional<MorphJob> job;
};

MorphJob::MorphJob(std::shared_ptr<const CadModel> base, std::shared_ptr<const MeshFile> mesh,
                   PipelineOptions options, Points start)
    : base_(std::make_unique<const MorphBase>(std::move(base), std::move(mesh), std::move(options),
                                              std::move(start))),
      merged_(std::make_unique<Merged>()) {}

MorphJob::~MorphJob() = default;
MorphJob::MorphJob(MorphJob&&) noexcept = default;

const CadModel& MorphJob::base() const { return *base_->cad; }
const VolumeMorph& MorphJob::volume() const { return *base_->volume; }
const Mesh& MorphJob::mesh() const { return base_->mesh(); }
const Boundary& MorphJob::boundary() const { return base_->boundary; }
const Association& MorphJob::association() const { return base_->surface->association(); }
const CellNeighbours& MorphJob::neighbours() const { return base_->neighbours; }
const Orientation& MorphJob::orientation() const { return base_->orientation; }
const QualityReport& MorphJob::base_quality() const { return base_->quality; }
const CacheReport& MorphJob::cache() const { return base_->report.cache; }
const PipelineReport& MorphJob::base_report() const { return base_->report; }

MorphResult MorphJob::morph(const CadModel& variant) const {
  MorphAttempt attempt = std::move(morph_each({variant}).front());
  if (attempt.error) std::rethrow_exception(attempt.error);
  return std::move(attempt.result);
}

std::vector<MorphAttempt> MorphJob::morph_each(const std::vector<CadModel>& variants) const {
  const MorphBase& base = *base_;
  PhaseClock clock(base.options.progress);
  std::vector<MorphAttempt> attempts(variants.size());
  clock.start("matching");
  for_each_good(attempts, [&](std::size_t i, MorphResult& result) {
    result.report = base.report;
    result.variant = variants[i];
    result.match = match(base, variants[i], result.report);
  });
  clock.start("surface morph");
  for_each_good(attempts, [&](std::size_t i, MorphResult& result) {
    move_surface(base, variants[i], result);
  });
  clock.start("volume morph");
  std::vector<VolumeMorphResult> first = first_steps(base, attempts);
  for (PhaseTime phase : clock.phases()) {
    phase.seconds /= static_cast<double>(std::max<std::size_t>(variants.size(), 1));
    for (MorphAttempt& attempt : attempts) attempt.result.report.phases.push_back(phase);
  }
  for_each_good(attempts, [&](std::size_t i, MorphResult& result) {
    finish(base, variants[i], result, first.empty() ? nullptr : &first[i]);
  });
  for (std::size_t i = 0; i < variants.size(); ++i)
    if (is_topology_error(attempts[i].error)) morph_merged(variants[i], attempts[i]);
  return attempts;
}

Points MorphJob::slide(const Points& surface_positions) const {
  return base_->prescribed(base_->surface->slide(base_->on_boundary(surface_positions)));
}

MorphDerivative MorphJob::derivative(const Points& surface_positions, bool is_sliding) const {
  VolumeDerivative map = volume().derivative(surface_positions);
  if (!is_sliding) return MorphDerivative(std::move(map));
  return {std::move(map), base_->surface->slide_derivative(base_->on_boundary(surface_positions)),
          base_->rows, std::ssize(base_->boundary.nodes)};
}

MorphResult MorphJob::morph_surface(const CadModel& variant) const {
  try {
    MorphResult result;
    result.report = base_->report;
    result.variant = variant;
    result.match = match(*base_, variant, result.report);
    move_surface(*base_, variant, result);
    return result;
  } catch (const TopologyError&) {
    const auto pair = merge_cut_faces(base(), variant, {.given_faces = base_->options.face_map});
    if (!pair) throw;
    const bool is_base_merged = pair->base.merged_face_count() > base().merged_face_count();
    return (is_base_merged ? merged_job(pair->base) : *this).morph_surface(pair->variant);
  }
}

void MorphJob::morph_merged(const CadModel& variant, MorphAttempt& refused) const {
  try {
    const auto pair = merge_cut_faces(base(), variant, {.given_faces = base_->options.face_map});
    if (!pair) return;
    const bool is_base_merged = pair->base.merged_face_count() > base().merged_face_count();
    refused.error = nullptr;
    refused.result = (is_base_merged ? merged_job(pair->base) : *this).morph(pair->variant);
    refused.result.is_base_merged = is_base_merged;
  } catch (...) {
    refused.error = std::current_exception();
  }
}

const MorphJob& MorphJob::merged_job(const CadModel& merged_base) const {
  const std::lock_guard lock(merged_->mutex);
  if (!merged_->job) {
    PipelineOptions options = base_->options;
    options.cache.clear();
    merged_->job.emplace(std::make_shared<const CadModel>(merged_base), base_->mesh_file,
                         std::move(options), base_->moved ? base_->moved->points : Points());
  }
  return *merged_->job;
}

const MorphJob& MorphJob::of(const MorphResult& result) const {
  return result.is_base_merged ? *merged_->job : *this;
}

DeformationTerms MorphJob::deformation(const MorphResult& result) const {
  const MorphBase& base = *base_;
  DeformationTerms terms = about_file(base.mesh_file->path(), [&] {
    return record_deformation(mesh(), *base.volume, result.surface_positions,
                              result.report.stepping.steps, base.path(result.surface_positions));
  });
  terms.mesh_unit_mm = result.report.mesh_unit_mm;
  return terms;
}

WrittenMesh MorphJob::write(const MorphResult& result, const fs::path& output,
                            bool has_diagnostics) const {
  ExtraArrays extra;
  WrittenMesh written;
  if (has_diagnostics) add_diagnostics(*this, base_->mesh_file->mesh().points, result, extra);
  fs::path path = output;
  if (result.report.outcome != Outcome::Done) {
    path = failed_path(output);
    std::vector<int> is_bad(mesh().cell_count(), 0);
    for (const Index c : bad_cells(*base_, result)) is_bad[c] = 1;
    extra.cell_integers["cadmorph_bad"] = std::move(is_bad);
  }
  const MeshFile& file = *base_->mesh_file;
  as_output([&] {
    if (!file.takes_arrays(path) && has_diagnostics) {
      written.diagnostics = vtu_path(path, ".diagnostics");
      file.write(written.diagnostics, result.positions, std::exchange(extra, {}));
    }
    written.rounding = file.write(path, result.positions, extra);
  });
  written.path = path;
  return written;
}

}  // namespace cadmorph
