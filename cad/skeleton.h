#pragma once

#include <cstddef>
#include <optional>

#include "cad/brep.h"

namespace cadmorph {

/// Which edges that meet smoothly between the same faces are one curve.
enum class JoinEdges {
  AtSeams,      ///< where a seam ends, which a re-export puts anywhere, and of intersections of
                ///< surfaces
  WhereSmooth,  ///< wherever just two of them meet
};

/// Finds the physical curves and corners of a model: edges that are neither seams nor degenerate,
/// chained as `join` says. The only vertex of a smooth closed edge is no corner. Where two edges
/// may be one, those joints are corners that turn by more than 20 degrees; or the sharpest of them,
/// so that the model has so many corners, if that can be.
CadSkeleton build_skeleton(const CadModel& model, JoinEdges join,
                           std::optional<std::size_t> corners = {});

}  // namespace cadmorph
