#include "core/least_squares.h"

#include <Eigen/Dense>
#include <catch2/catch.hpp>
#include <cmath>

using namespace cadmorph;
using Eigen::Matrix3d;
using Eigen::Vector3d;

TEST_CASE("a rotation between directions turns the one into the other by the least angle",
          "[core]") {
  const Vector3d from(1, -2, 0.5);
  for (const double angle : {0.0, 1e-9, 1e-3, 1.0, 3.0, 3.14159265}) {
    INFO(angle);
    const Vector3d axis = from.unitOrthogonal();
    const Vector3d to = 7 * (Eigen::AngleAxisd(angle, axis) * from);
    const Matrix3d turn = rotation_between(from, to);
    CHECK((turn.transpose() * turn - Matrix3d::Identity()).norm() < 1e-14);
    CHECK((turn * from.normalized() - to.normalized()).norm() < 1e-14);
    CHECK(std::abs(Eigen::AngleAxisd(turn).angle() - angle) < 1e-7);
  }
  const Matrix3d opposite = rotation_between(from, -from);
  CHECK((opposite * from + from).norm() < 1e-14);
  CHECK(std::abs(opposite.determinant() - 1) < 1e-14);
}

TEST_CASE("the fitted rotation is the one that paired points were turned by", "[core]") {
  srand(1);
  const Eigen::Matrix3Xd from = Eigen::Matrix3Xd::Random(3, 20);
  const Matrix3d turn = Eigen::AngleAxisd(2.5, Vector3d(3, 1, -2).normalized()).matrix();
  const RotationFit fit = fit_rotation(1.5 * turn * from * from.transpose());
  CHECK((fit.rotation - turn).norm() < 1e-13);
  CHECK(std::abs(fit.singular_values.sum() / from.squaredNorm() - 1.5) < 1e-13);
  CHECK((turn * fit.from - fit.to).norm() < 1e-13);
  // A mirror image: the best proper rotation, and the sign tells.
  const Matrix3d mirror = Vector3d(-1, 1, 1).asDiagonal();
  const RotationFit mirrored = fit_rotation(mirror * from * from.transpose());
  CHECK(std::abs(mirrored.rotation.determinant() - 1) < 1e-13);
  CHECK(mirrored.singular_values[2] < 0);
}

TEST_CASE("the misfit of least squares is orthogonal to all columns", "[core]") {
  srand(2);
  const Eigen::MatrixXd a = Eigen::MatrixXd::Random(30, 4), b = Eigen::MatrixXd::Random(30, 2);
  const Eigen::MatrixXd x = least_squares(a, b);
  CHECK((a.transpose() * (a * x - b)).cwiseAbs().maxCoeff() < 1e-13);
}
