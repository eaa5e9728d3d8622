#include "core/least_squares.h"

#include <Eigen/Dense>

namespace cadmorph {

using Eigen::Matrix3d;
using Eigen::Vector3d;

namespace {

// Sine of an angle: below, rounding turns a cross product by 1e-4 and more, and any axis across
// does.
constexpr double kOpposite = 1e-12;

// Of directions no more than a right angle apart: next to opposite ones this, and Eigen's
// FromTwoVectors, are wrong by 1e-8.
Matrix3d rotation_between_near(const Vector3d& a, const Vector3d& b) {
  Eigen::Quaterniond turn;  // half-way between no turn and twice the one asked for
  turn.w() = 1 + a.dot(b);
  turn.vec() = a.cross(b);
  return turn.normalized().toRotationMatrix();
}

}  // namespace

RotationFit fit_rotation(const Matrix3d& covariance) {
  const Eigen::JacobiSVD<Matrix3d> svd(covariance, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Matrix3d &u = svd.matrixU(), &v = svd.matrixV();
  const Vector3d sign(1, 1, (u * v.transpose()).determinant() < 0 ? -1 : 1);
  return {.rotation = u * sign.asDiagonal() * v.transpose(),
          .singular_values = svd.singularValues().cwiseProduct(sign),
          .from = v.col(0),
          .to = u.col(0)};
}

Matrix3d rotation_between(const Vector3d& from, const Vector3d& to) {
  const Vector3d a = from.normalized(), b = to.normalized();
  if (a.dot(b) >= 0) return rotation_between_near(a, b);
  // Half a turn, about the same axis, and what is left of it.
  Vector3d axis = a.cross(b);
  if (axis.norm() < kOpposite) axis = a.unitOrthogonal();
  axis = (axis - a.dot(axis) * a).normalized();
  const Matrix3d half = 2 * axis * axis.transpose() - Matrix3d::Identity();
  return rotation_between_near(-a, b) * half;
}

Eigen::MatrixXd least_squares(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) {
  return a.completeOrthogonalDecomposition().solve(b);
}

SmallMatrix small_least_squares(const SmallMatrix& a, const SmallMatrix& b) {
  return a.completeOrthogonalDecomposition().solve(b);
}

}  // namespace cadmorph
