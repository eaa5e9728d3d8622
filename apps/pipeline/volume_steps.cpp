#include "apps/pipeline/volume_steps.h"

#include <algorithm>
#include <optional>
#include <utility>

namespace cadmorph {
namespace {

// The most rings of cells to start from, of 1, 2 and so on, until nodes slide without a fold.
constexpr int kMostFirstRings = 4;
// Inverted cells are few when they are at most one in so many. Then they are repaired before
// further steps: valves whose discs turn by 40 degrees took 5.6 s in place of 10.
constexpr Index kFewCells = 1'000;

}  // namespace

SteppingOptions stepping(const BaseSide& base) {
  SteppingOptions result = base.options.stepping;
  if (base.options.untangle == UntangleMode::Always && result.steps == 0) result.steps = 1;
  if (base.options.untangle == UntangleMode::Never) result.least_gain_share = 1;
  return result;
}

Index few_cells(const BaseSide& base) {
  return std::max<Index>(1, base.mesh().cell_count() / kFewCells);
}

bool is_free(const BaseSide& base) {
  return stepping(base).steps == 0 && base.options.untangle != UntangleMode::Never;
}

bool is_for_finite_volumes(const BaseSide& base) {
  const MeshUse use = base.options.mesh_use;
  return use == MeshUse::FiniteVolumes ||
         (use == MeshUse::OfFormat && base.mesh().is_of_finite_volumes);
}

void step_volume(const BaseSide& base, const Points& surface_positions, const SteppingOptions& how,
                 PhaseClock& clock, MorphResult& result, VolumeMorphResult* one_step) {
  clock.start("volume morph");
  SteppingResult stepped =
      morph_in_steps(base.mesh(), *base.volume, {surface_positions, base.path(surface_positions)},
                     base.orientation, how, one_step);
  result.positions = std::move(stepped.positions);
  result.validity = stepped.report.validity;
  result.report.solver = stepped.report.rbf;
  result.report.stepping = std::move(stepped.report);
}

void untangle_result(const BaseSide& base, Bending bending, MorphResult& result) {
  if (base.options.untangle == UntangleMode::Never || result.validity.invalid == 0) return;
  UntangleOptions how;
  how.progress = base.options.progress;
  how.may_bend_all = bending == Bending::All;
  UntangleResult repaired =
      untangle(base.mesh(), result.positions, base.fixed_nodes(), base.orientation, how);
  result.report.untangling = repaired.report;
  result.positions = std::move(repaired.positions);
  result.validity = std::move(repaired.report.validity);
}

bool slide_surface(const BaseSide& base, Bending bending, Sliding& sliding, MorphResult& result) {
  const auto& left = result.validity.invalid_cells;
  if (base.options.untangle == UntangleMode::Never ||
      std::ranges::includes(base.validity.invalid_cells, left))  // for the input mesh to repair
    return true;
  UntangleOptions how;
  how.progress = base.options.progress;
  how.sliding = sliding.nodes();
  how.may_bend_all = bending == Bending::All;
  how.attempts = 6;
  std::optional<UntangleResult> found;
  // Few rings first: surface nodes stay where the CAD's parameters put them, but where they can't.
  for (how.rings = 1; !found && how.rings <= kMostFirstRings; how.rings *= 2) {
    UntangleResult repaired =
        untangle(base.mesh(), result.positions, base.fixed_nodes(), base.orientation, how);
    if (repaired.report.after > 0) return !repaired.report.fell_short;
    if (!sliding.is_folded(repaired.positions, repaired.slides)) found = std::move(repaired);
  }
  if (!found) return true;
  UntangleResult& repaired = *found;
  repaired.report.before = result.report.untangling->before;
  repaired.report.seconds += result.report.untangling->seconds;
  result.report.untangling = repaired.report;
  result.positions = std::move(repaired.positions);
  result.validity = std::move(repaired.report.validity);
  sliding.move_to(std::move(repaired.slides));
  settle_slid_nodes(base, result);
  return true;
}

}  // namespace cadmorph
