#include "core/sliding_nodes.h"

#include "core/least_squares.h"

namespace cadmorph {

// Newton's steps: 2 miss the foot in the test of nodes amid edges, 4 and 8 do not.
constexpr int kRounds = 4;

Eigen::Vector2d slide_below(const SlidingNodes& sliding, Index i, Eigen::Vector2d slide,
                            const Eigen::Vector3d& point) {
  for (int round = 0; round < kRounds; ++round) {
    const SlidePlace place = sliding.at(i, slide);
    slide += small_least_squares(place.tangents, point - place.point);
  }
  return slide;
}

}  // namespace cadmorph
