#include "apps/pipeline/raise_stage.h"

#include <algorithm>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "apps/pipeline/follow_stage.h"
#include "apps/pipeline/repair_stage.h"
#include "apps/pipeline/volume_steps.h"
#include "core/cell_topology.h"
#include "core/plane_mesh.h"
#include "volume/mid_nodes.h"

namespace cadmorph {
namespace {

// Shapes of finite volumes are raised where their faces keep this share: they may lose the 1 % that
// raising takes for no gain (best_mesh.cpp).
constexpr double kForShapes = 0.99;
// Rounds in which edges get more of their curve back, and halvings in each of the search for the
// most that their cells bear: to 1/64 of what is missing.
constexpr int kCurveRounds = 12, kCurveHalvings = 6;

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
  const auto alike = [&nodes, images, same = same_place(result)](const RowMatrix& slides) {
    const RowMatrix& start = nodes.slides;
    RowMatrix steps = slides - start;
    images->average(steps);
    RowMatrix there = start + steps;
    images->hold_unlike(start, same, there);
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

// How cells are raised, and what was tried.
struct Raising {
  std::vector<char> is_fixed;  // of all nodes
  BestMeshOptions how;
  std::vector<RaiseAttempt> tried;

  void add(const BestMeshReport& report) {
    tried.insert(tried.end(), report.attempts.begin(), report.attempts.end());
  }
};

// Second-order cells of plane meshes and shells that the curve of an edge turned over: those with
// straight edges are raised first, which makes room for it. Returns whether fewer are left.
bool unfold_curved_cells(const BaseSide& base, Sliding& sliding, const Points& reference,
                         Raising& raising, MorphResult& result) {
  const Mesh& mesh = base.mesh();
  if (dimension(mesh) != 2 || result.quality.inverted <= base.quality.inverted) return false;
  const MidNodes mid_nodes(mesh, result.positions);
  if (mid_nodes.count() == 0) return false;
  const Mesh straight = corners_alone(mesh);
  const std::vector<char>& is_fixed = raising.is_fixed;
  BestMeshOptions how = raising.how;
  how.validity = nullptr;
  const QualityReport before = measure_quality(straight, reference, base.orientation),
                      came = measure_quality(straight, result.positions, base.orientation);
  BestMeshResult best = find_best_mesh(straight, {reference, before}, {result.positions, came},
                                       is_fixed, base.orientation, how);
  raising.add(best.report);
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

// The edges of second-order cells on CAD edges, from straight to as curved as they came.
class RimCurves {
 public:
  /// `is_fixed`: nodes within faces that are not, or slide, follow their corners.
  RimCurves(const BaseSide& base, const SlidingNodes& sliding, const std::vector<char>& is_fixed,
            const Points& positions)
      : mid_nodes_(base.mesh(), positions), whole_(positions) {
    std::vector<char> is_on_face = is_fixed;
    for (char& flag : is_on_face) flag = !flag;
    for (std::size_t i = 0; i < sliding.nodes.size(); ++i) {
      const bool is_on_edge =
          sliding.at(Index(i), Eigen::Vector2d::Zero()).tangents.col(1).isZero(0);
      is_on_face[sliding.nodes[i]] = !is_on_edge;
      if (is_on_edge) edge_nodes_.push_back(sliding.nodes[i]);
    }
    for (Index i = 0; i < mid_nodes_.count(); ++i)
      if (!is_on_face[mid_nodes_.node(i)]) rims_.push_back(i);
  }

  bool is_empty() const { return rims_.empty(); }
  const std::vector<Index>& edge_nodes() const { return edge_nodes_; }

  /// Gives them that share of their curve.
  void curve(double share, Points& positions) const {
    for (const Index i : rims_) {
      const Index node = mid_nodes_.node(i);
      const Eigen::RowVector3d chord = mid_nodes_.middle(i, whole_);
      if (share == 1)
        positions.row(node) = whole_.row(node);
      else
        positions.row(node) = chord + share * (whole_.row(node) - chord);
    }
  }

 private:
  MidNodes mid_nodes_;
  Points whole_;
  std::vector<Index> rims_, edge_nodes_;
};

// Where those with straight edges have no room for the curve yet: they get as much of it as they
// bear and are raised, which makes room for more of it, and so on, the nodes on edges at rest.
// Returns whether fewer are left.
bool curve_by_degrees(const BaseSide& base, Sliding& sliding, const MeasuredShape& of_file,
                      Raising& raising, MorphResult& result) {
  const Mesh& mesh = base.mesh();
  if (dimension(mesh) != 2 || !has_second_order(mesh) ||
      result.quality.inverted <= base.quality.inverted)
    return false;
  const std::vector<char>& is_fixed = raising.is_fixed;
  const RimCurves rims(base, *sliding.nodes(), is_fixed, result.positions);
  if (rims.is_empty()) return false;
  BestMeshOptions how = raising.how;
  how.validity = nullptr;
  how.held.insert(how.held.end(), rims.edge_nodes().begin(), rims.edge_nodes().end());
  Undo undo(sliding, result);
  Points positions = result.positions;
  RowMatrix slides = sliding.slides();
  lay_mid_nodes(mesh, is_fixed, *sliding.nodes(), result.positions, positions, slides);
  sliding.move_to(std::move(slides));
  QualityReport quality;
  const auto curve = [&](double share) {
    rims.curve(share, positions);
    quality = measure_quality(mesh, positions, base.orientation);
    return quality.inverted <= base.quality.inverted;
  };
  double share = 0;
  for (int round = 0; round < kCurveRounds; ++round) {
    if (!curve(share)) break;
    BestMeshResult best =
        find_best_mesh(mesh, of_file, {positions, quality}, is_fixed, base.orientation, how);
    raising.add(best.report);
    positions = std::move(best.positions);
    if (best.slides.rows() > 0) sliding.move_to(std::move(best.slides));
    if (curve(1)) break;
    double too_much = 1;
    const double before = share;
    for (int halving = 0; halving < kCurveHalvings; ++halving) {
      const double middle = (share + too_much) / 2;
      (curve(middle) ? share : too_much) = middle;
    }
    if (share == before) break;
    share = (before + share) / 2;  // where raising has something to start from
  }
  curve(1);
  if (quality.inverted >= undo.kept().quality.inverted ||
      sliding.is_folded(positions, sliding.slides())) {
    undo.apply(sliding, result);
    return false;
  }
  result.positions = std::move(positions);
  result.quality = std::move(quality);
  settle_slid_nodes(base, result);
  return true;
}

// Rows from each plane of a swept mesh to the next one, straight where `points` (N x 3) are.
std::vector<NodeRow> swept_rows(const BaseSide& base, const std::vector<ImagePair>& images,
                                const Points& points) {
  std::vector<SheetNode> sheets;
  for (const ImagePair& pair : images)
    for (std::size_t i = 0; i < pair.from.size(); ++i)
      for (const RowId row : {pair.from[i], pair.to[i]})
        sheets.push_back(
            {base.boundary.nodes[row], Index(pair.original), base.boundary.nodes[pair.from[i]]});
  return find_swept_rows(base.mesh(), base.neighbours, points, std::move(sheets));
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
  how.swept_rows = swept_rows(base, result.surface.images, reference);
  how.wall_rows = find_wall_rows(base.mesh(), base.neighbours, reference, how.swept_rows);
  // Layers of a sweep move with its rows: on its planes they stay thin, across these straight.
  std::vector<char> is_swept(is_fixed.size(), 0);
  for (const NodeRow& row : how.swept_rows)
    for (const Index node : row) is_swept[node] = 1;
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
  Raising raising{std::move(is_fixed), std::move(how), {}};
  while (unfold_curved_cells(base, sliding, reference, raising, result)) {
  }
  curve_by_degrees(base, sliding, of_file, raising, result);
  BestMeshResult best = find_best_mesh(base.mesh(), of_file, {result.positions, result.quality},
                                       raising.is_fixed, base.orientation, raising.how);
  if (const auto& tried = raising.tried; !tried.empty()) {
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

// The quality of the mesh file, where a series of morphs starts elsewhere; else the base has it.
std::optional<QualityReport> measure_left_behind(const BaseSide& base) {
  if (!base.starts_elsewhere) return std::nullopt;
  return measure_quality(base.mesh(), base.mesh_file->mesh().points, base.orientation);
}

}  // namespace

bool may_raise(const BaseSide& base, const QualityReport& quality) {
  const PipelineOptions& options = base.options;
  if (options.quality == QualityMode::Fast || options.untangle == UntangleMode::Never ||
      !options.can_repair)
    return false;
  if (options.quality == QualityMode::Best) return true;
  const std::optional<QualityReport> file = measure_left_behind(base);
  return has_lost_half(worst_cells(quality), worst_cells(file ? *file : base.quality));
}

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
  if (!has_lost_half(worst_cells(result.quality), had)) return;
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
  const bool is_promising = way && way->is_promising;
  // Faces of finite volumes may rise farther where nodes did not follow: both are tried.
  const bool is_sure = is_promising && !is_for_finite_volumes(base);
  if (is_sure) follow();
  if (!way || is_sure) return raise_lost_cells(base, sliding, result);
  Undo morphed(sliding, result);
  raise_lost_cells(base, sliding, result);
  if (!is_promising && !has_lost_half(worst_cells(result.quality), worst_cells(base.quality)))
    return;
  Undo raised(sliding, result);
  morphed.apply(sliding, result);
  if (follow()) {
    raise_lost_cells(base, sliding, result);
    if (is_worth_following(base, result, raised.kept())) return;
  }
  raised.apply(sliding, result);
}

}  // namespace cadmorph
