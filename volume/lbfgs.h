#pragma once

#include <Eigen/Core>
#include <functional>

namespace cadmorph {

/// Returns the value at x and sets the gradient.
using Objective = std::function<double(const Eigen::VectorXd& x, Eigen::VectorXd& gradient)>;

/// Minimises a smooth function by L-BFGS (Nocedal, Wright: Numerical Optimization, 2006, alg. 7.4)
/// with a weak Wolfe line search. `diagonal`, positive, is the first guess of the Hessian's
/// diagonal. Stops after `iterations` or when the value no longer falls. Returns the iterations
/// done; `x` takes the best point.
int minimise_lbfgs(const Objective& objective, Eigen::VectorXd& x, const Eigen::VectorXd& diagonal,
                   int iterations);

}  // namespace cadmorph
