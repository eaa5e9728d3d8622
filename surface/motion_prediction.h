#pragma once

#include <memory>

#include "cad/topology_match.h"
#include "core/rbf/rbf_system.h"

namespace cadmorph {

/// A rough map of space from base to variant, from matched corners, curves and faces alone: the
/// match's alignment plus a biharmonic RBF of what it leaves. It owes nothing to surface parameters
/// and so judges them: whether a seam moved or the part did, whether an edge was reparametrised.
class MotionPrediction {
 public:
  MotionPrediction(const CadModel& base, const CadModel& variant, const TopologyMatch& match);

  /// Predicted positions of N x 3 points, millimetres.
  Points operator()(const Points& points) const;
  Eigen::Vector3d operator()(const Eigen::Vector3d& point) const;

 private:
  Similarity alignment_;
  std::unique_ptr<RbfField> remainder_;  // null where the alignment is exact
};

}  // namespace cadmorph
