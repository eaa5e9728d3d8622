#pragma once

#include <Eigen/Core>

#include "core/rbf/field_terms.h"

namespace cadmorph {

/// The part of an interpolant beyond its linear fit, in the unit coordinates of a CentreFrame.
class UnitField {
 public:
  virtual ~UnitField() = default;

  /// Returns values at T x D targets, T x M.
  virtual Eigen::MatrixXd evaluate(const Eigen::MatrixXd& unit_targets) const = 0;

  /// Sets the centres, weights, tree and correction of `terms` (3D), and adds to its linear part,
  /// all in unit coordinates.
  virtual void describe(FieldTerms& terms) const = 0;
};

}  // namespace cadmorph
