#pragma once

#include "core/rbf/field_terms.h"
#include "core/rbf/multiscale_correction.h"

namespace cadmorph {

/// Evaluates an interpolant point by point: the value at a point is the same to the last bit
/// whatever points are asked for beside it, on any number of threads and any processor (see
/// ExactSum). Differs from RbfField::evaluate by the error of the far field and rounding.
class PointwiseField {
 public:
  explicit PointwiseField(FieldTerms terms);

  /// Returns values at T x 3 points, T x M. O(log N) a point with a tree, O(N) without.
  RowMatrix evaluate(const Points& points) const;

  const FieldTerms& terms() const { return terms_; }

 private:
  FieldTerms terms_;
  MultiscaleCorrection correction_;
};

}  // namespace cadmorph
