#pragma once

#include <Eigen/Core>

#include "core/types.h"

namespace cadmorph {

/// The rotation R of least squares |R a_i - b_i| (Kabsch 1976, Umeyama 1991), of points about their
/// means.
struct RotationFit {
  Eigen::Matrix3d rotation;
  /// Of the covariance, falling; the last one negative where a reflection would fit better. Their
  /// sum over that of |a_i|^2 is the scale of least squares.
  Eigen::Vector3d singular_values;
  Eigen::Vector3d from, to;  ///< the directions along which the a_i and the b_i are longest
};

/// `covariance`: the sum of b_i a_i^T.
RotationFit fit_rotation(const Eigen::Matrix3d& covariance);

/// Returns the least rotation that turns the direction `from` to that of `to`.
Eigen::Matrix3d rotation_between(const Eigen::Vector3d& from, const Eigen::Vector3d& to);

/// Returns the x of least |a x - b|, the shortest where there are many, for each column of b: by a
/// complete orthogonal decomposition.
Eigen::MatrixXd least_squares(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b);

/// Of no more than three rows and columns, which need no memory of their own.
using SmallMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, 3, 3>;

/// The same for small matrices. To compile it takes ten seconds, thus here alone.
SmallMatrix small_least_squares(const SmallMatrix& a, const SmallMatrix& b);

}  // namespace cadmorph
