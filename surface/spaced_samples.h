#pragma once

#include <functional>
#include <vector>

#include "core/kd_tree.h"

namespace cadmorph {

/// Samples of entities of many sizes, searched in radii that depend on how densely each is sampled:
/// a body's faces are not searched as far as those of the far field round it.
class SpacedSamples {
 public:
  SpacedSamples() = default;

  /// `points`: N x 3; `spacing`: an upper bound of the distance between neighbouring samples of a
  /// sample's entity (N, positive).
  SpacedSamples(const RowMatrix& points, const std::vector<double>& spacing);

  /// Samples within radius(spacing), closest first; the spacing is at most four times that of the
  /// sample's entity. A negative radius finds none.
  std::vector<Neighbour> within(const Eigen::Vector3d& x,
                                const std::function<double(double)>& radius) const;

  /// Samples of entities that may be within `margin` of x, closest first: those within 1.5
  /// spacings, or 1.5 times the distance of the nearest sample, and the margin. Entities of which
  /// no sample is within 4 spacings and the margin have none.
  std::vector<Neighbour> near(const Eigen::Vector3d& x, double margin) const;

 private:
  struct Level {
    double spacing;  ///< largest of its samples
    std::vector<Index> samples;
    KdTree tree;
  };
  std::vector<Neighbour> search(const Eigen::Vector3d& x, const std::vector<double>& radii) const;

  std::vector<Level> levels_;
};

}  // namespace cadmorph
