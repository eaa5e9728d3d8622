#include "core/lbfgs.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <limits>

namespace cadmorph {

using Eigen::VectorXd;

namespace {

struct UnitGuess : HessianGuess {
  VectorXd solve(const VectorXd& vector) const override { return vector; }
};

const HessianGuess& unit_guess(const VectorXd&) {
  static const UnitGuess guess;
  return guess;
}

}  // namespace

TEST_CASE("L-BFGS finds the minimum of a badly scaled quadratic", "[lbfgs]") {
  const int n = 50;
  const VectorXd scales = VectorXd::LinSpaced(n, 0, 6).array().exp();
  const VectorXd goal = VectorXd::LinSpaced(n, -1, 2);
  const auto value = [&](const VectorXd& x, VectorXd& gradient) {
    gradient = scales.cwiseProduct(x - goal);
    return 0.5 * (x - goal).dot(gradient) + 1;
  };
  VectorXd x = VectorXd::Zero(n);
  minimise_lbfgs(value, x, unit_guess, 500);
  // It stops where the value, 1, falls by less than 1e-7.
  CHECK((x - goal).cwiseAbs().maxCoeff() < 2e-3);
}

TEST_CASE("L-BFGS follows Rosenbrock's valley", "[lbfgs]") {
  const auto value = [](const VectorXd& x, VectorXd& gradient) {
    const double a = 1 - x[0], b = x[1] - x[0] * x[0];
    gradient.resize(2);
    gradient << -2 * a - 400 * b * x[0], 200 * b;
    return a * a + 100 * b * b;
  };
  VectorXd x(2);
  x << -1.2, 1;
  minimise_lbfgs(value, x, unit_guess, 200);
  CHECK(x[0] == Approx(1).margin(1e-4));
  CHECK(x[1] == Approx(1).margin(1e-4));
}

TEST_CASE("L-BFGS asks for the Hessian anew, and goes no farther than a guess is good for",
          "[lbfgs]") {
  // Infinite beyond 0, and the steeper the nearer: most steps of a guess from afar end there.
  struct Guess : HessianGuess {
    VectorXd solve(const VectorXd& vector) const override {
      return vector.cwiseProduct(x.cwiseAbs2());
    }
    void shorten(VectorXd& step) const override { step = step.cwiseMin(-x / 2).cwiseMax(x / 2); }
    VectorXd x;
  } guess;
  const VectorXd pull = VectorXd::LinSpaced(30, 0, 12).array().exp();
  const auto value = [&](const VectorXd& x, VectorXd& gradient) {
    if (!(x.maxCoeff() < 0)) return std::numeric_limits<double>::infinity();
    gradient = -x.cwiseInverse() - pull;
    return -(-x).array().log().sum() - pull.dot(x);
  };
  int asked = 0;
  VectorXd x = VectorXd::Constant(30, -1);
  minimise_lbfgs(
      value, x,
      [&](const VectorXd& at) -> const HessianGuess& {
        ++asked;
        guess.x = at;
        return guess;
      },
      200);
  CHECK(asked > 1);
  CHECK((x.cwiseProduct(pull) + VectorXd::Ones(30)).cwiseAbs().maxCoeff() < 1e-2);
}

}  // namespace cadmorph
