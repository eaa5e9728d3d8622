#pragma once

#include <memory>

#include "core/rbf/h2_matrix.h"

namespace cadmorph {

struct EvaluatorOptions {
  int order = 10;           ///< Chebyshev nodes a direction; 8 is too coarse for thin layers
  Index leaf_size = 2000;   ///< targets in a leaf at most
  double separation = 0.6;  ///< as H2Options::separation; 0.5 for layers of 1e-5
};

/// Sums over the sources of an H2 matrix at fixed targets: far sources act on tensor Chebyshev
/// nodes of boxes of targets, the interpolant is passed down an octree of the targets, near sources
/// are summed directly. Keeps the octree and the lists of sources that each box sees, which depend
/// on the points alone.
class FieldEvaluator {
 public:
  /// `targets`: T x 3.
  FieldEvaluator(const H2Matrix& matrix, const Eigen::Ref<const Eigen::MatrixXd>& targets,
                 EvaluatorOptions options = {});

  /// The evaluator that was stored.
  explicit FieldEvaluator(InputArchive& archive);
  void store(OutputArchive& archive) const;

  /// The targets; sums come in the order of its points.
  const Octree& targets() const;

  /// Returns sum_j w_j |x - x_j|^3, T x M, from weights carried to the skeletons of `matrix`, which
  /// is the one of the constructor or one of another accuracy over the same points. O(T) on all
  /// threads. A column comes out the same whatever the others and the number of threads are.
  Eigen::MatrixXd evaluate(const H2Matrix& matrix, const H2Matrix::Sources& sources) const;

 private:
  struct Impl;
  std::shared_ptr<const Impl> impl_;
};

/// Returns the sums at T x 3 targets, in their order.
Eigen::MatrixXd evaluate_field(const H2Matrix& matrix, const H2Matrix::Sources& sources,
                               const Eigen::Ref<const Eigen::MatrixXd>& targets,
                               const EvaluatorOptions& options = {});

}  // namespace cadmorph
