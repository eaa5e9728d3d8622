#include "core/rbf/affine_fit.h"

#include <Eigen/Cholesky>
#include <cmath>

#include "core/kd_tree.h"
#include "core/parallel.h"
#include "core/rbf/centre_frame.h"

namespace cadmorph {

Eigen::VectorXd surface_shares(const RowMatrix& centres) {
  const int extent = CentreFrame(centres).terms() - 1;  // a flat set has the border of a plane
  const KdTree tree(centres);
  Eigen::VectorXd result(centres.rows());
  parallel_for(centres.rows(), 1024, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) {
      const double squared = squared_spacing(tree, centres.row(i).data());
      result(i) = std::pow(squared, 0.5 * (extent - 1));
    }
  });
  return result;
}

AffineFit::AffineFit(const RowMatrix& centres, const RowMatrix& targets) {
  const CentreFrame frame(centres);
  at_centres = frame.polynomials(frame.to_unit(centres));
  at_targets = frame.polynomials(frame.to_unit(targets));
  const Eigen::MatrixXd weighted = surface_shares(centres).asDiagonal() * at_centres;
  fit = (at_centres.transpose() * weighted).ldlt().solve(weighted.transpose());
}

}  // namespace cadmorph
