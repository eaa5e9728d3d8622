#pragma once

#include <memory>
#include <string>

#include "core/progress.h"
#include "core/rbf/field_terms.h"
#include "core/rbf/kernel.h"
#include "core/types.h"

namespace cadmorph {

enum class SolverKind { Auto, Lu, Ldlt, Cholesky, Fast };

struct RbfOptions {
  SolverKind solver = SolverKind::Auto;
  /// Fast solver: residual allowed at each centre, in units of its local length. The default keeps
  /// the field within 1e-5 local lengths of the dense solvers'.
  double tolerance = 1e-5;
  /// Local length of each centre (its shortest incident mesh edge); empty: nearest-neighbour
  /// distance.
  Eigen::VectorXd local_length = {};
  /// Solvers that need more than this many bytes are refused.
  double memory_limit = 8e9;
  Progress progress = {};
};

/// How a system was set up and solved.
struct RbfReport {
  SolverKind solver = SolverKind::Auto;  ///< the one used
  std::string reason;                    ///< why `Auto` chose it, or what was substituted
  Index centres = 0;                     ///< distinct centres used
  Index merged = 0;                      ///< duplicate centres merged into another
  int polynomial_terms = 0;              ///< D + 1 less the directions missing in flat sets
  double reciprocal_condition = 0;       ///< dense solvers: LAPACK's 1-norm estimate; else 0
  int iterations = 0;                    ///< iterative solvers
  double max_residual = 0;               ///< largest residual at a centre, in local lengths
  double seconds = 0;                    ///< set-up and solve
};

/// An interpolant: sum_j w_j phi(|x - x_j|) + linear polynomial (Sieger et al. 2013, eq. 1).
class RbfField {
 public:
  /// Evaluates at T x D targets; returns T x M. Vectorised for the processor at run time, parallel,
  /// the same result for any number of threads.
  RowMatrix evaluate(const RowMatrix& targets) const;

  /// What the field is made of, to evaluate it elsewhere (see PointwiseField). Throws
  /// InvalidInputError outside three dimensions and for kernels with a logarithm.
  FieldTerms terms() const;

  const RbfReport& report() const;

 private:
  friend class RbfSystem;
  struct Impl;
  std::shared_ptr<const Impl> impl_;
};

/// Everything of an RBF interpolation that depends on the centres alone: reduction of duplicate and
/// flat sets, and the factorisation or preconditioner. Solves for any number of value sets.
class RbfSystem {
 public:
  /// Sets up the system for N x D centres. Exact duplicates are merged; centres on a common plane
  /// or line lose the polynomial directions they can't determine. Throws InvalidInputError on an
  /// empty or non-finite set, SolverError when the system is numerically singular or too large.
  RbfSystem(const RowMatrix& centres, Kernel kernel, RbfOptions options = {});

  /// Solves for N x M values (eq. 3). Duplicated centres must carry equal values to 1e-9 of the
  /// largest value. Throws InvalidInputError on sizes, NaN or contradictory duplicates,
  /// SolverError when the asked accuracy is not reached.
  RbfField solve(const RowMatrix& values) const;

  const RbfReport& report() const;

 private:
  struct Impl;
  std::shared_ptr<const Impl> impl_;
};

}  // namespace cadmorph
