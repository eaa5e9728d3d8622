#include "core/rbf/affine_fit.h"

#include <Eigen/Cholesky>
#include <cmath>

#include "core/kd_tree.h"
#include "core/parallel.h"
#include "core/rbf/centre_frame.h"

namespace cadmorph {
namespace {

// Neighbour whose distance is the spacing of the centres: the nearest may lie across a thin gap.
constexpr Index kNeighbour = 3;

}  // namespace

Eigen::VectorXd surface_shares(const RowMatrix& centres) {
  const int extent = CentreFrame(centres).terms() - 1;  // a flat set has the border of a plane
  const KdTree tree(centres);
  Eigen::VectorXd result(centres.rows());
  parallel_for(centres.rows(), 1024, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) {
      const double spacing =
          tree.nearest(centres.row(i).data(), kNeighbour + 1).back().squared_distance;
      result(i) = std::pow(spacing, 0.5 * (extent - 1));
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
