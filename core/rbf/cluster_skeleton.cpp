#include "core/rbf/cluster_skeleton.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

#include "core/rbf/simd.h"

namespace cadmorph {
namespace {

using Eigen::MatrixXd;

constexpr Index kProxies = 520;  // at most: for the finest tolerance, 1e-15
constexpr int kMoments = 10;     // of the polynomials up to order 2

// Proxies that resolve a tolerance: more digits need more angles. With 20 for 40 a digit canisters
// of 15,666 and 21,124 centres take 13 and 17 iterations in place of 10 and 9; with 80, or with 60
// or 240 for 120, as many, with 80 in a quarter more time.
Index proxy_count(double tolerance) {
  const double count = 120 + 40 * std::log10(1e-5 / tolerance);
  return std::min(static_cast<Index>(count), kProxies);
}

// Weight of the moment rows: they are to be kept to about 1e-17 / tolerance of the kernel rows.
// With half or twice of 1e4 or of 0.5, with 1e-18 or 1e-16, or without these rows, the canisters
// take as many iterations, and without them the tests pass.
double moment_weight(double tolerance, Index proxies) {
  const double boost = std::clamp(std::sqrt(tolerance / 1e-17), 1.0, 1e4);
  return 0.5 * boost * std::sqrt(static_cast<double>(proxies));
}

}  // namespace

ProxyShell::ProxyShell(double separation) : points_(kProxies, 3), scale_(kProxies) {
  // With none of them near, H2 products miss sums; with a quarter, a canister of 21,124 centres
  // takes 11 iterations in place of 9, with all 9. Half and twice the others take 9, too.
  constexpr double kNear = 0.55;  // part of the proxies close to the ball, where fields are rough
  constexpr double kNearDepth = 0.15;  // of the shell they fill
  constexpr double kFar = 8;           // the others reach so many times farther
  std::mt19937 generator(7);
  const auto uniform = [&] { return (generator() + 0.5) / 4294967296.0; };
  for (Index i = 0; i < kProxies; ++i) {
    const double z = 2 * uniform() - 1, angle = 2 * std::numbers::pi * uniform();
    const bool is_near = i % 20 < 20 * kNear;
    const double u = uniform();
    const double radius = (is_near ? 1 + kNearDepth * u : std::pow(kFar, u)) / separation;
    const double ring = std::sqrt(1 - z * z);
    points_.row(i) << radius * ring * std::cos(angle), radius * ring * std::sin(angle), radius * z;
    scale_(i) = 1 / (radius * radius * radius);
  }
}

ClusterSkeleton find_skeleton(const Eigen::Ref<const Eigen::MatrixXd>& candidates,
                              const Eigen::RowVector3d& centre, double radius, double tolerance,
                              const ProxyShell& proxies) {
  const simd::Functions& simd = simd::functions(simd::best());
  const Index n = candidates.rows(), rows = proxy_count(tolerance);
  const Index stride = simd::padded(rows + kMoments);
  const double unit = radius > 0 ? 1 / radius : 1;
  const MatrixXd y = (candidates.rowwise() - centre) * unit;

  MatrixXd A(stride, n);
  simd.cubic_block(rows, proxies.points().data(), proxies.size(), proxies.scale().data(), n,
                   y.data(), n, A.data(), stride);
  A.bottomRows(stride - rows).setZero();
  const double largest = A.colwise().squaredNorm().maxCoeff();
  const double weight = moment_weight(tolerance, rows);
  for (Index j = 0; j < n; ++j) {
    const double a = y(j, 0), b = y(j, 1), c = y(j, 2);
    A.col(j).segment<kMoments>(rows) << 1, a, b, c, a * a, b * b, c * c, a * b, b * c, a * c;
    A.col(j).segment<kMoments>(rows) *= weight;
  }

  ClusterSkeleton result;
  result.permutation.resize(n);
  MatrixXd R(n, n);
  const Index rank =
      simd.pivoted_qr(rows + kMoments, n, A.data(), stride, largest * tolerance * tolerance,
                      result.permutation.data(), R.data());
  result.rank = rank;
  result.transfer = MatrixXd::Zero(simd::padded(rank), n - rank);
  result.transfer.topRows(rank) = R.topLeftCorner(rank, rank)
                                      .triangularView<Eigen::Upper>()
                                      .solve(R.topRightCorner(rank, n - rank));
  return result;
}

MatrixXd ClusterSkeleton::compress(const Eigen::Ref<const MatrixXd>& weights) const {
  const Index rest = transfer.cols(), columns = weights.cols();
  MatrixXd result(transfer.rows(), columns);
  MatrixXd others(rest, columns);
  for (Index c = 0; c < columns; ++c)
    for (Index j = 0; j < rest; ++j) others(j, c) = weights(permutation[rank + j], c);
  simd::functions(simd::best())
      .multiply(rank, rest, transfer.data(), transfer.rows(), columns, others.data(), rest,
                result.data(), result.rows());
  result.conservativeResize(rank, columns);
  for (Index c = 0; c < columns; ++c)
    for (Index i = 0; i < rank; ++i) result(i, c) += weights(permutation[i], c);
  return result;
}

MatrixXd ClusterSkeleton::expand(const Eigen::Ref<const MatrixXd>& potentials) const {
  const Index rest = transfer.cols(), columns = potentials.cols();
  MatrixXd own = MatrixXd::Zero(transfer.rows(), columns);
  own.topRows(rank) = potentials;
  MatrixXd others(rest, columns);
  simd::functions(simd::best())
      .multiply_transposed(rank, rest, transfer.data(), transfer.rows(), columns, own.data(),
                           own.rows(), others.data(), rest);
  MatrixXd result(rank + rest, columns);
  for (Index c = 0; c < columns; ++c) {
    for (Index i = 0; i < rank; ++i) result(permutation[i], c) = own(i, c);
    for (Index j = 0; j < rest; ++j) result(permutation[rank + j], c) = others(j, c);
  }
  return result;
}

}  // namespace cadmorph
