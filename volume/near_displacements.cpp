#include "volume/near_displacements.h"

#include <cmath>

#include "core/kd_tree.h"
#include "core/parallel.h"
#include "core/rbf/centre_frame.h"
#include "core/rbf/multiscale_correction.h"
#include "core/rbf/point_order.h"

namespace cadmorph {
namespace {

// Of the distance to the next point: no cell between the two feels it.
constexpr double kAllowed = 1e-3;

Eigen::VectorXd distances_to_next(const Points& points) {
  const KdTree tree(points);
  Eigen::VectorXd result(points.rows());
  parallel_for(points.rows(), 1024, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i)
      result[i] = std::sqrt(tree.nearest(points.row(i).data(), 2).back().squared_distance);
  });
  return result;
}

}  // namespace

RowMatrix near_displacements(const Points& at, const RowMatrix& displacements, double reach,
                             const Points& targets) {
  const std::vector<Index> distinct = distinct_rows(at).rows;
  const Points points = at(distinct, Eigen::all);
  const PointOrder order = farthest_point_order(points);
  const Points ordered = points(order.rows, Eigen::all);
  const Eigen::MatrixXd values = displacements(distinct, Eigen::all)(order.rows, Eigen::all);
  const MultiscaleCorrection field(ordered, order.separation, values,
                                   kAllowed * distances_to_next(ordered),
                                   reach / MultiscaleCorrection::kSupport);
  if (field.is_empty()) return RowMatrix::Zero(targets.rows(), 3);
  return field.evaluate(targets);
}

}  // namespace cadmorph
