#include "apps/pipeline/morph_job.h"

#include <algorithm>
#include <map>
#include <mutex>
#include <utility>

#include "apps/pipeline/morph_derivative.h"
#include "apps/pipeline/surface_stage.h"
#include "apps/pipeline/volume_stage.h"

namespace cadmorph {

struct MorphJob::Impl {
  explicit Impl(std::shared_ptr<const BaseSide> side) : base(std::move(side)) {}

  MorphResult match(const CadModel& variant) {
    MatchedModels found =
        match_models(*base->cad, variant, {.given_faces = base->options.face_map});
    const bool is_base_merged = found.base.merged_face_count() > base->cad->merged_face_count();
    return begin_result(is_base_merged ? merged_base(found.base) : base, found.variant,
                        std::move(found.match));
  }

  std::shared_ptr<const BaseSide> base;

 private:
  std::shared_ptr<const BaseSide> merged_base(const CadModel& cad) {
    const std::lock_guard lock(mutex_);
    std::shared_ptr<const BaseSide>& kept = merged_[cad.merged_face_count()];
    if (!kept) {
      PipelineOptions options = base->options;
      options.cache.clear();
      const auto merged = std::make_shared<BaseSide>(std::make_shared<const CadModel>(cad),
                                                     base->mesh_file, std::move(options),
                                                     base->moved ? base->moved->points : Points());
      merged->report.run.phases = base->report.run.phases;  // its own are a part of the matching
      kept = merged;
    }
    return kept;
  }

  std::mutex mutex_;
  /// By the number of merged faces, each from the first variant on that asks for it.
  std::map<int, std::shared_ptr<const BaseSide>> merged_;
};

MorphJob::MorphJob(std::shared_ptr<const CadModel> base, std::shared_ptr<const MeshFile> mesh,
                   PipelineOptions options, Points start)
    : impl_(std::make_unique<Impl>(std::make_shared<const BaseSide>(
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

MorphDerivative MorphJob::derivative(const Points& surface_positions, bool is_sliding) const {
  VolumeDerivative map = base().volume->derivative(surface_positions);
  if (!is_sliding) return MorphDerivative(std::move(map));
  return {std::move(map), base().surface->slide_derivative(base().on_boundary(surface_positions)),
          base().rows, std::ssize(base().boundary.nodes)};
}

}  // namespace cadmorph
