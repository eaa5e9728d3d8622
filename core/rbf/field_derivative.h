#pragma once

#include <memory>
#include <vector>

#include "core/rbf/centre_frame.h"
#include "core/rbf/kernel_sum.h"
#include "core/types.h"

namespace cadmorph {

class DenseSolver;

/// What a field took of its points, to be held fixed.
struct FrozenField {
  std::shared_ptr<const Eigen::MatrixXd> points;  ///< distinct, n x D, in units of `frame`
  std::vector<Index> centres;                     ///< rows of the points with kernels; empty: all
  double correction_from = 0;  ///< widest spacing of the levels that meet the points without
  CentreFrame frame;
  Kernel kernel;  ///< in units
  double log_scale = 0;
  double memory_limit = 8e9;                  ///< bytes, of the factor
  std::shared_ptr<const DenseSolver> solver;  ///< of all points, where there is one
};

/// The linear map from values at the points of a field to the values at targets, its centres fixed,
/// and the transpose of that map, to rounding: levels of the multiscale correction are solved to
/// rounding, not to a tolerance. Each column is mapped by itself.
class FieldDerivative {
 public:
  /// `targets`: T x D, in units of the frame. Factors the system of the centres where none is
  /// given: K^3 / 3 operations and 8 K^2 bytes for K centres. Throws SolverError where that is
  /// singular or needs more memory than allowed.
  FieldDerivative(const FrozenField& field, const Eigen::MatrixXd& targets);

  /// Returns what values (n x M) at the points do at the targets, T x M.
  Eigen::MatrixXd forward(const Eigen::MatrixXd& values) const;

  /// Returns for slopes (T x M) by the targets' values those by the values at the points, n x M.
  Eigen::MatrixXd adjoint(const Eigen::MatrixXd& slopes) const;

  Index points() const;
  Index targets() const;

 private:
  struct Impl;
  std::shared_ptr<const Impl> impl_;
};

}  // namespace cadmorph
