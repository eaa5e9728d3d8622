#include "apps/pipeline/morph_job.h"

#include <algorithm>
#include <map>
#include <mutex>
#include <utility>

#include "apps/pipeline/morph_derivative.h"
#include "apps/pipeline/surface_stage.h"
#include "apps/pipeline/volume_stage.h"
#include "cad/alignment.h"
#include "core/errors.h"

namespace cadmorph {

struct MorphJob::Impl {
  explicit Impl(std::shared_ptr<BaseSide> side) : base(std::move(side)) {}

  MorphResult match(const CadModel& variant) {
    MatchedModels found =
        match_models(*base->cad, variant, {.given_faces = base->options.face_map});
    if (is_mirror_image(found.base, found.variant, found.match))
      throw TopologyError(
          variant.file_name() + " is the mirror image of " + base->cad->file_name() +
          ", or nearly so: on it, the mesh would be turned inside out. Mirror the variant's CAD, "
          "morph onto that, and mirror the morphed mesh, the order of its nodes, too");
    const bool is_base_merged = found.base.merged_face_count() > base->cad->merged_face_count();
    return begin_result(is_base_merged ? merged_base(found.base) : base, found.variant,
                        std::move(found.match));
  }

  void linearise(const std::vector<Points>& surface_positions) {
    VolumeMorph linear = base->volume->linearised(surface_positions);
    const std::lock_guard lock(mutex_);
    std::vector<VolumeMorph> of_merged;
    for (const auto& [count, side] : merged_)
      of_merged.push_back(linearised(*side, surface_positions));
    auto next = of_merged.begin();
    for (auto& [count, side] : merged_) side->volume = std::move(*next++);
    base->volume = std::move(linear);
    references_ = surface_positions;
  }

  std::shared_ptr<BaseSide> base;

 private:
  // Faces merged or not, the nodes that the CAD prescribes are the same as a rule.
  VolumeMorph linearised(const BaseSide& side, const std::vector<Points>& references) const {
    if (side.volume->surface_nodes() != base->volume->surface_nodes())
      throw InvalidInputError(
          "models whose faces have to be merged prescribe other nodes than the base: write them "
          "with the faces of the base, or don't linearise the morph");
    return side.volume->linearised(references);
  }

  std::shared_ptr<const BaseSide> merged_base(const CadModel& cad) {
    const std::lock_guard lock(mutex_);
    std::shared_ptr<BaseSide>& kept = merged_[cad.merged_face_count()];
    if (!kept) {
      PipelineOptions options = base->options;
      options.cache.clear();
      const auto merged = std::make_shared<BaseSide>(
          std::make_shared<const CadModel>(cad), base->mesh_file, std::move(options),
          base->starts_elsewhere ? base->mesh().points : Points());
      merged->report.run.phases = base->report.run.phases;  // its own are a part of the matching
      if (!references_.empty()) merged->volume = linearised(*merged, references_);
      kept = merged;
    }
    return kept;
  }

  std::mutex mutex_;
  /// By the number of merged faces, each from the first variant on that asks for it.
  std::map<int, std::shared_ptr<BaseSide>> merged_;
  std::vector<Points> references_;  ///< that the volume morph is linearised for
};

MorphJob::MorphJob(std::shared_ptr<const CadModel> base, std::shared_ptr<const MeshFile> mesh,
                   PipelineOptions options, Points start)
    : impl_(std::make_unique<Impl>(std::make_shared<BaseSide>(
          std::move(base), std::move(mesh), std::move(options), std::move(start)))) {}

MorphJob::~MorphJob() = default;
MorphJob::MorphJob(MorphJob&&) noexcept = default;

const BaseSide& MorphJob::base() const { return *impl_->base; }

MorphResult MorphJob::morph(const CadModel& variant) const {
  MorphAttempt attempt = std::move(morph_each({variant}).front());
  if (attempt.error) std::rethrow_exception(attempt.error);
  return std::move(attempt.result);
}

std::vector<MorphAttempt> MorphJob::morph_each(const std::vector<CadModel>& variants) const {
  PhaseClock clock(base().options.progress);
  std::vector<MorphAttempt> attempts(variants.size());
  clock.start("matching");
  for_each_good(attempts,
                [&](std::size_t i, MorphResult& result) { result = impl_->match(variants[i]); });
  clock.start("surface morph");
  for_each_good(attempts, [](std::size_t, MorphResult& result) { move_surface(result); });
  clock.start("volume morph");
  std::vector<std::optional<VolumeMorphResult>> first = first_steps(attempts);
  for (PhaseTime phase : clock.phases()) {
    phase.seconds /= static_cast<double>(std::max<std::size_t>(variants.size(), 1));
    for (MorphAttempt& attempt : attempts) attempt.result.report.run.phases.push_back(phase);
  }
  for_each_good(attempts, [&](std::size_t i, MorphResult& result) {
    move_volume(result, first[i] ? &*first[i] : nullptr);
  });
  return attempts;
}

MorphResult MorphJob::morph_surface(const CadModel& variant) const {
  MorphResult result = impl_->match(variant);
  move_surface(result);
  return result;
}

Points MorphJob::slide(const Points& surface_positions) const {
  return base().prescribed(base().surface->slide(base().on_boundary(surface_positions)));
}

void MorphJob::linearise(const std::vector<CadModel>& models) {
  if (models.empty()) throw InvalidInputError("no model is given to linearise the morph for");
  std::vector<Points> moved;
  for (const CadModel& model : models) {
    Points positions = morph_surface(model).surface_positions;
    if (base().is_at_base(positions)) continue;
    moved.push_back(std::move(positions));
  }
  if (moved.empty())
    throw InvalidInputError(
        "no model that is given to linearise the morph for moves the surface of " +
        base().cad->file_name() + ": give models of the parameters a step away");
  impl_->linearise(moved);
}

MorphDerivative MorphJob::derivative(const Points& surface_positions, bool is_sliding) const {
  VolumeDerivative map = base().volume->derivative(surface_positions);
  if (!is_sliding) return MorphDerivative(std::move(map));
  return {std::move(map), base().surface->slide_derivative(base().on_boundary(surface_positions)),
          base().rows, std::ssize(base().boundary.nodes)};
}

}  // namespace cadmorph
