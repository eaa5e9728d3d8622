#pragma once

#include <Eigen/Core>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/archive.h"
#include "core/progress.h"
#include "core/rbf/unit_field.h"
#include "core/types.h"

namespace cadmorph {

struct AdaptiveOptions {
  double tolerance = 1e-5;  ///< residual allowed at each point, in units of its local length
  double unit = 1;          ///< unit of the values in that of the points
  /// What the centres may miss counts in spacings of the points, or in this where it is less; in
  /// the unit of the values.
  double most_missed = std::numeric_limits<double>::infinity();
  /// Points (rows) to start from, beside the first in farthest-point order.
  std::vector<Index> first = {};
  Progress progress = {};
};

/// An adaptive solution, or why there is none.
struct AdaptiveSolution {
  std::optional<UnitField> field;
  std::string error;
  std::vector<Index> centres;   ///< chosen, rows of the points
  double missed = 0;            ///< most that the centres alone miss, in spacings of the points
  double in_local_lengths = 0;  ///< largest residual after the correction
};

/// Interpolation in space with r^3 and linear polynomials at as few of the points as carry the
/// values, and a MultiscaleCorrection that takes what these miss at the others (Kedward, Allen,
/// Rendall 2017). Starts from the first points in farthest-point order, and those of the options,
/// and adds those that miss their values most, spread out, until what is missed is a fraction of
/// the spacing of the points (docs/adaptive-centres.md). Keeps what depends on the points alone.
class AdaptiveSolver {
 public:
  /// `points`: N x 3, N >= 5, distinct, of unit size; `local_length`: N, in the unit of the points.
  AdaptiveSolver(const Eigen::MatrixXd& points, const Eigen::VectorXd& local_length,
                 AdaptiveOptions options = {});

  /// The solver that was stored, for the same points and options.
  AdaptiveSolver(const Eigen::MatrixXd& points, AdaptiveOptions options, InputArchive& archive);
  void store(OutputArchive& archive) const;

  /// Solves for N x M values to the allowed residual. The values alone choose the centres: the
  /// solution depends neither on what was solved before nor on the number of threads.
  AdaptiveSolution solve(const Eigen::MatrixXd& values) const;

  /// Solves with these centres (rows of the points), whatever they miss before the correction: a
  /// linear map of the values, to the residual allowed.
  AdaptiveSolution solve(const Eigen::MatrixXd& values, const std::vector<Index>& centres) const;

  /// The widest spacing of the correction's levels.
  double correction_from() const;

 private:
  struct Impl;
  std::shared_ptr<const Impl> impl_;
};

}  // namespace cadmorph
