#pragma once

#include <Eigen/Core>

#include "core/types.h"

namespace cadmorph {

/// The share of each centre (N x D) of the surface that they lie on, up to a common factor: the
/// square of its spacing; of centres in a plane, which lie on a line there, the spacing.
Eigen::VectorXd surface_shares(const RowMatrix& centres);

/// The affine function nearest to values at centres, in the mean over their surface: in a far field
/// what its border does counts for more than what a small body in it does.
struct AffineFit {
  /// `centres`: N x D; `targets`, where the function is asked for: T x D.
  AffineFit(const RowMatrix& centres, const RowMatrix& targets);

  Eigen::MatrixXd fit;         ///< coefficients by values: terms x N
  Eigen::MatrixXd at_centres;  ///< values by coefficients: N x terms
  Eigen::MatrixXd at_targets;  ///< T x terms
};

}  // namespace cadmorph
