#pragma once

#include <optional>

#include "apps/pipeline/sliding.h"
#include "surface/image_slides.h"

namespace cadmorph {

/// Whether less than half is left of what the worst cells had.
bool has_lost_half(const WorstCells& now, const WorstCells& had);

/// Whether `now` keeps so much more of the base's cells than `before` that following is worth it,
/// and no less of its faces where these count. Both with the quality of their positions.
bool is_worth_following(const BaseSide& base, const MorphResult& now, const MorphResult& before);

/// The slides by which surface nodes follow what moves beside them.
struct WayToFollow {
  RowMatrix start, steps;
  ImageSlides images;
  QualityReport estimate = {};  ///< of the cells once the surface follows
  Index nodes = 0;              ///< that slide
  bool is_promising = false;    ///< by the estimate
};

/// Finds how surface nodes could follow; nothing where the cells kept half, or nothing can follow.
/// `result.quality`: of its positions. The way depends on what moves the surface and on the slides:
/// the one that `sliding` knows is given again while it starts from these.
std::optional<WayToFollow> find_way_to_follow(const BaseSide& base, Sliding& sliding,
                                              const MorphResult& result);

/// Where a rib or a boss moves along a thin wall, or a channel gets longer in which a body stays,
/// the cells beside the wall shear: nothing holds the wall's nodes where its parameters put them.
/// They follow then, but for the CAD's vertices, if that keeps more of the cells' shape.
/// `result.quality`: of its positions. Returns whether they did.
bool let_surface_follow(const BaseSide& base, const WayToFollow& way, Sliding& sliding,
                        PhaseClock& clock, MorphResult& result);

}  // namespace cadmorph
