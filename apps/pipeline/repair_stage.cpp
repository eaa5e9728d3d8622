#include "apps/pipeline/repair_stage.h"

#include <algorithm>
#include <iterator>
#include <optional>
#include <utility>

#include "apps/pipeline/follow_stage.h"
#include "apps/pipeline/volume_steps.h"
#include "core/cell_topology.h"
#include "core/plane_mesh.h"
#include "volume/mid_nodes.h"

namespace cadmorph {
namespace {

// Further steps go on while each leaves at most this share of the inverted cells: of up to 1,000,
// while each leaves one fewer.
constexpr double kAnyGain = 0.999;

void step_and_untangle(const BaseSide& base, const Points& surface_positions,
                       const SteppingOptions& how, PhaseClock& clock, MorphResult& result,
                       VolumeMorphResult* one_step) {
  step_volume(base, surface_positions, how, clock, result, one_step);
  clock.start("untangling");
  untangle_result(base, Bending::Some, result);
}

void step_once(const BaseSide& base, VolumeMorphResult* one_step, PhaseClock& clock,
               MorphResult& result) {
  SteppingOptions how = stepping(base);
  how.steps = 1;
  step_volume(base, result.surface_positions, how, clock, result, one_step);
}

// What the step made, for others to start from in its place: the result's positions are gone.
VolumeMorphResult take_one_step(MorphResult& result) {
  return {.positions = std::move(result.positions), .report = result.report.solver, .error = {}};
}

// Steps, then repair. When few elements are inverted, repair comes before further steps
// (step_further).
void morph_volume(const BaseSide& base, PhaseClock& clock, MorphResult& result,
                  VolumeMorphResult* one_step) {
  SteppingOptions how = stepping(base);
  if (is_free(base)) how.few = few_cells(base);
  step_and_untangle(base, result.surface_positions, how, clock, result, one_step);
}

// Attempts end where one more step leaves nearly as many inverted, which most often are repaired.
// Where they were not, further steps from the base are tried for as long as each leaves fewer, with
// repair; what has fewer invalid elements is taken.
void step_further(const BaseSide& base, Sliding& sliding, PhaseClock& clock, MorphResult& result) {
  if (result.validity.invalid <= base.validity.invalid || !is_free(base)) return;
  SteppingOptions how = stepping(base);
  how.least_gain_share = kAnyGain;
  for (const SteppingAttempt& attempt : result.report.stepping.attempts)
    how.min_steps = std::max(how.min_steps, attempt.steps + 1);
  if (how.min_steps > how.max_steps) return;
  MorphResult before;
  take_volume(before, result);
  std::vector<SteppingAttempt> attempts = before.report.stepping.attempts;
  result.report.untangling.reset();
  step_and_untangle(base, result.surface_positions, how, clock, result, nullptr);
  slide_surface(base, Bending::Some, sliding, result);
  std::ranges::copy(result.report.stepping.attempts, std::back_inserter(attempts));
  if (result.validity.invalid >= before.validity.invalid) take_volume(result, before);
  result.report.stepping.attempts = std::move(attempts);
}

// Edges of second-order cells bend where nothing else has repaired them.
void repair_by_bending(const BaseSide& base, Sliding& sliding, PhaseClock& clock,
                       MorphResult& result) {
  if (result.validity.invalid <= base.validity.invalid || !result.report.untangling ||
      MidNodes(base.mesh(), result.positions).count() == 0)
    return;
  clock.start("untangling");
  untangle_result(base, Bending::All, result);
  slide_surface(base, Bending::All, sliding, result);
}

void follow(const BaseSide& base, Sliding& sliding, PhaseClock& clock, MorphResult& result) {
  if (const std::optional<WayToFollow> way = find_way_to_follow(base, sliding, result))
    let_surface_follow(base, *way, sliding, clock, result);
}

// Where one step leaves many inverted that none would be with the surface following, that comes
// before further steps, each of which costs as much. Returns whether all cells are valid so.
bool follow_at_once(const BaseSide& base, Sliding& sliding, PhaseClock& clock,
                    MorphResult& result) {
  result.quality = measure_quality(base.mesh(), result.positions, base.orientation);
  const std::optional<WayToFollow> way = find_way_to_follow(base, sliding, result);
  if (!way || !way->is_promising || way->estimate.inverted > 0) return false;
  Undo plain(sliding, result);
  if (let_surface_follow(base, *way, sliding, clock, result) &&
      result.validity.invalid <= base.validity.invalid)
    return true;
  plain.apply(sliding, result);
  return false;
}

// Moves and repairs the mesh with all of its nodes, not by corners first (go_by_corners). Returns
// whether steps and a repair by inner nodes were not enough.
bool move_plainly(const BaseSide& base, VolumeMorphResult* one_step, Sliding& sliding,
                  PhaseClock& clock, MorphResult& result) {
  std::optional<VolumeMorphResult> first;
  if (is_free(base)) {
    step_once(base, one_step, clock, result);
    if (result.validity.invalid == 0) return false;
    if (result.validity.invalid > few_cells(base) && follow_at_once(base, sliding, clock, result))
      return true;
    first = take_one_step(result);
    one_step = &*first;
  }
  morph_volume(base, clock, result, one_step);
  const bool is_inverted = result.validity.invalid > base.validity.invalid;
  if (is_inverted) {
    result.quality = measure_quality(base.mesh(), result.positions, base.orientation);
    follow(base, sliding, clock, result);
    clock.start("untangling");
  }
  if (slide_surface(base, Bending::Some, sliding, result))
    step_further(base, sliding, clock, result);
  repair_by_bending(base, sliding, clock, result);
  return is_inverted;
}

}  // namespace

bool has_corners_to_repair(const BaseSide& base) {
  return is_free(base) && dimension(base.mesh()) == 3 && has_second_order(base.mesh());
}

bool go_by_corners(const BaseSide& base, Sliding& sliding, PhaseClock& clock, MorphResult& result) {
  MorphResult corners;
  corners.base = base.straight();
  corners.variant = result.variant;
  corners.match = result.match;
  corners.surface = result.surface;
  corners.surface_positions = corners.base->prescribed(result.surface.positions);
  const SlidingNodes& nodes = *sliding.nodes();
  Sliding sliding_corners(corners, nodes);
  if (!move_plainly(*corners.base, nullptr, sliding_corners, clock, corners)) {
    corners.quality =
        measure_quality(corners.base->mesh(), corners.positions, corners.base->orientation);
    follow(*corners.base, sliding_corners, clock, corners);
  }
  const bool is_sound = corners.validity.invalid <= corners.base->validity.invalid;
  Undo plain(sliding, result);
  RowMatrix slides = sliding_corners.slides();
  const Points& plain_positions = plain.kept().positions;
  lay_mid_nodes(base.mesh(), base.fixed_nodes(), nodes, plain_positions, corners.positions, slides);
  result.positions = std::move(corners.positions);
  result.report.stepping = std::move(corners.report.stepping);
  result.report.solver = std::move(corners.report.solver);
  result.report.untangling = std::move(corners.report.untangling);
  result.report.followed_nodes = corners.report.followed_nodes;
  if (result.report.followed_nodes > 0)
    result.surface_positions = result.positions(base.volume->surface_nodes(), Eigen::all);
  sliding.move_to(std::move(slides));
  settle_slid_nodes(base, result);
  result.validity = check_validity(base.mesh(), result.positions, base.orientation);
  if (result.validity.invalid > 0 && result.validity.invalid < plain.kept().validity.invalid) {
    clock.start("untangling");
    result.report.untangling.reset();
    untangle_result(base, Bending::Some, result);
    slide_surface(base, Bending::Some, sliding, result);
    if (!is_sound) repair_by_bending(base, sliding, clock, result);
  }
  if (plain.kept().validity.invalid <= base.validity.invalid) {
    result.quality = measure_quality(base.mesh(), result.positions, base.orientation);
    if (result.validity.invalid <= base.validity.invalid && result.report.followed_nodes > 0 &&
        is_worth_following(base, result, plain.kept()))
      return true;
    plain.apply(sliding, result);
    return false;
  }
  const bool has_gained = result.validity.invalid < plain.kept().validity.invalid;
  if (result.validity.invalid <= base.validity.invalid || (!is_sound && has_gained)) return true;
  plain.apply(sliding, result);
  return false;
}

bool move_and_repair(const BaseSide& base, VolumeMorphResult* one_step, Sliding& sliding,
                     PhaseClock& clock, MorphResult& result) {
  std::optional<VolumeMorphResult> first;
  if (has_corners_to_repair(base)) {
    step_once(base, one_step, clock, result);
    if (result.validity.invalid == 0) return false;
    if (result.validity.invalid > base.validity.invalid &&
        go_by_corners(base, sliding, clock, result))
      return true;
    first = take_one_step(result);
    one_step = &*first;
  }
  return move_plainly(base, one_step, sliding, clock, result);
}

}  // namespace cadmorph
