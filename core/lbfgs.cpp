#include "core/lbfgs.h"

#include <cmath>
#include <deque>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

namespace cadmorph {
namespace {

using Eigen::VectorXd;

constexpr std::size_t kMemory = 10;  // pairs; Nocedal, Wright: 3 to 20
// Of the Wolfe conditions, as Nocedal and Wright have them for quasi-Newton methods.
constexpr double kSufficientDecrease = 1e-4, kCurvature = 0.9;
constexpr double kLeastCurvature = 1e-12;  // relative: below, a pair is rounding
constexpr int kTrials = 40;                // halvings of a step, down to 1e-12 of it
// Iterations after which the Hessian is guessed anew, which costs about as much as an evaluation.
// With 2 or 10, 9 pairs keep 1 and 2 % less of the smallest scaled Jacobian on the mean.
constexpr int kGuessAnew = 5;
// Relative decrease below which the value counts as settled, twice in a row: far below the share,
// a thousandth, by which repairs end.
constexpr double kSettled = 1e-7;

struct Pair {
  VectorXd step, change;
  double inverse_curvature;
};

// Two-loop recursion: the direction -H^-1 g.
VectorXd descent(const std::deque<Pair>& pairs, const VectorXd& gradient,
                 const HessianGuess& guess) {
  VectorXd q = gradient;
  std::vector<double> alpha(pairs.size());
  for (std::size_t i = pairs.size(); i-- > 0;) {
    alpha[i] = pairs[i].inverse_curvature * pairs[i].step.dot(q);
    q -= alpha[i] * pairs[i].change;
  }
  q = guess.solve(q);
  if (!pairs.empty()) {
    const VectorXd& y = pairs.back().change;
    q *= 1 / (pairs.back().inverse_curvature * y.dot(guess.solve(y)));
  }
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const double beta = pairs[i].inverse_curvature * pairs[i].change.dot(q);
    q += (alpha[i] - beta) * pairs[i].step;
  }
  return -q;
}

struct Point {
  VectorXd x, gradient;
  double value;
};

// A point along the direction with the weak Wolfe conditions, by bisection (Lewis, Overton 2013);
// when none is found, the farthest that lowers the value enough, if any.
std::optional<Point> search(const Objective& objective, const VectorXd& x,
                            const VectorXd& direction, double value, double slope) {
  std::optional<Point> best;
  double near = 0, far = std::numeric_limits<double>::infinity(), length = 1;
  for (int trial = 0; trial < kTrials; ++trial) {
    Point point{x + length * direction, {}, 0};
    point.value = objective(point.x, point.gradient);
    if (!(point.value <= value + kSufficientDecrease * length * slope)) {
      far = length;
    } else {
      near = length;
      const bool is_flat_enough = point.gradient.dot(direction) >= kCurvature * slope;
      best = std::move(point);
      if (is_flat_enough) break;
    }
    length = std::isfinite(far) ? (near + far) / 2 : 2 * near;
  }
  return best;
}

}  // namespace

int minimise_lbfgs(const Objective& objective, VectorXd& x,
                   const std::function<const HessianGuess&(const VectorXd& x)>& guess,
                   int iterations) {
  VectorXd gradient;
  double value = objective(x, gradient);
  const HessianGuess* hessian = &guess(x);
  std::deque<Pair> pairs;
  int settled = 0, done = 0;
  while (done < iterations && settled < 2) {
    VectorXd direction = descent(pairs, gradient, *hessian);
    hessian->shorten(direction);
    const double slope = gradient.dot(direction);
    if (!(slope < 0)) {
      if (pairs.empty()) break;
      pairs.clear();
      continue;
    }
    const auto step = search(objective, x, direction, value, slope);
    if (!step) {
      if (pairs.empty()) break;
      pairs.clear();  // once more along the gradient
      continue;
    }
    ++done;
    const VectorXd move = step->x - x, change = step->gradient - gradient;
    const double curvature = change.dot(move);
    if (curvature > kLeastCurvature * change.norm() * move.norm()) {
      pairs.push_back({move, change, 1 / curvature});
      if (pairs.size() > kMemory) pairs.pop_front();
    }
    settled = value - step->value < kSettled * std::abs(value) ? settled + 1 : 0;
    x = step->x;
    gradient = step->gradient;
    value = step->value;
    if (done < iterations && done % kGuessAnew == 0) hessian = &guess(x);
  }
  return done;
}

}  // namespace cadmorph
