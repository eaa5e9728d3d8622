#include "apps/pipeline/improve_stage.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "apps/pipeline/refusal.h"

namespace cadmorph {
namespace {

// Surface nodes slide where that lifts the worst cell's quality by the first factor. Else poor
// cells have to become fewer by the second for nodes to move. With 1 to 1.2 for either, 6 meshes
// come out the same.
constexpr double kWorthSliding = 1.1, kFewerPoor = 1.1;
// Rounds in which nodes of cells that became worse than the worst are put back, a ring of cells a
// round.
constexpr int kTakeBacks = 16;

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
        if (const Index slider = find_slider(sliding, node); slider >= 0)
          improved.slides.row(slider) = sliding->slides.row(slider);
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

}  // namespace

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

}  // namespace cadmorph
