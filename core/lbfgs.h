#pragma once

#include <Eigen/Core>
#include <functional>

namespace cadmorph {

/// Returns the value at x and sets the gradient.
using Objective = std::function<double(const Eigen::VectorXd& x, Eigen::VectorXd& gradient)>;

/// A positive definite guess of a function's Hessian near a point.
class HessianGuess {
 public:
  virtual ~HessianGuess() = default;
  /// The guess's inverse times a vector.
  virtual Eigen::VectorXd solve(const Eigen::VectorXd& vector) const = 0;
  /// Shortens, where a step goes farther than the guess is good for.
  virtual void shorten(Eigen::VectorXd&) const {}
};

/// Minimises a smooth function by L-BFGS (Nocedal, Wright: Numerical Optimization, 2006, alg. 7.4)
/// with a weak Wolfe line search. `guess` is asked for the Hessian at the start and, anew, after
/// every few iterations. Stops after `iterations` or when the value no longer falls. Returns the
/// iterations done; `x` takes the best point.
int minimise_lbfgs(const Objective& objective, Eigen::VectorXd& x,
                   const std::function<const HessianGuess&(const Eigen::VectorXd& x)>& guess,
                   int iterations);

}  // namespace cadmorph
