#pragma once

#include "apps/pipeline/sliding.h"

namespace cadmorph {

/// The base's options for steps, as the mode of repair changes them.
SteppingOptions stepping(const BaseSide& base);

/// Whether the program chooses steps and repair.
bool is_free(const BaseSide& base);

/// The most inverted cells that count as few.
Index few_cells(const BaseSide& base);

/// Whether what counts are faces of finite volumes, not the shapes of cells.
bool is_for_finite_volumes(const BaseSide& base);

/// Sum of the shares of what the base's worst faces had, where these count, else of its worst
/// cells. `result.quality`: of its positions.
double kept_shape(const BaseSide& base, const MorphResult& result);

/// Moves the volume to these positions of the surface's nodes (rows as VolumeMorph::surface_nodes),
/// in steps as `how` has them. `one_step`: of the first, or null; used up.
void step_volume(const BaseSide& base, const Points& surface_positions, const SteppingOptions& how,
                 PhaseClock& clock, MorphResult& result, VolumeMorphResult* one_step);

/// Whether a repair may bend all edges of second-order cells (UntangleOptions::may_bend_all).
enum class Bending { Some, All };

/// Repairs inverted cells by the inner nodes, as far as that takes little work.
void untangle_result(const BaseSide& base, Bending bending, MorphResult& result);

/// Repairs what that left: surface nodes slide on their CAD edges and faces, too; where that is not
/// enough, inner nodes alone go on, then both. Returns false where that came nowhere near, so that
/// another start is no better.
bool slide_surface(const BaseSide& base, Bending bending, Sliding& sliding, MorphResult& result);

}  // namespace cadmorph
