#pragma once

#include <memory>
#include <vector>

#include "core/types.h"

namespace cadmorph {

class H2Matrix;
struct FieldTerms;
class MultiscaleCorrection;

/// An interpolant in the unit coordinates of a CentreFrame.
struct UnitField {
  std::shared_ptr<const Eigen::MatrixXd> centres;  ///< N x D
  Eigen::MatrixXd weights;                         ///< N x M
  Eigen::MatrixXd linear;                          ///< (D + 1) x M, of 1 and the coordinates
  std::shared_ptr<const H2Matrix> far_field;       ///< of the centres; none: sums are direct
  std::shared_ptr<const MultiscaleCorrection> correction;  ///< added; may be none
  /// The points of its system that are centres; empty: all.
  std::vector<Index> rows = {};
};

/// Sets the centres, weights, linear part, tree and correction of `terms`, in unit coordinates
/// (3D).
void describe(const UnitField& field, FieldTerms& terms);

}  // namespace cadmorph
