#include "cad/entity_motion.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

namespace cadmorph {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Eigen::Vector4d;

// Of the points' scatter: far above rounding, so that it decides what they leave open, and too
// little to change what they tell.
constexpr double kPrior = 1e-6;
// Keeps local fits from swinging beyond their points: counts as much as these in directions in
// which they spread by a tenth of the neighbourhood's radius.
constexpr double kLocalPrior = 1e-2;
// Of the neighbourhood's radius, where weights stop growing: the nearest point counts at most 26
// times as much as the farthest.
constexpr double kNearest = 0.2;

}  // namespace

RoughMotion fit_affine(const std::vector<Vector3d>& from, const std::vector<Vector3d>& to,
                       const Similarity& prior) {
  Vector3d a = Vector3d::Zero(), b = Vector3d::Zero();
  const auto count = static_cast<double>(std::max<std::size_t>(from.size(), 1));
  for (std::size_t i = 0; i < from.size(); ++i) {
    a += from[i] / count;
    b += to[i] / count;
  }
  Matrix3d scatter = Matrix3d::Zero(), covariance = Matrix3d::Zero();
  for (std::size_t i = 0; i < from.size(); ++i) {
    scatter += (from[i] - a) * (from[i] - a).transpose();
    covariance += (to[i] - b) * (from[i] - a).transpose();
  }
  const Matrix3d like = prior.scale * prior.rotation;
  const double weight = kPrior * scatter.trace();
  if (!(weight > 0)) return [prior](const Vector3d& x) { return prior(x); };
  const Matrix3d linear =
      (covariance + weight * like) * (scatter + weight * Matrix3d::Identity()).inverse();
  return [=](const Vector3d& x) -> Vector3d { return b + linear * (x - a); };
}

EntityMotion::EntityMotion(RoughMotion rough, const std::vector<Vector3d>& from,
                           const std::vector<Vector3d>& to, int neighbours)
    : rough_(std::move(rough)), from_(from), neighbours_(neighbours) {
  if (from.empty()) return;
  RowMatrix points(static_cast<Index>(from.size()), 3);
  for (std::size_t i = 0; i < from.size(); ++i) {
    points.row(static_cast<Index>(i)) = from[i];
    missed_.push_back(to[i] - rough_(from[i]));
  }
  tree_ = std::make_unique<KdTree>(points);
}

EntityMotion::Place EntityMotion::place_of(const Vector3d& x, int left_out) const {
  const Vector3d at = rough_(x);
  if (!tree_) return {at};
  auto near = tree_->nearest(x.data(), neighbours_ + (left_out >= 0));
  std::erase_if(near, [&](const Neighbour& n) { return n.index == left_out; });
  if (near.empty()) return {at};
  const double reach = std::sqrt(near.front().squared_distance);
  const double radius = near.back().squared_distance;
  if (radius <= 0) return {at + missed_[static_cast<std::size_t>(near.front().index)], reach};
  Eigen::Matrix4d normal = Eigen::Matrix4d::Zero();
  Eigen::Matrix<double, 4, 3> right = Eigen::Matrix<double, 4, 3>::Zero();
  double sum = 0;
  for (const Neighbour& n : near) {
    const double weight = 1 / (n.squared_distance / radius + kNearest * kNearest);
    const auto i = static_cast<std::size_t>(n.index);
    Vector4d basis;
    basis << 1, (from_[i] - x) / std::sqrt(radius);
    normal += weight * basis * basis.transpose();
    right += weight * basis * missed_[i].transpose();
    sum += weight;
  }
  normal.diagonal().tail<3>().array() += kLocalPrior * sum;
  return {at + normal.ldlt().solve(right).row(0).transpose(), reach};
}

}  // namespace cadmorph
