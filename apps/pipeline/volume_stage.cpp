#include "apps/pipeline/volume_stage.h"

#include "apps/pipeline/refusal.h"

namespace cadmorph {
namespace {

// Inverted cells are few when they are at most one in so many.
constexpr Index kFewCells = 10'000;

SteppingOptions stepping(const MorphBase& base) {
  SteppingOptions result = base.options.stepping;
  if (base.options.untangle == UntangleMode::Always && result.steps == 0) result.steps = 1;
  if (base.options.untangle == UntangleMode::Never) result.least_gain_share = 1;
  return result;
}

void untangle_result(const MorphBase& base, MorphResult& result) {
  if (base.options.untangle == UntangleMode::Never || result.validity.invalid == 0) return;
  UntangleOptions how;
  how.progress = base.options.progress;
  UntangleResult repaired =
      untangle(base.mesh(), result.positions, base.fixed_nodes(), base.orientation, how);
  result.report.untangling = repaired.report;
  result.positions = std::move(repaired.positions);
  result.validity = std::move(repaired.report.validity);
}

void step_and_untangle(const MorphBase& base, const Points& surface_positions,
                       const SteppingOptions& how, PhaseClock& clock, MorphResult& result,
                       VolumeMorphResult* one_step) {
  clock.start("volume morph");
  SteppingResult stepped =
      morph_in_steps(base.mesh(), *base.volume, surface_positions, base.orientation, how,
                     base.path(surface_positions), one_step);
  result.positions = std::move(stepped.positions);
  result.validity = stepped.report.validity;
  result.report.solver = stepped.report.rbf;
  result.report.stepping = std::move(stepped.report);
  clock.start("untangling");
  untangle_result(base, result);
}

// Steps, then repair. When few elements are inverted, repair comes before further steps.
void morph_volume(const MorphBase& base, PhaseClock& clock, MorphResult& result,
                  VolumeMorphResult* one_step) {
  SteppingOptions how = stepping(base);
  const bool is_free = how.steps == 0 && base.options.untangle != UntangleMode::Never;
  if (is_free) how.few = std::max<Index>(1, base.mesh().cell_count() / kFewCells);
  step_and_untangle(base, result.surface_positions, how, clock, result, one_step);
  const SteppingAttempt last = result.report.stepping.attempts.back();
  const bool is_cut_short = last.inverted > last.held && last.inverted - last.held <= how.few;
  if (!is_free || !is_cut_short || result.validity.invalid <= last.held) return;
  how.few = 0;
  MorphResult more;
  step_and_untangle(base, result.surface_positions, how, clock, more, nullptr);
  if (more.validity.invalid >= result.validity.invalid) return;
  result.positions = std::move(more.positions);
  result.validity = std::move(more.validity);
  result.report.solver = std::move(more.report.solver);
  result.report.stepping = std::move(more.report.stepping);
  result.report.untangling = std::move(more.report.untangling);
}

// Raises poor cells; keeps the result as it was where that does not lift the worst of them.
void improve_result(const MorphBase& base, MorphResult& result) {
  if (!base.options.improve_below || result.validity.invalid > 0) return;
  UntangleOptions how;
  how.progress = base.options.progress;
  how.attempts = 1;
  how.poor_cells = cells_below(*base.options.improve_below, result.quality);
  const auto poor = static_cast<Index>(how.poor_cells.size());
  if (poor == 0) return;
  UntangleResult improved =
      untangle(base.mesh(), result.positions, base.fixed_nodes(), base.orientation, how);
  QualityReport now = measure_quality(base.mesh(), improved.positions, base.orientation);
  ImproveReport report{*base.options.improve_below, poor, poor, result.quality.min,
                       result.quality.min};
  if (improved.report.after == 0 && now.min > result.quality.min) {
    report.poor_after = static_cast<Index>(cells_below(report.below, now).size());
    report.min_after = now.min;
    result.positions = std::move(improved.positions);
    result.quality = std::move(now);
  }
  result.report.improving = report;
}

void measure(const MorphBase& base, MorphResult& result) {
  result.quality = measure_quality(base.mesh(), result.positions, base.orientation);
  improve_result(base, result);
  PipelineReport& figures = result.report;
  set_quality(figures.after, result.quality, result.validity,
              check_quality(base.mesh(), result.positions, base.neighbours, base.orientation));
  figures.max_displacement =
      figures.mesh_unit_mm * (result.positions - base.mesh().points).rowwise().norm().maxCoeff();
  judge(base, result);
}

}  // namespace

std::vector<VolumeMorphResult> first_steps(const MorphBase& base,
                                           std::vector<MorphAttempt>& attempts) {
  std::vector<VolumeMorphResult> result;
  if (stepping(base).steps > 1) return result;
  std::vector<Points> targets;
  for (const MorphAttempt& attempt : attempts) targets.push_back(attempt.result.surface_positions);
  try {
    result = base.volume->morph_each(targets);
  } catch (...) {
    for_each_good(attempts, [](std::size_t, const MorphResult&) { throw; });
  }
  return result;
}

void finish(const MorphBase& base, MorphResult& result, VolumeMorphResult* one_step) {
  PhaseClock clock(base.options.progress);
  morph_volume(base, clock, result, one_step);
  clock.start("quality after");
  measure(base, result);
  for (const PhaseTime& phase : clock.phases()) result.report.phases.push_back(phase);
}

}  // namespace cadmorph
