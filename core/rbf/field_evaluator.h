#pragma once

#include "core/rbf/h2_matrix.h"

namespace cadmorph {

struct EvaluatorOptions {
  int order = 10;           ///< Chebyshev nodes a direction; 8 is too coarse for thin layers
  Index leaf_size = 2000;   ///< targets in a leaf at most
  double separation = 0.6;  ///< as H2Options::separation; 0.5 for layers of 1e-5
};

/// Returns sum_j w_j |x - x_j|^3 at T x 3 targets, T x M, from weights carried to the skeletons of
/// an H2 matrix: far sources act on tensor Chebyshev nodes of boxes of targets, the interpolant is
/// passed down an octree of the targets, near sources are summed directly. O(T) on all threads; the
/// result does not depend on their number.
Eigen::MatrixXd evaluate_field(const H2Matrix& matrix, const H2Matrix::Sources& sources,
                               const Eigen::Ref<const Eigen::MatrixXd>& targets,
                               const EvaluatorOptions& options = {});

}  // namespace cadmorph
