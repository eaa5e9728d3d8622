#include "volume/lbfgs.h"

#include <catch2/catch.hpp>
#include <cmath>

namespace cadmorph {

using Eigen::VectorXd;

TEST_CASE("L-BFGS finds the minimum of a badly scaled quadratic", "[volume][lbfgs]") {
  const int n = 50;
  const VectorXd scales = VectorXd::LinSpaced(n, 0, 6).array().exp();
  const VectorXd goal = VectorXd::LinSpaced(n, -1, 2);
  const auto value = [&](const VectorXd& x, VectorXd& gradient) {
    gradient = scales.cwiseProduct(x - goal);
    return 0.5 * (x - goal).dot(gradient) + 1;
  };
  VectorXd x = VectorXd::Zero(n);
  minimise_lbfgs(value, x, VectorXd::Ones(n), 500);
  // It stops where the value, 1, falls by less than 1e-7.
  CHECK((x - goal).cwiseAbs().maxCoeff() < 2e-3);
}

TEST_CASE("L-BFGS follows Rosenbrock's valley", "[volume][lbfgs]") {
  const auto value = [](const VectorXd& x, VectorXd& gradient) {
    const double a = 1 - x[0], b = x[1] - x[0] * x[0];
    gradient.resize(2);
    gradient << -2 * a - 400 * b * x[0], 200 * b;
    return a * a + 100 * b * b;
  };
  VectorXd x(2);
  x << -1.2, 1;
  minimise_lbfgs(value, x, VectorXd::Ones(2), 200);
  CHECK(x[0] == Approx(1).margin(1e-4));
  CHECK(x[1] == Approx(1).margin(1e-4));
}

}  // namespace cadmorph
