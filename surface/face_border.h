#pragma once

#include <vector>

#include "core/rbf/point_order.h"
#include "surface/face_domain.h"

namespace cadmorph {

/// The mesh's nodes on the wires of a face where layers of cells stand on them that are thin
/// against the distance of the domain's samples. They move with their curves exactly, the warp
/// between its samples nearly so: by more than the height of such a cell, if nothing is done.
class FaceBorder {
 public:
  /// None.
  FaceBorder() = default;

  /// `nodes`: at least one; `points`: where they lie, millimetres; `spacing`: of the domain's
  /// samples, the largest, millimetres.
  FaceBorder(const CadModel& base, FaceId face, std::vector<FaceDomain::Sample> nodes,
             const Points& points, double spacing);

  const std::vector<FaceDomain::Sample>& nodes() const { return nodes_; }
  /// Parameters of the nodes.
  Parameters uv() const;

  /// Carries what a warp misses at the nodes to points of the face (millimetres): smooth, zero
  /// beyond some spacings from the wires. Linear in `misfit`; a row a node and a point. Zero where
  /// nodes at one place are asked to part.
  Parameters spread(const Parameters& misfit, const Points& to) const;

 private:
  std::vector<FaceDomain::Sample> nodes_;
  Eigen::Vector2d scale_;  // millimetres per parameter
  PointOrder order_;
  Points points_;  // in that order
  double spacing_ = 0;
};

}  // namespace cadmorph
