#include "apps/pipeline/volume_stage.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <utility>

#include "apps/pipeline/improve_stage.h"
#include "apps/pipeline/layer_stage.h"
#include "apps/pipeline/raise_stage.h"
#include "apps/pipeline/refusal.h"
#include "apps/pipeline/repair_stage.h"
#include "apps/pipeline/volume_steps.h"
#include "core/remedies.h"
#include "surface/surface_mesh.h"
#include "surface/surface_remarks.h"
#include "volume/loose_nodes.h"

namespace cadmorph {
namespace {

// Layers are restored where less than the first share is kept of the mean of the worst twentieth,
// as surface nodes slide to raise cells, and where the sum of the figures' shares rises by the
// factor. With 0.8, or with 1.2, sheared layers of the tests do not stand up again; with 0.95 and
// with 1.05 they do, and 3 changes of a wing come out the same.
constexpr double kKeptMost = 0.9, kWorthRestoring = 1.1;
constexpr double kFullShape = 2;  // of the two figures, where nothing is lost
// What a factor in first cells' heights counts against one in the figures, where heights are asked
// for. As much as the figures, or three times: channels lose heights by a fifth for a worst cell of
// 0.5 in place of 0.3, or keep them for one of 0.09 in place of 0.5.
constexpr double kHeightsCount = 2;

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

double change_of_heights(const BaseSide& base, const Points& positions) {
  return change_of_heights(base.mesh(), base.neighbours, base.on_cad(), base.mesh().points,
                           positions);
}

void warn_of_layers(const std::string& why, MorphResult& result) {
  result.report.run.warnings.push_back(words_for(Remedy::KeepLayers) + " changed nothing: " + why);
}

// Whether old heights gain as much as the shape loses, both as factors. Changes: mean sizes of
// logarithms (change_of_heights).
bool is_worth_keeping(double plain_change, double change, double plain_shape, double shape) {
  return plain_shape <= shape * std::exp(kHeightsCount * (plain_change - change));
}

// With layers at their old heights, but where the mesh would be refused then, or where the cells'
// shape loses more than the heights gain.
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
  if (bad == 0 && is_worth_keeping(plain_change, change, kFullShape, shape)) return;
  Undo kept(sliding, result);
  const KeptLayers report = *std::exchange(result.report.kept_layers, std::nullopt);
  morphed.apply(sliding, result);
  leave();
  const std::size_t plain_bad = bad_cells(result).size();
  if (plain_bad < bad)
    return warn_of_layers("elements would be refused with them at their old heights", result);
  const double plain_shape = kept_shape(base, result);
  if (plain_bad == bad && !is_worth_keeping(plain_change, change, plain_shape, shape))
    return warn_of_layers("the elements' shape would lose more than first cells' heights gain",
                          result);
  result.report.kept_layers = report;
  kept.apply(sliding, result);
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
  for (std::size_t i = 0; i < nodes.nodes.size(); ++i)
    surface.uv.row(row_of(base.boundary, nodes.nodes[i])) =
        nodes.parameters(Index(i), nodes.slides.row(Index(i)).transpose());
  surface.folded_facets = base.surface->folds_left(
      *result.variant, result.match, surface, result.positions(base.boundary.nodes, Eigen::all));
}

bool is_raised(const MorphResult& result) {
  return result.report.best_mesh &&
         std::ranges::any_of(result.report.best_mesh->attempts, &RaiseAttempt::is_taken);
}

void measure(const BaseSide& base, Sliding& sliding, MorphResult& result) {
  if (is_raised(result)) {  // measured piece by piece so far
    result.quality = measure_quality(base.mesh(), result.positions, base.orientation);
    result.validity = check_validity(base.mesh(), result.positions, base.orientation);
  }
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
