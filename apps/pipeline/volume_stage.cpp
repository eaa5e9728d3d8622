#include "apps/pipeline/volume_stage.h"

#include <algorithm>
#include <array>
#include <iterator>
#include <map>
#include <optional>
#include <utility>

#include "apps/pipeline/layer_stage.h"
#include "apps/pipeline/refusal.h"
#include "core/cell_topology.h"
#include "core/plane_mesh.h"
#include "core/remedies.h"
#include "surface/image_slides.h"
#include "surface/node_slide.h"
#include "volume/follow_slides.h"
#include "volume/loose_nodes.h"
#include "volume/mid_nodes.h"

namespace cadmorph {
namespace {

// Inverted cells are few when they are at most one in so many.
constexpr Index kFewCells = 1'000;
// Surface nodes slide where that lifts the worst cell's quality by the first factor. Else poor
// cells have to become fewer by the second for nodes to move.
constexpr double kWorthSliding = 1.1, kFewerPoor = 1.1;
constexpr int kMostFirstRings = 4;
// Share of the inverted that an attempt leaves at most where it leaves fewer at all.
constexpr double kAnyGain = 0.999;
// Rounds in which nodes of cells that became worse than the worst are put back.
constexpr int kTakeBacks = 16;
// Surface nodes follow what moves beside them where less than this share is kept, by raising too,
// and that makes more of it by this factor; all the way, or where they fold then, the second share.
// What moves far, so that many cells lose, is to be forgotten farther away (follow_neighbours'
// reach, in cells); in large meshes that costs too much.
constexpr double kKeptHalf = 0.5, kWorthFollowing = 1.1;
// Layers are restored where less than the first share is kept of the mean of the worst twentieth,
// and where the figures' shares rise by the factor.
constexpr double kKeptMost = 0.9, kWorthRestoring = 1.1;
constexpr double kFullShape = 2;  // of the two figures, where nothing is lost
constexpr std::array kSharesToFollow{1.0, 0.75};
constexpr std::array kReaches{12, 24, 48, 96};
constexpr Index kMostToReachFar = 300'000;
constexpr double kSamePlace = 1e-9;  // of the diagonal: images after a slide
// What follows is repaired where no more than so many times the cells are inverted that were
// without: up to 2.6 times where it paid, 7 to 100 times where the repair came to nothing or took
// ten morphs.
constexpr Index kMostInverted = 4;
// Shapes of finite volumes are raised where their faces keep this share.
constexpr double kForShapes = 0.99;

SteppingOptions stepping(const BaseSide& base) {
  SteppingOptions result = base.options.stepping;
  if (base.options.untangle == UntangleMode::Always && result.steps == 0) result.steps = 1;
  if (base.options.untangle == UntangleMode::Never) result.least_gain_share = 1;
  return result;
}

// Whether a repair may bend all edges of second-order cells (UntangleOptions::may_bend_all).
enum class Bending { Some, All };

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

void step(const BaseSide& base, const Points& surface_positions, const SteppingOptions& how,
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

void step_and_untangle(const BaseSide& base, const Points& surface_positions,
                       const SteppingOptions& how, PhaseClock& clock, MorphResult& result,
                       VolumeMorphResult* one_step) {
  step(base, surface_positions, how, clock, result, one_step);
  clock.start("untangling");
  untangle_result(base, Bending::Some, result);
}

bool is_free(const BaseSide& base) {
  return stepping(base).steps == 0 && base.options.untangle != UntangleMode::Never;
}

// Moves what step_and_untangle made.
void take_volume(MorphResult& result, MorphResult& from) {
  result.positions = std::move(from.positions);
  result.validity = std::move(from.validity);
  result.report.solver = std::move(from.report.solver);
  result.report.stepping = std::move(from.report.stepping);
  result.report.untangling = std::move(from.report.untangling);
}

// Steps, then repair. When few elements are inverted, repair comes before further steps
// (step_further).
void morph_volume(const BaseSide& base, PhaseClock& clock, MorphResult& result,
                  VolumeMorphResult* one_step) {
  SteppingOptions how = stepping(base);
  if (is_free(base)) how.few = std::max<Index>(1, base.mesh().cell_count() / kFewCells);
  step_and_untangle(base, result.surface_positions, how, clock, result, one_step);
}

// Nodes that slid lie within the wires of their faces.
void settle_slid_nodes(const BaseSide& base, MorphResult& result) {
  SurfaceMorphResult& surface = result.surface;
  for (std::size_t i = 0; i < base.boundary.nodes.size(); ++i)
    if (surface.beyond_wires[i] > 0 &&
        result.positions.row(base.boundary.nodes[i]) != surface.positions.row(i))
      surface.distance[i] -= std::exchange(surface.beyond_wires[i], 0);
}

// The surface's nodes that slide, set up when first asked for.
class Sliding {
 public:
  explicit Sliding(const MorphResult& result)
      : base_(*result.base), variant_(*result.variant), result_(result) {}
  Sliding(const MorphResult& result, const SlidingNodes& nodes) : Sliding(result) {
    nodes_ = nodes;
  }

  const SlidingNodes* nodes() {
    if (nodes_) return &*nodes_;
    const Mesh& mesh = base_.mesh();
    // Those of a plane mesh within faces need no surface to stay in the plane.
    const bool is_in_plane = !plane_normal(mesh, mesh.points, result_.positions).isZero(0);
    return &nodes_.emplace(
        slide_on_cad(variant_, base_.association(), base_.boundary, result_.surface, is_in_plane));
  }

  void move_to(RowMatrix slides) { nodes_->slides = std::move(slides); }
  const RowMatrix& slides() const { return nodes_->slides; }

  Index turned_facets(const Points& positions, const RowMatrix& slides) const {
    return count_turned_facets(base_.mesh(), base_.association(), base_.boundary, *nodes_,
                               positions, slides);
  }
  // Whether a repair slid nodes over each other, so that valid cells overlap.
  bool is_folded(const Points& positions, const RowMatrix& slides) const {
    return turned_facets(positions, slides) > 0;
  }

 private:
  const BaseSide& base_;
  const CadModel& variant_;
  const MorphResult& result_;
  std::optional<SlidingNodes> nodes_;
};

// Where the inner nodes alone can't repair all, those on CAD edges and faces slide on them, too.
// Returns false where that came nowhere near, so that another start is no better.
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

// Steps anew from the base, with repair; what has fewer invalid elements is taken.
void step_anew(const BaseSide& base, const SteppingOptions& how, Sliding& sliding,
               PhaseClock& clock, MorphResult& result) {
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

// Fewer inverted elements after steps are no easier to repair: where that failed, what one step
// makes is another start.
void repair_from_one_step(const BaseSide& base, Sliding& sliding, PhaseClock& clock,
                          MorphResult& result) {
  if (result.validity.invalid <= base.validity.invalid || !is_free(base) ||
      result.report.stepping.attempts.back().steps == 1)
    return;
  SteppingOptions how = stepping(base);
  how.steps = 1;
  step_anew(base, how, sliding, clock, result);
}

// Attempts end where one more step leaves nearly as many inverted, which most often are repaired.
// Where they were not, further steps are tried for as long as each leaves fewer.
void step_further(const BaseSide& base, Sliding& sliding, PhaseClock& clock, MorphResult& result) {
  if (result.validity.invalid <= base.validity.invalid || !is_free(base)) return;
  SteppingOptions how = stepping(base);
  how.least_gain_share = kAnyGain;
  for (const SteppingAttempt& attempt : result.report.stepping.attempts)
    how.min_steps = std::max(how.min_steps, attempt.steps + 1);
  if (how.min_steps <= how.max_steps) step_anew(base, how, sliding, clock, result);
}

// Edges of second-order cells bend where nothing else has repaired them.
void repair_by_bending(const BaseSide& base, Sliding& sliding, PhaseClock& clock,
                       MorphResult& result) {
  if (result.validity.invalid <= base.validity.invalid || !result.report.untangling ||
      MidNodes(base.mesh(), result.positions).count() == 0)
    return;
  clock.start("untangling");
  const UntangleReport before = *result.report.untangling;
  untangle_result(base, Bending::All, result);
  result.report.untangling->before = before.before;
  result.report.untangling->seconds += before.seconds;
  slide_surface(base, Bending::All, sliding, result);
}

// Surface nodes that may slide to repair a mesh, but not to raise its cells: those that hold parts
// together where the CAD has no edge, and those at rest; these may where they are in poor cells of
// a part, but not of a flow, where what is far from a body is not to move.
void hold_nodes(const BaseSide& base, const MorphResult& result, BestMeshOptions& how) {
  const SurfaceMorphResult& surface = result.surface;
  for (const RowId row : surface.entity.ids()) {
    const Index node = base.boundary.nodes[row];
    if (std::ranges::binary_search(surface.jointed, row))
      how.held.push_back(node);
    else if (result.positions.row(node) == base.mesh().points.row(node))
      (how.volumes ? how.held : how.resting).push_back(node);
  }
}

// `nodes`, `result`: to outlive what is returned.
SlidingImages sliding_images(const BaseSide& base, const SlidingNodes& nodes,
                             const MorphResult& result) {
  const auto images =
      std::make_shared<const ImageSlides>(result.surface.images, base.boundary, nodes);
  const double same_place =
      kSamePlace * result.variant->diagonal() / base.association().mesh_unit_mm;
  const auto alike = [&nodes, images, same_place](const RowMatrix& slides) {
    const RowMatrix& start = nodes.slides;
    RowMatrix steps = slides - start;
    images->average(steps);
    RowMatrix there = start + steps;
    images->hold_unlike(start, same_place, there);
    return there;
  };
  if (result.surface.images.empty()) return {};
  return {images->groups(), images->bound(), alike};
}

// Nodes that raising leaves, but for those that slide: the surface's; of a mesh in a plane those of
// its border, on CAD edges, at rest, or amid straight edges. Surface nodes that nothing prescribes
// stay where the morph put them, on their surface.
std::vector<char> nodes_to_leave(const BaseSide& base, const SurfaceMorphResult& surface,
                                 bool is_in_plane) {
  const Mesh& mesh = base.mesh();
  std::vector<char> result = base.fixed_nodes();
  for (const Index node : base.boundary.nodes) result[node] = 1;
  if (!is_in_plane) return result;
  const std::vector<char> is_border = border_nodes(mesh, mesh.points);
  const Association& association = base.association();
  for (const RowId row : association.dimension.ids())
    if (const Index node = base.boundary.nodes[row];
        association.dimension[row] == CadDimension::Face && !association.is_amid[row] &&
        surface.positions.row(row) != mesh.points.row(node))
      result[node] = is_border[node];
  for (const Index c : base.misordered)
    for (const Index node : mesh.cell(c)) result[node] = 1;
  return result;
}

bool is_for_finite_volumes(const BaseSide& base) {
  const MeshUse use = base.options.mesh_use;
  return use == MeshUse::FiniteVolumes ||
         (use == MeshUse::OfFormat && base.mesh().is_of_finite_volumes);
}

// Second-order cells of plane meshes and shells that the curve of an edge turned over: those with
// straight edges are raised first, which makes room for it. Returns whether fewer are left; adds to
// `tried`.
bool unfold_curved_cells(const BaseSide& base, Sliding& sliding, const Points& reference,
                         const std::vector<char>& is_fixed, BestMeshOptions how,
                         std::vector<RaiseAttempt>& tried, MorphResult& result) {
  const Mesh& mesh = base.mesh();
  if (dimension(mesh) != 2 || result.quality.inverted <= base.quality.inverted) return false;
  const MidNodes mid_nodes(mesh, result.positions);
  if (mid_nodes.count() == 0) return false;
  const Mesh straight = corners_alone(mesh);
  how.validity = nullptr;
  const QualityReport before = measure_quality(straight, reference, base.orientation),
                      came = measure_quality(straight, result.positions, base.orientation);
  BestMeshResult best = find_best_mesh(straight, {reference, before}, {result.positions, came},
                                       is_fixed, base.orientation, how);
  tried.insert(tried.end(), best.report.attempts.begin(), best.report.attempts.end());
  if (best.slides.rows() == 0) best.slides = sliding.nodes()->slides;
  for (Index i = 0; i < mid_nodes.count(); ++i)
    if (const auto follower = mid_nodes.follower(i, sliding.nodes());
        follower.slide >= 0 || !is_fixed[mid_nodes.node(i)])
      mid_nodes.follow(follower, sliding.nodes(), best.positions, best.slides);
  QualityReport quality = measure_quality(mesh, best.positions, base.orientation);
  if (quality.inverted >= result.quality.inverted || sliding.is_folded(best.positions, best.slides))
    return false;
  result.positions = std::move(best.positions);
  result.quality = std::move(quality);
  sliding.move_to(std::move(best.slides));
  settle_slid_nodes(base, result);
  return true;
}

// What slides, and the result that goes with it: to be put back.
class Undo {
 public:
  Undo(const Sliding& sliding, const MorphResult& result) : slides_(sliding.slides()) {
    kept_.positions = result.positions;
    kept_.validity = result.validity;
    kept_.quality = result.quality;
    kept_.surface = result.surface;
    kept_.surface_positions = result.surface_positions;
    kept_.report = result.report;
  }

  const MorphResult& kept() const { return kept_; }
  const RowMatrix& slides() const { return slides_; }

  void apply(Sliding& sliding, MorphResult& result) {
    take_volume(result, kept_);
    result.quality = std::move(kept_.quality);
    result.surface = std::move(kept_.surface);
    result.surface_positions = std::move(kept_.surface_positions);
    result.report.best_mesh = std::move(kept_.report.best_mesh);
    result.report.followed_nodes = kept_.report.followed_nodes;
    sliding.move_to(std::move(slides_));
  }

 private:
  MorphResult kept_;
  RowMatrix slides_;
};

// Moves the volume anew with nodes at these slides, in as many steps as before, and repairs it
// where it was repaired before, unless much more is inverted.
void morph_with_slides(const BaseSide& base, Sliding& sliding, const RowMatrix& slides,
                       PhaseClock& clock, MorphResult& result) {
  const SlidingNodes& nodes = *sliding.nodes();
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
  step(base, result.surface_positions, how, clock, result, nullptr);
  sliding.move_to(slides);
  settle_slid_nodes(base, result);
  if (result.validity.invalid <= kMostInverted * inverted) {
    clock.start("untangling");
    untangle_result(base, Bending::Some, result);
    slide_surface(base, Bending::Some, sliding, result);
  }
  result.quality = measure_quality(base.mesh(), result.positions, base.orientation);
}

bool has_lost_half(const BaseSide& base, const QualityReport& quality) {
  return least_share(worst_cells(quality), worst_cells(base.quality)) < kKeptHalf;
}

// Whether `now` keeps so much more of the base's cells than `before` that following is worth it.
bool is_worth_following(const BaseSide& base, const QualityReport& now,
                        const QualityReport& before) {
  const WorstCells had = worst_cells(base.quality);
  return sum_of_shares(worst_cells(now), had) >
         kWorthFollowing * sum_of_shares(worst_cells(before), had);
}

// The slides by which surface nodes follow what moves beside them.
struct WayToFollow {
  RowMatrix start, steps;
  ImageSlides images;
  Index nodes = 0;            // that slide
  bool is_promising = false;  // by the estimate of where the volume's nodes then are
};

// None where the cells kept half, or nothing can follow. `result.quality`: of its positions.
std::optional<WayToFollow> find_way_to_follow(const BaseSide& base, Sliding& sliding,
                                              const MorphResult& result) {
  const bool can_follow = is_free(base) && base.options.quality != QualityMode::Fast &&
                          base.options.can_repair && dimension(base.mesh()) == 3 &&
                          !is_for_finite_volumes(base);
  if (!can_follow || !has_lost_half(base, result.quality)) return std::nullopt;
  const Mesh& mesh = base.mesh();
  const SlidingNodes& nodes = *sliding.nodes();
  std::vector<Index> suffering;
  for (Index c = 0; c < mesh.cell_count(); ++c)
    if (result.quality.values[c] < kKeptHalf * base.quality.values[c]) suffering.push_back(c);
  const SurfaceMorphResult& surface = result.surface;
  std::vector<char> is_fixed = base.fixed_nodes();
  for (const RowId row : surface.entity.ids())
    if (const Index node = base.boundary.nodes[row];
        std::ranges::binary_search(nodes.nodes, node) &&
        !std::ranges::binary_search(surface.jointed, row))
      is_fixed[node] = 0;
  for (const Index node : base.layer_nodes().feet) is_fixed[node] = 1;
  Points moved = result.positions;
  for (std::size_t i = 0; i < base.rows.size(); ++i)
    moved.row(base.boundary.nodes[base.rows[i]]) = result.surface_positions.row(Index(i));
  const bool have_many_lost = worst_cells(result.quality).worst_twentieth <
                              kKeptHalf * worst_cells(base.quality).worst_twentieth;
  FollowingNodes found;
  QualityReport estimate;  // of the cells once they follow
  // Nodes amid edges follow their corners, so that edges stay as straight as they are.
  const MidNodes mid_nodes(mesh, moved), from_base(mesh, mesh.points);
  const Mesh straight = mid_nodes.count() > 0 ? corners_alone(mesh) : Mesh();
  for (const int reach : kReaches) {
    FollowingNodes next = follow_neighbours(mid_nodes.count() > 0 ? straight : mesh, mesh.points,
                                            moved, is_fixed, nodes, suffering, reach);
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
  WayToFollow way{.start = nodes.slides,
                  .steps = found.slides - nodes.slides,
                  .images = ImageSlides(surface.images, base.boundary, nodes)};
  way.images.average(way.steps);
  way.nodes = (way.steps.rowwise().squaredNorm().array() > 0).count();
  if (way.nodes == 0) return std::nullopt;
  way.is_promising = is_worth_following(base, estimate, result.quality);
  return way;
}

// Where a rib or a boss moves along a thin wall, the cells of the wall shear: nothing holds the
// nodes of the face on its other side where its parameters put them. They follow then, but for the
// CAD's vertices, if that keeps more of the cells' shape. `result.quality`: of its positions.
// Returns whether they did.
bool let_surface_follow(const BaseSide& base, const WayToFollow& way, Sliding& sliding,
                        PhaseClock& clock, MorphResult& result) {
  const SlidingNodes& nodes = *sliding.nodes();
  const double same_place =
      kSamePlace * result.variant->diagonal() / base.association().mesh_unit_mm;
  for (const double share : kSharesToFollow) {
    Undo undo(sliding, result);
    RowMatrix slides = way.start + share * way.steps;
    for (Index i = 0; i < slides.rows(); ++i)
      if (!nodes.is_within(i, slides.row(i).transpose())) slides.row(i) = way.start.row(i);
    way.images.hold_unlike(way.start, same_place, slides);
    morph_with_slides(base, sliding, slides, clock, result);
    const bool is_better = is_worth_following(base, result.quality, undo.kept().quality);
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

void follow(const BaseSide& base, Sliding& sliding, PhaseClock& clock, MorphResult& result) {
  if (const std::optional<WayToFollow> way = find_way_to_follow(base, sliding, result))
    let_surface_follow(base, *way, sliding, clock, result);
}

// A flag a node: of a row from a plane of a swept mesh to the next one, its image. These rows are
// straightened whenever raising bent them, so that layers of theirs keep their heights.
std::vector<char> nodes_of_sweeps(const BaseSide& base, const std::vector<NodeRow>& rows,
                                  const std::vector<ImagePair>& images) {
  std::vector<Index> first(base.mesh().node_count(), -1);  // of the images of a node
  for (const ImagePair& pair : images)
    for (std::size_t i = 0; i < pair.from.size(); ++i) {
      const Index from = base.boundary.nodes[pair.from[i]], to = base.boundary.nodes[pair.to[i]];
      first[from] = first[to] = first[from] < 0 ? from : first[from];
    }
  std::vector<char> result(base.mesh().node_count(), 0);
  for (const NodeRow& row : rows)
    if (first[row.front()] >= 0 && first[row.front()] == first[row.back()])
      for (const Index node : row) result[node] = 1;
  return result;
}

// Raises the cells that lost most against the mesh file's: their faces where `volumes` are given,
// else their shapes.
void raise_cells(const BaseSide& base, const MeasuredShape& of_file, const FiniteVolumes* volumes,
                 Sliding& sliding, MorphResult& result) {
  const Points& reference = of_file.points;
  const bool is_in_plane =
      !plane_normal(base.mesh(), base.mesh().points, result.positions).isZero(0);
  std::vector<char> is_fixed = nodes_to_leave(base, result.surface, is_in_plane);
  BestMeshOptions how;
  how.volumes = volumes;
  hold_nodes(base, result, how);
  how.wall_rows = find_wall_rows(base.mesh(), base.neighbours, reference);
  const std::vector<char> is_swept = nodes_of_sweeps(base, how.wall_rows, result.surface.images);
  for (const Index node : base.layer_nodes().all) {
    if (is_swept[node]) continue;
    is_fixed[node] = 1;
    how.held.push_back(node);
  }
  how.validity = &result.validity;
  how.sliding = [&] { return sliding.nodes(); };
  how.images = [&] { return sliding_images(base, *sliding.nodes(), result); };
  how.is_folded = [&](const Points& positions, const RowMatrix& slides) {
    return sliding.is_folded(positions, slides);
  };
  const WorstCells plain = dimension(base.mesh()) == 2 ? worst_cells(result.quality) : WorstCells{};
  std::vector<RaiseAttempt> tried;
  while (unfold_curved_cells(base, sliding, reference, is_fixed, how, tried, result)) {
  }
  BestMeshResult best = find_best_mesh(base.mesh(), of_file, {result.positions, result.quality},
                                       is_fixed, base.orientation, how);
  if (!tried.empty()) {
    if (!best.report.is_by_faces) best.report.plain = plain;
    best.report.attempts.insert(best.report.attempts.begin(), tried.begin(), tried.end());
  }
  result.report.best_mesh = std::move(best.report);
  result.positions = std::move(best.positions);
  result.quality = std::move(best.quality);
  if (best.slides.rows() == 0) return;
  sliding.move_to(std::move(best.slides));
  settle_slid_nodes(base, result);
}

// The mesh file's, where a series of morphs has left it; else the base has it.
std::optional<QualityReport> measure_left_behind(const BaseSide& base) {
  if (!base.own) return std::nullopt;
  return measure_quality(base.mesh(), base.mesh_file->mesh().points, base.orientation);
}

// Whether nodes may move for quality alone.
bool may_raise(const BaseSide& base, const QualityReport& quality) {
  const PipelineOptions& options = base.options;
  if (options.quality == QualityMode::Fast || options.untangle == UntangleMode::Never ||
      !options.can_repair)
    return false;
  if (options.quality == QualityMode::Best) return true;
  const std::optional<QualityReport> file = measure_left_behind(base);
  return least_share(worst_cells(quality), worst_cells(file ? *file : base.quality)) < kKeptHalf;
}

// Raises the cells that lost most against the mesh file's, also after a series of morphs. Faces of
// finite volumes may be good where a cell is flat: shapes that lost much are raised after them,
// where that costs the faces nothing.
void raise_lost_cells(const BaseSide& base, Sliding& sliding, MorphResult& result) {
  if (result.validity.invalid > base.validity.invalid || !may_raise(base, result.quality)) return;
  const Points& reference = base.mesh_file->mesh().points;
  const std::optional<QualityReport> moved_back = measure_left_behind(base);
  const MeasuredShape of_file{reference, moved_back ? *moved_back : base.quality};
  std::optional<FiniteVolumes> volumes;
  if (is_for_finite_volumes(base))
    volumes.emplace(base.mesh(), reference, base.neighbours, base.orientation);
  const bool is_by_faces = volumes && volumes->has_cells();
  raise_cells(base, of_file, is_by_faces ? &*volumes : nullptr, sliding, result);
  if (!is_by_faces) return;
  const WorstCells had = worst_cells(of_file.quality);
  if (least_share(worst_cells(result.quality), had) >= kKeptHalf) return;
  sliding.nodes();
  Undo undo(sliding, result);
  const BestMeshReport by_faces = *result.report.best_mesh;
  raise_cells(base, of_file, nullptr, sliding, result);
  const WorstCells faces = worst_faces(*volumes, result.positions);
  const bool has_risen = sum_of_shares(worst_cells(result.quality), had) >
                         sum_of_shares(worst_cells(undo.kept().quality), had);
  if (!has_risen || sum_of_shares(faces, by_faces.base) <
                        kForShapes * sum_of_shares(by_faces.best, by_faces.base)) {
    undo.apply(sliding, result);
    return;
  }
  auto& attempts = result.report.best_mesh->attempts;
  attempts.insert(attempts.begin(), by_faces.attempts.begin(), by_faces.attempts.end());
}

// Gives layers their old heights. Returns whether any has them.
bool keep_layers(const BaseSide& base, Sliding& sliding, PhaseClock& clock, MorphResult& result) {
  clock.start("layers");
  std::optional<MeshWithLayers> kept = keep_layers(result, *sliding.nodes());
  result.report.kept_layers = kept ? kept->report : KeptLayers{};
  if (result.report.kept_layers->kept + result.report.kept_layers->partly == 0) return false;
  result.positions = std::move(kept->positions);
  result.validity = std::move(kept->validity);
  sliding.move_to(std::move(kept->slides));
  settle_slid_nodes(base, result);
  return true;
}

// Whether half of the cells that lost more than a tenth of their shape, and are worse than the
// worst twentieth was, are of layers.
bool have_layers_lost(const BaseSide& base, const QualityReport& quality) {
  if (base.layer_nodes().all.empty()) return false;
  std::vector<char> is_layer(base.mesh().node_count(), 0);
  for (const Index node : base.layer_nodes().all) is_layer[node] = 1;
  const double worst = worst_cells(base.quality).worst_twentieth;
  Index lost = 0, of_layers = 0;
  for (Index c = 0; c < base.mesh().cell_count(); ++c) {
    if (!(quality.values[c] < std::min(worst, kKeptMost * base.quality.values[c]))) continue;
    ++lost;
    of_layers += std::ranges::all_of(base.mesh().cell(c), [&](Index n) { return is_layer[n]; });
  }
  return 2 * of_layers > lost;
}

// Layers that were sheared or squeezed get their old heights where that keeps more of the cells'
// shape, or of their faces'. Returns whether they did.
bool restore_layers(const BaseSide& base, Sliding& sliding, PhaseClock& clock,
                    MorphResult& result) {
  if (!is_free(base) || !may_raise(base, result.quality) || !have_layers_lost(base, result.quality))
    return false;
  const Mesh& mesh = base.mesh();
  std::optional<FiniteVolumes> volumes;
  if (is_for_finite_volumes(base))
    volumes.emplace(mesh, mesh.points, base.neighbours, base.orientation);
  const bool is_by_faces = volumes && volumes->has_cells();
  const auto worst = [&](const Points& positions, const QualityReport& quality) {
    return is_by_faces ? worst_faces(*volumes, positions) : worst_cells(quality);
  };
  const WorstCells had = worst(mesh.points, base.quality),
                   came = worst(result.positions, result.quality);
  if (came.worst_twentieth >= kKeptMost * had.worst_twentieth) return false;
  sliding.nodes();
  Undo undo(sliding, result);
  if (keep_layers(base, sliding, clock, result)) {
    result.quality = measure_quality(mesh, result.positions, base.orientation);
    if (sum_of_shares(worst(result.positions, result.quality), had) >
            kWorthRestoring * sum_of_shares(came, had) &&
        !sliding.is_folded(result.positions, sliding.slides()))
      return true;
    undo.apply(sliding, result);
  }
  result.report.kept_layers.reset();
  return false;
}

bool has_corners_to_repair(const BaseSide& base) {
  return is_free(base) && dimension(base.mesh()) == 3 && has_second_order(base.mesh());
}

bool move_and_repair(const BaseSide& base, VolumeMorphResult* one_step, Sliding& sliding,
                     PhaseClock& clock, MorphResult& result);

// Moves and repairs second-order cells as straight ones at their corners, and lays the nodes amid
// edges then: that is an eighth of the nodes, of cells that cost a tenth. `result`: of one step.
// Returns false, with `result` as it was, where curved cells need another way (where the straight
// ones can't be repaired, neither can they), or where that step was valid and following gains
// nothing.
bool go_by_corners(const BaseSide& base, Sliding& sliding, PhaseClock& clock, MorphResult& result) {
  MorphResult corners;
  corners.base = base.straight();
  corners.variant = result.variant;
  corners.match = result.match;
  corners.surface = result.surface;
  corners.surface_positions = corners.base->prescribed(result.surface.positions);
  const SlidingNodes& nodes = *sliding.nodes();
  Sliding sliding_corners(corners, nodes);
  if (!move_and_repair(*corners.base, nullptr, sliding_corners, clock, corners)) {
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
    untangle_result(base, Bending::Some, result);
    slide_surface(base, Bending::Some, sliding, result);
    if (!is_sound) repair_by_bending(base, sliding, clock, result);
  }
  if (plain.kept().validity.invalid <= base.validity.invalid) {
    result.quality = measure_quality(base.mesh(), result.positions, base.orientation);
    if (result.validity.invalid <= base.validity.invalid && result.report.followed_nodes > 0 &&
        is_worth_following(base, result.quality, plain.kept().quality))
      return true;
    plain.apply(sliding, result);
    return false;
  }
  const bool has_gained = result.validity.invalid < plain.kept().validity.invalid;
  if (result.validity.invalid <= base.validity.invalid || (!is_sound && has_gained)) return true;
  plain.apply(sliding, result);
  return false;
}

// Raises the lost cells, after surface nodes followed where that promises to keep more.
// Where it does not, but raising leaves less than half, that is tried still, and the better one
// taken.
void raise_or_follow(const BaseSide& base, Sliding& sliding, PhaseClock& clock,
                     MorphResult& result) {
  const std::optional<WayToFollow> way = find_way_to_follow(base, sliding, result);
  const auto follow = [&] {
    const bool has_followed = has_corners_to_repair(base)
                                  ? go_by_corners(base, sliding, clock, result)
                                  : let_surface_follow(base, *way, sliding, clock, result);
    clock.start("quality after");
    return has_followed;
  };
  if (way && way->is_promising) follow();
  if (!way || way->is_promising) return raise_lost_cells(base, sliding, result);
  Undo morphed(sliding, result);
  raise_lost_cells(base, sliding, result);
  if (!has_lost_half(base, result.quality)) return;
  Undo raised(sliding, result);
  morphed.apply(sliding, result);
  if (follow()) {
    raise_lost_cells(base, sliding, result);
    if (is_worth_following(base, result.quality, raised.kept().quality)) return;
  }
  raised.apply(sliding, result);
}

// With the layers as the morph left them, or as restore_layers does.
void restore_and_raise(const BaseSide& base, bool is_inverted, Sliding& sliding, PhaseClock& clock,
                       MorphResult& result) {
  clock.start("quality after");
  result.quality = measure_quality(base.mesh(), result.positions, base.orientation);
  const bool has_restored = !is_inverted && restore_layers(base, sliding, clock, result);
  clock.start("quality after");
  if (is_inverted || has_restored)
    raise_lost_cells(base, sliding, result);
  else
    raise_or_follow(base, sliding, clock, result);
}

// Shares of what the base's worst faces had, where these count, else of its worst cells.
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

double change_of_heights(const BaseSide& base, const Points& positions) {
  return change_of_heights(base.mesh(), base.neighbours, base.on_cad(), base.mesh().points,
                           positions);
}

void warn_of_layers(const std::string& why, MorphResult& result) {
  result.report.run.warnings.push_back(words_for(Remedy::KeepLayers) + " changed nothing: " + why);
}

// With layers at their old heights, but where the mesh would be refused then, or where the cells'
// shape loses by a larger factor than the change of first cells' heights.
void keep_and_raise(const BaseSide& base, bool is_inverted, Sliding& sliding, PhaseClock& clock,
                    MorphResult& result) {
  sliding.nodes();
  Undo morphed(sliding, result);
  const bool has_kept = keep_layers(base, sliding, clock, result);
  const Index columns = result.report.kept_layers->columns;
  const auto leave = [&] {
    restore_and_raise(base, is_inverted, sliding, clock, result);
    if (!result.report.kept_layers) result.report.kept_layers = KeptLayers{.columns = columns};
  };
  if (!has_kept) {
    warn_of_layers(columns == 0
                       ? "no layers that grow from a wall were found"
                       : "no column of nodes can be where it belongs with all elements valid",
                   result);
    return leave();
  }
  const double plain_change = change_of_heights(base, morphed.kept().positions),
               change = change_of_heights(base, result.positions);
  clock.start("quality after");
  result.quality = measure_quality(base.mesh(), result.positions, base.orientation);
  raise_lost_cells(base, sliding, result);
  const std::size_t bad = bad_cells(result).size();
  const double shape = kept_shape(base, result);
  if (bad == 0 && plain_change * shape > change * kFullShape) return;
  Undo kept(sliding, result);
  const KeptLayers report = *std::exchange(result.report.kept_layers, std::nullopt);
  morphed.apply(sliding, result);
  leave();
  const std::size_t plain_bad = bad_cells(result).size();
  if (plain_bad < bad)
    return warn_of_layers("elements would be refused with them at their old heights", result);
  const double plain_shape = kept_shape(base, result);
  if (plain_bad == bad && plain_shape > shape && plain_change * shape <= change * plain_shape)
    return warn_of_layers("the elements' shape would lose more than first cells' heights gain",
                          result);
  result.report.kept_layers = report;
  kept.apply(sliding, result);
}

// In as many steps as it takes, with repair. Returns whether that took more than inner nodes.
bool move_and_repair(const BaseSide& base, VolumeMorphResult* one_step, Sliding& sliding,
                     PhaseClock& clock, MorphResult& result) {
  std::optional<VolumeMorphResult> first;
  if (has_corners_to_repair(base)) {
    SteppingOptions how = stepping(base);
    how.steps = 1;
    step(base, result.surface_positions, how, clock, result, one_step);
    if (result.validity.invalid > base.validity.invalid &&
        go_by_corners(base, sliding, clock, result))
      return true;
    first = {.positions = result.positions, .report = result.report.solver, .error = {}};
    one_step = &*first;
  }
  morph_volume(base, clock, result, one_step);
  const bool is_inverted = result.validity.invalid > base.validity.invalid;
  if (is_inverted) {
    result.quality = measure_quality(base.mesh(), result.positions, base.orientation);
    follow(base, sliding, clock, result);
  }
  if (slide_surface(base, Bending::Some, sliding, result)) {
    repair_from_one_step(base, sliding, clock, result);
    step_further(base, sliding, clock, result);
  }
  repair_by_bending(base, sliding, clock, result);
  return is_inverted;
}

// What is nearest to its shape as a whole may leave single cells worse. Puts the nodes of cells
// that fell below the worst there was back to where they were; returns whether none is left.
bool take_back_worse(const BaseSide& base, const MorphResult& before, const SlidingNodes* sliding,
                     UntangleResult& improved, QualityReport& now) {
  const Mesh& mesh = base.mesh();
  for (int round = 0; round < kTakeBacks && now.min < before.quality.min; ++round) {
    for (Index c = 0; c < mesh.cell_count(); ++c) {
      if (!(now.values[c] < before.quality.min)) continue;
      for (const Index node : mesh.cell(c)) {
        improved.positions.row(node) = before.positions.row(node);
        if (!sliding) continue;
        const auto slider = std::ranges::lower_bound(sliding->nodes, node);
        if (slider != sliding->nodes.end() && *slider == node)
          improved.slides.row(slider - sliding->nodes.begin()) =
              sliding->slides.row(slider - sliding->nodes.begin());
      }
    }
    now = measure_quality(mesh, improved.positions, base.orientation);
  }
  return now.min >= before.quality.min &&
         check_validity(mesh, improved.positions, base.orientation).invalid == 0;
}

// Moves nodes near poor cells, the inner ones or those on CAD edges and faces, too. Returns whether
// that lifts the worst cell, or leaves fewer poor ones; all stays as it was where it does not.
bool raise(const BaseSide& base, Sliding* sliding, MorphResult& result) {
  UntangleOptions how;
  how.progress = base.options.progress;
  how.attempts = 1;
  if (sliding) how.sliding = sliding->nodes();
  how.poor_cells = cells_below(*base.options.improve_below, result.quality);
  std::vector<char> is_fixed = base.fixed_nodes();
  if (base.options.keep_layers)
    for (const Index node : base.layer_nodes().all) is_fixed[node] = 1;
  UntangleResult improved =
      untangle(base.mesh(), result.positions, is_fixed, base.orientation, how);
  if (improved.report.after > 0) return false;
  QualityReport now = measure_quality(base.mesh(), improved.positions, base.orientation);
  if (now.min < result.quality.min && !take_back_worse(base, result, how.sliding, improved, now))
    return false;
  const auto poor = [&](const QualityReport& quality) {
    return static_cast<double>(cells_below(*base.options.improve_below, quality).size());
  };
  const bool is_lifted = now.min > (sliding ? kWorthSliding : 1) * result.quality.min;
  if (!is_lifted && kFewerPoor * poor(now) >= poor(result.quality)) return false;
  if (sliding && sliding->is_folded(improved.positions, improved.slides)) return false;
  result.positions = std::move(improved.positions);
  result.quality = std::move(now);
  result.report.improving->slid_nodes = improved.report.slid_nodes;
  if (sliding) sliding->move_to(std::move(improved.slides));
  return true;
}

// Raises poor cells: by the inner nodes, then where that does not do by those on CAD edges and
// faces, too.
void improve_result(const BaseSide& base, Sliding& sliding, MorphResult& result) {
  if (!base.options.improve_below || result.validity.invalid > 0) return;
  const double below = *base.options.improve_below;
  const auto poor = [&] { return static_cast<Index>(cells_below(below, result.quality).size()); };
  if (poor() == 0) return;
  ImproveReport& report = result.report.improving.emplace();
  report.below = below;
  report.poor_before = poor();
  report.min_before = result.quality.min;
  raise(base, nullptr, result);
  if (poor() > 0 && raise(base, &sliding, result)) settle_slid_nodes(base, result);
  report.poor_after = poor();
  report.min_after = result.quality.min;
}

std::vector<GroupFigures> figures_of_groups(const Mesh& mesh, const Points& positions,
                                            double mesh_unit_mm) {
  std::vector<GroupFigures> result;
  for (const NodeGroup& group : mesh.groups) {
    GroupFigures figures{.name = group.name,
                         .kind = group.kind,
                         .nodes = std::ssize(group.nodes),
                         .max_displacement = 0};
    for (const Index node : group.nodes)
      figures.max_displacement =
          std::max(figures.max_displacement,
                   mesh_unit_mm * (positions.row(node) - mesh.points.row(node)).norm());
    result.push_back(std::move(figures));
  }
  return result;
}

// Of the boundary's nodes; of those that nothing prescribes, where the volume took them.
Points where_cad_puts_surface(const BaseSide& base, const MorphResult& result) {
  Points surface = result.positions(base.boundary.nodes, Eigen::all);
  for (std::size_t i = 0; i < base.rows.size(); ++i)
    surface.row(base.rows[i]) = result.surface_positions.row(static_cast<Index>(i));
  return surface;
}

// Folds of the surface morph are gone where nodes slid out of them.
void recount_folds(const BaseSide& base, Sliding& sliding, MorphResult& result) {
  SurfaceMorphResult& surface = result.surface;
  if (surface.folded_facets.empty()) return;
  const SlidingNodes& nodes = *sliding.nodes();
  for (std::size_t i = 0; i < nodes.nodes.size(); ++i) {
    const auto slot = std::ranges::lower_bound(base.boundary.nodes, nodes.nodes[i]);
    const RowId row(slot - base.boundary.nodes.begin());
    surface.uv.row(row) = nodes.parameters(Index(i), nodes.slides.row(Index(i)).transpose());
  }
  surface.folded_facets = base.surface->folds_left(
      *result.variant, result.match, surface, result.positions(base.boundary.nodes, Eigen::all));
}

void measure(const BaseSide& base, Sliding& sliding, MorphResult& result) {
  improve_result(base, sliding, result);
  recount_folds(base, sliding, result);
  carry_loose_nodes(base.mesh(), base.boundary, where_cad_puts_surface(base, result),
                    result.positions);
  PipelineReport& figures = result.report;
  set_quality(figures.after, result.quality, result.validity,
              check_quality(base.mesh(), result.positions, base.neighbours, base.orientation));
  figures.max_displacement =
      figures.mesh.unit_mm * (result.positions - base.mesh().points).rowwise().norm().maxCoeff();
  for (const Index node : base.volume->surface_nodes())
    figures.max_surface_displacement = std::max(
        figures.max_surface_displacement,
        figures.mesh.unit_mm * (result.positions.row(node) - base.mesh().points.row(node)).norm());
  figures.layers = measure_layers(base.mesh(), base.neighbours, base.on_cad(), base.mesh().points,
                                  result.positions);
  figures.mesh.groups = figures_of_groups(base.mesh(), result.positions, figures.mesh.unit_mm);
  judge(result);
}

void describe_surface(const BaseSide& base, MorphResult& result) {
  const SurfaceMorphResult& surface = result.surface;
  const Association& association = base.association();
  PipelineReport& figures = result.report;
  const Index matched =
      surface.distance.size() - std::ranges::count(association.dimension, CadDimension::None);
  figures.after.max_distance = surface.distance.maxCoeff();
  figures.after.mean_distance =
      surface.distance.sum() / static_cast<double>(std::max<Index>(matched, 1));
  for (std::string& line :
       describe_folds(*base.cad, result.match, association, surface.folded_facets))
    figures.run.warnings.push_back(std::move(line));
  for (std::string& line :
       describe_beyond_wires(*base.cad, result.match, association, surface.beyond_wires))
    figures.run.warnings.push_back(std::move(line));
}

}  // namespace

std::vector<std::optional<VolumeMorphResult>> first_steps(std::vector<MorphAttempt>& attempts) {
  std::vector<std::optional<VolumeMorphResult>> steps(attempts.size());
  std::map<const BaseSide*, std::vector<std::size_t>> attempts_of;
  for_each_good(attempts, [&](std::size_t i, const MorphResult& result) {
    if (stepping(*result.base).steps <= 1) attempts_of[result.base.get()].push_back(i);
  });
  for (const auto& [base, members] : attempts_of) {
    std::vector<Points> targets;
    for (const std::size_t i : members) targets.push_back(attempts[i].result.surface_positions);
    try {
      std::vector<VolumeMorphResult> moved = base->volume->morph_each(targets);
      for (std::size_t k = 0; k < members.size(); ++k) steps[members[k]] = std::move(moved[k]);
    } catch (...) {
      for (const std::size_t i : members) attempts[i].error = std::current_exception();
    }
  }
  return steps;
}

void move_volume(MorphResult& result, VolumeMorphResult* one_step) {
  const BaseSide& base = *result.base;
  PhaseClock clock(base.options.progress);
  Sliding sliding(result);
  const bool is_inverted = move_and_repair(base, one_step, sliding, clock, result);
  if (base.options.keep_layers && result.validity.invalid <= base.validity.invalid)
    keep_and_raise(base, is_inverted, sliding, clock, result);
  else
    restore_and_raise(base, is_inverted, sliding, clock, result);
  measure(base, sliding, result);
  describe_surface(base, result);
  for (const PhaseTime& phase : clock.phases()) result.report.run.phases.push_back(phase);
}

}  // namespace cadmorph
