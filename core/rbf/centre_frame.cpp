#include "core/rbf/centre_frame.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <numeric>

namespace cadmorph {
namespace {

// An extent below this part of the largest is rounding of a flat set: it would give slopes made of
// noise alone.
constexpr double kFlat = 1e-9;

}  // namespace

DistinctRows distinct_rows(const RowMatrix& points) {
  const Index n = points.rows(), d = points.cols();
  const auto less = [&](Index a, Index b) {
    const double* x = points.data() + a * d;
    const double* y = points.data() + b * d;
    for (Index c = 0; c < d; ++c)
      if (x[c] != y[c]) return x[c] < y[c];
    return a < b;
  };
  std::vector<Index> sorted(n);
  std::iota(sorted.begin(), sorted.end(), Index{0});
  std::sort(sorted.begin(), sorted.end(), less);

  std::vector<Index> first(n);
  for (Index i = 0; i < n; ++i) {
    const bool same = i > 0 && points.row(sorted[i]) == points.row(sorted[i - 1]);
    first[sorted[i]] = same ? first[sorted[i - 1]] : sorted[i];
  }
  DistinctRows result;
  result.group.resize(n);
  for (Index i = 0; i < n; ++i) {
    if (first[i] == i) {
      result.group[i] = static_cast<Index>(result.rows.size());
      result.rows.push_back(i);
    } else {
      result.group[i] = result.group[first[i]];
    }
  }
  return result;
}

CentreFrame::CentreFrame(const RowMatrix& points) {
  const Index n = points.rows(), d = points.cols();
  centre_ = points.colwise().mean();
  const RowMatrix offsets = points.rowwise() - centre_;
  const double radius = std::sqrt(offsets.rowwise().squaredNorm().maxCoeff());
  if (radius > 0) unit_ = radius;
  const Eigen::MatrixXd scaled = offsets / unit_;
  const Eigen::MatrixXd moments = scaled.transpose() * scaled / static_cast<double>(n);
  const Eigen::MatrixXd axes =
      Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(moments).eigenvectors();

  // The extents come from the coordinates along each axis: square roots of eigenvalues would see no
  // flatness below 1e-8.
  std::vector<Eigen::VectorXd> slopes;
  double largest = 0;
  for (Index a = d - 1; a >= 0; --a) {
    const double extent = (scaled * axes.col(a)).norm() / std::sqrt(static_cast<double>(n));
    largest = std::max(largest, extent);
    const bool has_extent = extent > kFlat * largest && static_cast<Index>(slopes.size()) < n - 1;
    if (has_extent) slopes.push_back(axes.col(a) / extent);
  }
  slopes_.resize(d, static_cast<Index>(slopes.size()));
  for (std::size_t a = 0; a < slopes.size(); ++a) slopes_.col(static_cast<Index>(a)) = slopes[a];
}

Eigen::MatrixXd CentreFrame::to_unit(const RowMatrix& points) const {
  return (points.rowwise() - centre_) / unit_;
}

Eigen::MatrixXd CentreFrame::polynomials(
    const Eigen::Ref<const Eigen::MatrixXd>& unit_points) const {
  Eigen::MatrixXd result(unit_points.rows(), terms());
  result.col(0).setOnes();
  result.rightCols(terms() - 1).noalias() = unit_points * slopes_;
  return result;
}

Eigen::MatrixXd CentreFrame::linear(const Eigen::MatrixXd& coefficients) const {
  Eigen::MatrixXd result(dimension() + 1, coefficients.cols());
  result.row(0) = coefficients.row(0);
  result.bottomRows(dimension()) = slopes_ * coefficients.bottomRows(terms() - 1);
  return result;
}

Eigen::MatrixXd CentreFrame::linear_in_given(const Eigen::MatrixXd& coefficients) const {
  Eigen::MatrixXd result = linear(coefficients);
  result.bottomRows(dimension()) /= unit_;
  result.row(0) -= centre_ * result.bottomRows(dimension());
  return result;
}

}  // namespace cadmorph
