#pragma once

#include <vector>

#include "cad/ids.h"
#include "core/boundary.h"
#include "surface/ids.h"

namespace cadmorph {

/// Surface positions on the way from base to variant that follow the motion instead of the chord,
/// so that what turns keeps its size on the way.
///
/// Each patch of facets (a CAD face) that turns by more than 30 degrees gets the similarity that
/// fits its motion best, written as x -> exp(G) x with a generator G (rotation vector, logarithm of
/// the scale, translation); patches that rest or move as they are get a translation. Between
/// them, G varies smoothly over the surface: it solves a Laplace equation on the mesh's facet
/// edges. A node is at exp(s G) (x + s r), with r = exp(-G) x' - x what the fit leaves: x at s = 0
/// and x' at s = 1, whatever G is.
class MotionPath {
 public:
  /// `start` and `end` (m x 3): positions of Boundary::nodes; `patch`: the CAD face of each facet.
  /// Throws InvalidInputError on wrong sizes. O(m) memory, a sparse factorisation of m unknowns
  /// when something turns.
  MotionPath(const Boundary& boundary, const Points& start, const Points& end,
             const IdVector<FacetId, FaceId>& patch);

  /// Whether any patch turns; straight lines otherwise.
  bool is_turning() const { return generators_.rows() > 0; }

  /// Positions at fraction s in [0, 1] of the way (m x 3).
  Points operator()(double s) const;

 private:
  Points start_, end_;
  RowMatrix generators_;  ///< m x 7: rotation vector, log scale, translation
  Points remainder_;      ///< r of each node
};

}  // namespace cadmorph
