#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/archive.h"
#include "core/progress.h"
#include "core/rbf/unit_field.h"
#include "core/types.h"

namespace cadmorph {

struct FastOptions {
  double tolerance = 1e-5;  ///< residual allowed at each point, in units of its local length
  double unit = 1;          ///< unit of the values in that of the points
  Progress progress = {};
};

/// What a fast solution took.
struct FastReport {
  int iterations = 0;
  /// Largest true residual at a centre, in units of its allowance: above 1 only where the rounding
  /// of the sums is.
  double residual = 0;
  double in_local_lengths = 0;  ///< the same in local lengths
  Index thinned = 0;            ///< points left to the multiscale correction
  std::string remarks;          ///< what was substituted, if anything
};

/// A fast solution, or why there is none.
struct FastSolution {
  std::optional<UnitField> field;
  std::string error;
  FastReport report;
};

/// Interpolation with r^3 and linear polynomials in space at a cost that grows almost linearly:
/// conjugate gradients with a sparse inverse Cholesky preconditioner and an H2 matrix. Points
/// closer than 2.5e-5 of the bounding box's diagonal to coarser ones are served by a multiscale
/// correction. Keeps all that depends on the points for any number of value sets.
class FastSolver {
 public:
  /// `points`: N x 3, N >= 5, distinct, of unit size; `local_length`: N, in the unit of the points,
  /// empty for the distance to the nearest neighbour. Residuals below 1e-9 of the largest value are
  /// always allowed: they are rounding of the sums; so are larger ones, up to 1e-6 of it, where the
  /// weights are so large that the sums round to no less. Throws SolverError when the factor can't
  /// be built.
  FastSolver(const Eigen::MatrixXd& points, const Eigen::VectorXd& local_length,
             FastOptions options = {});

  /// The solver that was stored, for the same points and options.
  FastSolver(const Eigen::MatrixXd& points, FastOptions options, InputArchive& archive);
  void store(OutputArchive& archive) const;

  /// Solves for sets of N x M values to the allowed residual, verified with the true residual. The
  /// sets share the evaluations of the kernel; each solution is to the last bit what it would be
  /// alone, and does not depend on what was solved before.
  std::vector<FastSolution> solve(const std::vector<Eigen::MatrixXd>& value_sets) const;

  /// The H2 matrix; null where sums are direct.
  std::shared_ptr<const H2Matrix> far_field() const;

  /// The widest spacing of the correction's levels.
  double correction_from() const;

  /// What was chosen at set-up, for the report.
  const std::string& remarks() const;

 private:
  struct Impl;
  std::shared_ptr<const Impl> impl_;
};

}  // namespace cadmorph
