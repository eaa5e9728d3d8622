#pragma once

#include <memory>
#include <optional>
#include <utility>

#include "apps/pipeline/morph_job.h"
#include "surface/node_slide.h"

namespace cadmorph {

struct WayToFollow;

/// The surface's nodes that slide on the variant's CAD edges and faces, set up when first asked
/// for.
class Sliding {
 public:
  explicit Sliding(const MorphResult& result)
      : base_(*result.base), variant_(*result.variant), result_(result) {}
  Sliding(const MorphResult& result, const SlidingNodes& nodes) : Sliding(result) {
    nodes_ = nodes;
  }

  const SlidingNodes* nodes();

  void move_to(RowMatrix slides) { nodes_->slides = std::move(slides); }
  const RowMatrix& slides() const { return nodes_->slides; }

  /// Facets that lie the other way round than their CAD face at these slides (rows as
  /// SlidingNodes::slides).
  Index turned_facets(const Points& positions, const RowMatrix& slides) const;
  /// Whether a repair slid nodes over each other, so that valid cells overlap.
  bool is_folded(const Points& positions, const RowMatrix& slides) const {
    return turned_facets(positions, slides) > 0;
  }

  /// The last that was found (find_way_to_follow), or null.
  std::shared_ptr<const WayToFollow> known_way;

 private:
  const BaseSide& base_;
  const CadModel& variant_;
  const MorphResult& result_;
  std::optional<SlidingNodes> nodes_;
};

/// Moves what the volume morph and its repair made to `result`.
void take_volume(MorphResult& result, MorphResult& from);

/// What slides, and the result that goes with it, as they were: to be put back.
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

/// Images of a periodic surface nearer to each other than this are at one place after a slide, in
/// the mesh's unit.
double same_place(const MorphResult& result);

/// Nodes that slid lie within the wires of their faces: takes off what they were beyond these.
void settle_slid_nodes(const BaseSide& base, MorphResult& result);

}  // namespace cadmorph
