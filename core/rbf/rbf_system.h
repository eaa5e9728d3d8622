#pragma once

#include <exception>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "core/archive.h"
#include "core/progress.h"
#include "core/rbf/field_terms.h"
#include "core/rbf/kernel.h"
#include "core/types.h"

namespace cadmorph {

class FieldDerivative;

enum class SolverKind {
  Auto,
  Lu,
  Ldlt,
  Cholesky,  ///< on the space without linear polynomials
  Iqr,       ///< incremental QR: least squares with some of the centres (Sieger et al., sect. 7)
  Fast,      ///< iterative
  Adaptive,  ///< few centres, chosen by the values, and a correction that meets all others
};

struct RbfOptions {
  SolverKind solver = SolverKind::Auto;
  /// Fast solver: residual allowed at each centre, in units of its local length. The default keeps
  /// the field within 4e-5 local lengths of the dense solvers' (measured, docs/fast-solver.md).
  /// Incremental QR: the root mean square of the residuals, in that unit. Adaptive: the residual
  /// after the correction.
  double tolerance = 1e-5;
  /// Local length of each centre (its shortest incident mesh edge); empty: nearest-neighbour
  /// distance.
  Eigen::VectorXd local_length = {};
  /// Adaptive: largest unit of what the centres may miss before the correction, in the unit of the
  /// values (AdaptiveOptions::most_missed).
  double most_missed = std::numeric_limits<double>::infinity();
  /// Adaptive: centres to start from, beside a few hundred that are farthest from each other.
  std::vector<Index> first_centres = {};
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
  int iterations = 0;                    ///< fast solver; incremental QR, adaptive: kernels taken
  double max_residual = 0;               ///< largest residual at a centre, in local lengths
  double seconds = 0;                    ///< set-up and solve

  /// All but the time.
  template <class Archive>
  void serialize(Archive& archive) {
    archive(solver, reason, centres, merged, polynomial_terms, reciprocal_condition, iterations,
            max_residual);
  }
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
  friend class RbfTargets;
  struct Impl;
  std::shared_ptr<const Impl> impl_;
};

/// One of several solutions: its field, or why there is none.
struct RbfSolution {
  RbfField field;
  std::exception_ptr error;
};

/// The derivative of a field's values at targets by those at the centres, and its transpose. Both
/// maps act on each column by itself, however many.
class RbfDerivative {
 public:
  /// Returns T x M for values (N x M) at the given centres.
  Eigen::MatrixXd forward(const Eigen::MatrixXd& values) const;

  /// Returns N x M for slopes (T x M) by the values at the targets.
  Eigen::MatrixXd adjoint(const Eigen::MatrixXd& slopes) const;

 private:
  friend class RbfSystem;
  std::shared_ptr<const FieldDerivative> map_;
  std::vector<Index> rows_;  // the first of each set of merged centres
  Index count_ = 0;
};

/// Everything of an RBF interpolation that depends on the centres alone: reduction of duplicate and
/// flat sets, and the factorisation or preconditioner. Solves for any number of value sets.
class RbfSystem {
 public:
  /// Sets up the system for N x D centres. Exact duplicates are merged; centres on a common plane
  /// or line lose the polynomial directions they can't determine. Throws InvalidInputError on an
  /// empty or non-finite set, SolverError when the system is numerically singular or too large.
  RbfSystem(const RowMatrix& centres, Kernel kernel, RbfOptions options = {});

  /// The system that was stored, for the same centres, kernel and options (local lengths aside).
  /// Its solutions are to the last bit those of the system that was stored.
  RbfSystem(const RowMatrix& centres, Kernel kernel, RbfOptions options, InputArchive& archive);
  void store(OutputArchive& archive) const;

  /// Solves for N x M values (eq. 3). Duplicated centres must carry equal values to 1e-9 of the
  /// largest value. Throws InvalidInputError on sizes, NaN or contradictory duplicates,
  /// SolverError when the asked accuracy is not reached.
  RbfField solve(const RowMatrix& values) const;

  /// Solves for several value sets at once, which share the evaluations of the kernel where the
  /// solver iterates. Each field is to the last bit the one of `solve`, whatever the others are; an
  /// error of one leaves the others alone. `seconds` of their reports are shares of the whole.
  std::vector<RbfSolution> solve_each(const std::vector<RowMatrix>& value_sets) const;

  /// What the field of a solution does at targets (T x D) as a linear map of the values at the
  /// system's centres, with its kernels fixed (see FieldDerivative). Centres merged into one count
  /// by the value of the first. Throws InvalidInputError for the incremental QR, which fits values
  /// instead of meeting them, and what FieldDerivative throws.
  RbfDerivative derivative(const RbfField& field, const RowMatrix& targets) const;

  /// The same where all centres have kernels.
  RbfDerivative derivative(const RowMatrix& targets) const;

  /// The centres that a solution has kernels at, ascending.
  std::vector<Index> kernels(const RbfField& field) const;

  const RbfReport& report() const;

 private:
  friend class RbfTargets;
  struct Impl;
  RbfDerivative derivative(std::vector<Index> rows, const RowMatrix& targets) const;
  std::shared_ptr<const Impl> impl_;
};

/// Targets at which fields of one system are evaluated again and again. Keeps all that depends on
/// centres and targets alone.
class RbfTargets {
 public:
  /// `targets`: T x D.
  RbfTargets(const RbfSystem& system, const RowMatrix& targets);

  /// The targets that were stored, for the same system.
  RbfTargets(const RbfSystem& system, InputArchive& archive);
  void store(OutputArchive& archive) const;

  /// Evaluates fields of the system; returns T x M each, to the last bit what RbfField::evaluate
  /// returns. Fields evaluated together share the evaluations of the kernel.
  std::vector<RowMatrix> evaluate(const std::vector<RbfField>& fields) const;

 private:
  struct Impl;
  std::shared_ptr<const Impl> impl_;
};

}  // namespace cadmorph
