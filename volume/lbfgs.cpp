#include "volume/lbfgs.h"

#include <cmath>
#include <deque>
#include <vector>

namespace cadmorph {
namespace {

using Eigen::VectorXd;

constexpr std::size_t kMemory = 10;
constexpr double kSufficientDecrease = 1e-4;
constexpr int kBacktracks = 40;
// Relative decrease below which the value counts as settled, twice in a row.
constexpr double kSettled = 1e-7;

struct Pair {
  VectorXd step, change;
  double inverse_curvature;
};

// Two-loop recursion: the direction -H^-1 g.
VectorXd descent(const std::deque<Pair>& pairs, const VectorXd& gradient,
                 const VectorXd& diagonal) {
  VectorXd q = gradient;
  std::vector<double> alpha(pairs.size());
  for (std::size_t i = pairs.size(); i-- > 0;) {
    alpha[i] = pairs[i].inverse_curvature * pairs[i].step.dot(q);
    q -= alpha[i] * pairs[i].change;
  }
  q.array() /= diagonal.array();
  if (!pairs.empty()) {
    const VectorXd& y = pairs.back().change;
    const double scaled = (y.array().square() / diagonal.array()).sum();
    q *= 1 / (pairs.back().inverse_curvature * scaled);
  }
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const double beta = pairs[i].inverse_curvature * pairs[i].change.dot(q);
    q += (alpha[i] - beta) * pairs[i].step;
  }
  return -q;
}

}  // namespace

int minimise_lbfgs(const Objective& objective, VectorXd& x, const VectorXd& diagonal,
                   int iterations) {
  VectorXd gradient, new_gradient;
  double value = objective(x, gradient);
  std::deque<Pair> pairs;
  int settled = 0, done = 0;
  while (done < iterations && settled < 2) {
    VectorXd direction = descent(pairs, gradient, diagonal);
    double slope = gradient.dot(direction);
    if (!(slope < 0)) {
      if (pairs.empty()) break;
      pairs.clear();
      continue;
    }
    double length = 1, new_value = value;
    int tries = 0;
    VectorXd candidate;
    for (; tries < kBacktracks; ++tries, length /= 2) {
      candidate = x + length * direction;
      new_value = objective(candidate, new_gradient);
      if (std::isfinite(new_value) && new_value <= value + kSufficientDecrease * length * slope)
        break;
    }
    if (tries == kBacktracks) {
      if (pairs.empty()) break;
      pairs.clear();  // once more along the gradient
      continue;
    }
    ++done;
    const VectorXd change = new_gradient - gradient;
    const double curvature = change.dot(candidate - x);
    if (curvature > 1e-12 * change.norm() * (candidate - x).norm()) {
      pairs.push_back({candidate - x, change, 1 / curvature});
      if (pairs.size() > kMemory) pairs.pop_front();
    }
    settled = value - new_value < kSettled * std::abs(value) ? settled + 1 : 0;
    x = candidate;
    gradient = new_gradient;
    value = new_value;
  }
  return done;
}

}  // namespace cadmorph
