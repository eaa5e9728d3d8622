#pragma once

#include <memory>
#include <vector>

#include "core/archive.h"
#include "core/rbf/kernel_sum.h"
#include "core/rbf/unit_field.h"

namespace cadmorph {

class FieldEvaluator;

/// Targets at which fields of one RBF system are evaluated. Keeps what depends on the targets and
/// the centres alone.
class UnitTargets {
 public:
  /// `points`: T x D, in unit coordinates. `far_field`: the H2 matrix of the system; null where it
  /// has none.
  UnitTargets(const KernelSum& sum, Eigen::MatrixXd points, const H2Matrix* far_field);

  /// The targets that were stored.
  UnitTargets(const KernelSum& sum, InputArchive& archive);
  void store(OutputArchive& archive) const;

  /// Returns the values of each field, T x M each; fields over the same centres share the
  /// evaluations of the kernel. A field comes out the same whatever the others and the number of
  /// threads are.
  std::vector<RowMatrix> evaluate(const std::vector<const UnitField*>& fields) const;

 private:
  const Eigen::MatrixXd& points() const;
  Eigen::MatrixXd sums(const std::vector<const UnitField*>& fields) const;
  RowMatrix finish(const UnitField& field, const Eigen::Ref<const Eigen::MatrixXd>& sums) const;

  KernelSum sum_;
  Index count_;
  Eigen::MatrixXd direct_points_;              // empty where there is an evaluator
  std::shared_ptr<const FieldEvaluator> far_;  // may be none
};

}  // namespace cadmorph
