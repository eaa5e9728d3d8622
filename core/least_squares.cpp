#include "core/least_squares.h"

#include <Eigen/Dense>
#include <numbers>

namespace cadmorph {
namespace {

constexpr double kOpposite = 1e-12;

}  // namespace

using Eigen::Matrix3d;
using Eigen::Vector3d;

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
  // Half-way between no turn and twice the one asked for; opposite directions leave its axis open.
  Eigen::Quaterniond turn;
  turn.w() = 1 + a.dot(b);
  turn.vec() = a.cross(b);
  if (turn.norm() < kOpposite) return Eigen::AngleAxisd(std::numbers::pi, a.unitOrthogonal()).matrix();
  return turn.normalized().toRotationMatrix();
}

Eigen::MatrixXd least_squares(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) {
  return a.colPivHouseholderQr().solve(b);
}

}  // namespace cadmorph
