#include "surface/face_border.h"

#include <utility>

#include "core/errors.h"
#include "core/rbf/multiscale_correction.h"

namespace cadmorph {
namespace {

// Of the largest misfit, what may be left. The misfit is some thousandths of the samples' distance:
// this part of it is far below the height of any cell.
constexpr double kLeft = 1e-6;

}  // namespace

FaceBorder::FaceBorder(const CadModel& base, FaceId face, std::vector<FaceDomain::Sample> nodes,
                       const Points& points, double spacing)
    : nodes_(std::move(nodes)),
      scale_(mean_derivatives(base, face)),
      order_(farthest_point_order(points)),
      points_(points(order_.rows, Eigen::all)),
      spacing_(spacing) {}

Parameters FaceBorder::uv() const {
  Parameters result(std::ssize(nodes_), 2);
  for (Index i = 0; i < result.rows(); ++i) result.row(i) = nodes_[i].uv;
  return result;
}

Parameters FaceBorder::spread(const Parameters& misfit, const Points& to) const {
  const Eigen::MatrixXd lengths = (misfit * scale_.asDiagonal())(order_.rows, Eigen::all);
  const double most = lengths.rowwise().norm().maxCoeff();
  if (!(most > 0)) return Parameters::Zero(to.rows(), 2);
  try {
    const MultiscaleCorrection correction(points_, order_.separation, lengths / most,
                                          Eigen::VectorXd::Constant(lengths.rows(), kLeft),
                                          spacing_);
    return most * correction.evaluate(to) * scale_.cwiseInverse().asDiagonal();
  } catch (const SolverError&) {  // nodes at one place that part, on the two sides of a slit
    return Parameters::Zero(to.rows(), 2);
  }
}

}  // namespace cadmorph
