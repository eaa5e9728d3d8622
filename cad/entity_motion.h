#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "cad/topology_match.h"
#include "core/kd_tree.h"

namespace cadmorph {

/// Where a point of the base goes, in a first approximation.
using RoughMotion = std::function<Eigen::Vector3d(const Eigen::Vector3d&)>;

/// Least-squares affine map of paired points; what they leave open (points in a plane) it takes
/// from `prior`.
RoughMotion fit_affine(const std::vector<Eigen::Vector3d>& from,
                       const std::vector<Eigen::Vector3d>& to, const Similarity& prior);

/// A motion of space known at some points: the rough one, corrected by a weighted affine fit of
/// what it misses at the nearest known ones.
class EntityMotion {
 public:
  /// `neighbours`: how many points each fit takes; few follow the data, many smooth it.
  EntityMotion(RoughMotion rough, const std::vector<Eigen::Vector3d>& from,
               const std::vector<Eigen::Vector3d>& to, int neighbours);

  struct Place {
    Eigen::Vector3d point;
    double reach = 0;  ///< distance from x to the nearest known point; 0 where none is known
  };

  /// Where x goes. `left_out`: a known point (its index) that is not to be used.
  Place place_of(const Eigen::Vector3d& x, int left_out = -1) const;
  Eigen::Vector3d operator()(const Eigen::Vector3d& x, int left_out = -1) const {
    return place_of(x, left_out).point;
  }

 private:
  RoughMotion rough_;
  std::vector<Eigen::Vector3d> from_, missed_;
  std::unique_ptr<KdTree> tree_;
  int neighbours_;
};

}  // namespace cadmorph
