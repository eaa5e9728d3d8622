#include "apps/pipeline/follow_stage.h"

#include <algorithm>
#include <array>
#include <utility>
#include <vector>

#include "apps/pipeline/volume_steps.h"
#include "core/cell_topology.h"
#include "volume/follow_slides.h"
#include "volume/mid_nodes.h"

namespace cadmorph {
namespace {

// Surface nodes follow what moves beside them where less than the first share of a figure is kept,
// also by raising, and where the sum of the shares rises by the factor. With 0.75 for 0.5, levels
// of swept meshes and the spacing of edges came off worse. With 1.05 or 1.2 for 1.1, 5 pairs come
// out the same.
constexpr double kKeptHalf = 0.5, kWorthFollowing = 1.1;
// They go all of the way that is found, or where facets fold then, this part of it.
constexpr std::array kSharesToFollow{1.0, 0.75};
// What moves is forgotten after so many cells (follow_neighbours' reach). Where many cells lost and
// some are still inverted it is to be forgotten farther away: a rib that moves by 13 cells. In
// large meshes that costs too much.
constexpr std::array kReaches{12, 24, 48, 96};
constexpr Index kMostToReachFar = 300'000;
// A mesh whose surface followed is repaired where it has at most so many times the inverted cells
// that it had without: where it paid they were up to 2.6 times as many, where the repair came to
// nothing or took as long as ten morphs, 7 to 100 times.
constexpr Index kMostInverted = 4;
// It is also repaired where at most one cell in so many is inverted: 12 of 74,000 were repaired in
// no time, 21 of 43,000 took longer than all else and stayed.
constexpr Index kFewInverted = 5'000;

// Moves the volume anew, with surface nodes that went that share of the way, in as many steps as
// before, and repairs it, unless many more cells are inverted than before.
void morph_on_way(const BaseSide& base, const WayToFollow& way, double share, Sliding& sliding,
                  PhaseClock& clock, MorphResult& result) {
  const SlidingNodes& nodes = *sliding.nodes();
  RowMatrix slides = way.start + share * way.steps;
  for (Index i = 0; i < slides.rows(); ++i)
    if (!nodes.is_within(i, slides.row(i).transpose())) slides.row(i) = way.start.row(i);
  way.images.hold_unlike(way.start, same_place(result), slides);
  const std::vector<Index>& prescribed = base.volume->surface_nodes();
  std::vector<Index> row_of(base.mesh().node_count(), -1);
  for (Index row = 0; row < std::ssize(prescribed); ++row) row_of[prescribed[row]] = row;
  for (Index i = 0; i < slides.rows(); ++i)
    if (const Index row = row_of[nodes.nodes[i]]; row >= 0 && slides.row(i) != nodes.slides.row(i))
      result.surface_positions.row(row) = nodes.at(i, slides.row(i).transpose()).point;
  const Index inverted = result.report.untangling ? result.report.untangling->before : 0;
  result.report.untangling.reset();
  SteppingOptions how = stepping(base);
  how.steps = result.report.stepping.steps;
  step_volume(base, result.surface_positions, how, clock, result, nullptr);
  sliding.move_to(std::move(slides));
  settle_slid_nodes(base, result);
  if (result.validity.invalid <=
      std::max(kMostInverted * inverted, base.quality.cells / kFewInverted)) {
    clock.start("untangling");
    untangle_result(base, Bending::Some, result);
    slide_surface(base, Bending::Some, sliding, result);
  }
  result.quality = measure_quality(base.mesh(), result.positions, base.orientation);
}

bool keeps_more(const BaseSide& base, const QualityReport& now, const QualityReport& before) {
  const WorstCells had = worst_cells(base.quality);
  return sum_of_shares(worst_cells(now), had) >
         kWorthFollowing * sum_of_shares(worst_cells(before), had);
}

}  // namespace

bool has_lost_half(const WorstCells& now, const WorstCells& had) {
  return least_share(now, had) < kKeptHalf;
}

bool is_worth_following(const BaseSide& base, const MorphResult& now, const MorphResult& before) {
  return keeps_more(base, now.quality, before.quality) &&
         (!is_for_finite_volumes(base) || kept_shape(base, now) >= kept_shape(base, before));
}

std::optional<WayToFollow> find_way_to_follow(const BaseSide& base, Sliding& sliding,
                                              const MorphResult& result) {
  const bool can_follow = is_free(base) && base.options.quality != QualityMode::Fast &&
                          base.options.can_repair && dimension(base.mesh()) == 3;
  const WorstCells had = worst_cells(base.quality), now = worst_cells(result.quality);
  if (!can_follow || least_share(now, had) >= kKeptHalf) return std::nullopt;
  const Mesh& mesh = base.mesh();
  const SlidingNodes& nodes = *sliding.nodes();
  if (sliding.known_way && sliding.known_way->start == nodes.slides) {
    WayToFollow way = *sliding.known_way;
    way.is_promising = keeps_more(base, way.estimate, result.quality);
    return way.nodes > 0 ? std::optional(std::move(way)) : std::nullopt;
  }
  std::vector<Index> suffering;
  for (Index c = 0; c < mesh.cell_count(); ++c)
    if (result.quality.values[c] < kKeptHalf * base.quality.values[c]) suffering.push_back(c);
  const SurfaceMorphResult& surface = result.surface;
  std::vector<char> is_fixed = base.fixed_nodes();
  for (const RowId row : surface.entity.ids())
    if (const Index node = base.boundary.nodes[row];
        nodes.find(node) >= 0 && !std::ranges::binary_search(surface.jointed, row))
      is_fixed[node] = 0;
  Points moved = result.positions;
  for (std::size_t i = 0; i < base.rows.size(); ++i)
    moved.row(base.boundary.nodes[base.rows[i]]) = result.surface_positions.row(Index(i));
  const bool have_many_lost = now.worst_twentieth < kKeptHalf * had.worst_twentieth;
  FollowingNodes found;
  QualityReport estimate;
  // Nodes amid edges follow their corners, so that edges stay as straight as they are.
  const MidNodes mid_nodes(mesh, moved), from_base(mesh, mesh.points);
  const Mesh straight = mid_nodes.count() > 0 ? corners_alone(mesh) : Mesh();
  for (const int reach : kReaches) {
    FollowingNodes next = follow_neighbours(mid_nodes.count() > 0 ? straight : mesh, mesh.points,
                                            moved, is_fixed, nodes, {suffering, reach});
    for (Index i = 0; i < mid_nodes.count(); ++i) {
      if (is_fixed[mid_nodes.node(i)]) continue;
      const auto follower = mid_nodes.follower(i, &nodes);
      const MidNodes& start = follower.slide >= 0 ? mid_nodes : from_base;
      start.follow(follower, &nodes, next.positions, next.slides);
    }
    QualityReport by_next = measure_quality(mesh, next.positions, base.orientation);
    const bool is_better = reach == kReaches.front() || by_next.inverted < estimate.inverted;
    if (is_better) found = std::move(next);
    if (is_better) estimate = std::move(by_next);
    if (!is_better || estimate.inverted == 0 || !have_many_lost ||
        mesh.node_count() > kMostToReachFar)
      break;
  }
  // It is rougher than the field that then moves the volume, and few cells can be repaired.
  if (estimate.inverted > 0 && estimate.inverted <= few_cells(base))
    estimate.min = result.quality.min;
  WayToFollow way{.start = nodes.slides,
                  .steps = found.slides - nodes.slides,
                  .images = ImageSlides(surface.images, base.boundary, nodes)};
  way.images.average(way.steps);
  way.nodes = (way.steps.rowwise().squaredNorm().array() > 0).count();
  way.is_promising = keeps_more(base, estimate, result.quality);
  way.estimate = std::move(estimate);
  sliding.known_way = std::make_shared<const WayToFollow>(way);
  if (way.nodes == 0) return std::nullopt;
  return way;
}

bool let_surface_follow(const BaseSide& base, const WayToFollow& way, Sliding& sliding,
                        PhaseClock& clock, MorphResult& result) {
  for (const double share : kSharesToFollow) {
    Undo undo(sliding, result);
    morph_on_way(base, way, share, sliding, clock, result);
    const bool is_better = is_worth_following(base, result, undo.kept());
    if (is_better && result.validity.invalid <= undo.kept().validity.invalid &&
        sliding.turned_facets(result.positions, sliding.slides()) <=
            sliding.turned_facets(undo.kept().positions, undo.slides())) {
      result.report.followed_nodes = way.nodes;
      return true;
    }
    undo.apply(sliding, result);
    if (!is_better) break;
  }
  return false;
}

}  // namespace cadmorph
