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
// Of the most work of a repair: for inner nodes first, then for those of the surface with them.
// Both have all of it where that was not enough. Cells at an edge that turns are repaired in a
// thousandth of it once nodes slide on that edge, after inner nodes spent all of it in vain. With
// 0.02 the same of 21 pairs are valid, in the same time; their figures differ by chance.
constexpr double kShortWork = 0.05;

// Takes a repair for the last of those that the result had.
void take(UntangleResult&& repaired, MorphResult& result) {
  const std::optional<UntangleReport> last = std::move(result.report.untangling);
  result.report.untangling = repaired.report;
  if (last) {
    result.report.untangling->before = last->before;
    result.report.untangling->seconds += last->seconds;
  }
  result.positions = std::move(repaired.positions);
  result.validity = std::move(repaired.report.validity);
}

// Repairs inverted cells by the inner nodes, with that share of the most work.
void repair_inside(const BaseSide& base, Bending bending, double work, MorphResult& result) {
  UntangleOptions how;
  how.progress = base.options.progress;
  how.may_bend_all = bending == Bending::All;
  how.most_work = work;
  take(untangle(base.mesh(), result.positions, base.fixed_nodes(), base.orientation, how), result);
}

// Repairs all of them by the surface's nodes, too, or leaves the mesh as it is. Returns false where
// that came nowhere near.
bool repair_by_sliding(const BaseSide& base, Bending bending, double work, Sliding& sliding,
                       MorphResult& result) {
  UntangleOptions how;
  how.progress = base.options.progress;
  how.sliding = sliding.nodes();
  how.may_bend_all = bending == Bending::All;
  how.most_work = work;
  how.attempts = 6;
  // Few rings first: surface nodes stay where the CAD's parameters put them, but where they can't.
  for (how.rings = 1; how.rings <= kMostFirstRings; how.rings *= 2) {
    UntangleResult repaired =
        untangle(base.mesh(), result.positions, base.fixed_nodes(), base.orientation, how);
    if (repaired.report.after > 0) return !repaired.report.fell_short;
    if (sliding.is_folded(repaired.positions, repaired.slides)) continue;
    sliding.move_to(std::move(repaired.slides));
    take(std::move(repaired), result);
    settle_slid_nodes(base, result);
    break;
  }
  return true;
}

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

double kept_shape(const BaseSide& base, const MorphResult& result) {
  const Mesh& mesh = base.mesh();
  std::optional<FiniteVolumes> volumes;
  if (is_for_finite_volumes(base))
    volumes.emplace(mesh, mesh.points, base.neighbours, base.orientation);
  return volumes && volumes->has_cells()
             ? sum_of_shares(worst_faces(*volumes, result.positions),
                             worst_faces(*volumes, mesh.points))
             : sum_of_shares(worst_cells(result.quality), worst_cells(base.quality));
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
  repair_inside(base, bending, bending == Bending::All ? 1 : kShortWork, result);
}

bool slide_surface(const BaseSide& base, Bending bending, Sliding& sliding, MorphResult& result) {
  if (base.options.untangle == UntangleMode::Never || result.validity.invalid == 0) return true;
  const auto is_sound = [&] {  // inner nodes alone are to repair what the input mesh has inverted
    return std::ranges::includes(base.validity.invalid_cells, result.validity.invalid_cells);
  };
  if (bending == Bending::Some) {
    if (!is_sound()) repair_by_sliding(base, bending, kShortWork, sliding, result);
    if (result.validity.invalid > 0) repair_inside(base, bending, 1, result);
  }
  return is_sound() || repair_by_sliding(base, bending, 1, sliding, result);
}

}  // namespace cadmorph
