#include "surface/motion_prediction.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "cad/alignment.h"

namespace cadmorph {
namespace {

using Eigen::Vector3d;

constexpr std::size_t kMaxLandmarks = 1500;
constexpr double kThin = 0.01;           // least extent over largest
constexpr double kAnchorDistance = 1.5;  // diagonals
constexpr double kExact = 1e-7;          // of the diagonal: the tolerance of exchanged B-Reps
constexpr double kApart = 1e-6;          // of the diagonal: nearer landmarks are one

struct Landmarks {
  std::vector<Vector3d> from, to;
};

void add(Landmarks& marks, const std::vector<EntityFeature>& a, const std::vector<EntityFeature>& b,
         std::size_t begin_a, std::size_t begin_b, const std::vector<int>& map) {
  for (std::size_t i = 0; i < map.size(); ++i) {
    marks.from.push_back(a[begin_a + i].centre);
    marks.to.push_back(b[begin_b + static_cast<std::size_t>(map[i])].centre);
  }
}

// Corners first: they are exact, centroids only nearly so.
Landmarks collect(const CadModel& base, const CadModel& variant, const TopologyMatch& match) {
  const auto a = entity_features(base), b = entity_features(variant);
  const std::size_t faces = match.faces.size(), curves = match.curves.size();
  Landmarks marks;
  add(marks, a, b, faces + curves, faces + curves, match.corners);
  add(marks, a, b, faces, faces, match.curves);
  add(marks, a, b, 0, 0, match.faces);
  return marks;
}

// Landmarks on a line or in a plane say nothing of what lies beside: there the alignment holds.
void add_anchors(double distance, std::vector<Vector3d>& from, std::vector<Vector3d>& value) {
  Vector3d mean = Vector3d::Zero();
  for (const Vector3d& p : from) mean += p / static_cast<double>(from.size());
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  for (const Vector3d& p : from) scatter += (p - mean) * (p - mean).transpose();
  const Vector3d extent = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(scatter).eigenvalues();
  if (extent[0] > kThin * kThin * extent[2]) return;
  for (int corner = 0; corner < 8; ++corner) {
    const Vector3d side(corner & 1 ? 1 : -1, corner & 2 ? 1 : -1, corner & 4 ? 1 : -1);
    from.push_back(mean + distance * side);
    value.push_back(Vector3d::Zero());
  }
}

}  // namespace

MotionPrediction::MotionPrediction(const CadModel& base, const CadModel& variant,
                                   const TopologyMatch& match)
    : alignment_(match.alignment) {
  if (match.is_congruent) return;
  const Landmarks marks = collect(base, variant, match);
  double largest = 0;
  for (std::size_t i = 0; i < match.corners.size() + match.curves.size(); ++i)
    largest = std::max(largest, (alignment_(marks.from[i]) - marks.to[i]).norm());
  if (largest < kExact * variant.diagonal()) return;
  const std::size_t stride = (marks.from.size() + kMaxLandmarks - 1) / kMaxLandmarks;
  std::vector<Vector3d> from, value;
  for (std::size_t i = 0; i < marks.from.size(); i += stride) {
    const bool is_new = std::none_of(from.begin(), from.end(), [&](const Vector3d& p) {
      return (p - marks.from[i]).norm() < kApart * base.diagonal();
    });
    if (!is_new) continue;
    from.push_back(marks.from[i]);
    value.push_back(marks.to[i] - alignment_(marks.from[i]));
  }
  add_anchors(kAnchorDistance * base.diagonal(), from, value);
  RowMatrix centres(static_cast<Index>(from.size()), 3), values(centres.rows(), 3);
  for (Index i = 0; i < centres.rows(); ++i) {
    centres.row(i) = from[static_cast<std::size_t>(i)];
    values.row(i) = value[static_cast<std::size_t>(i)];
  }
  remainder_ =
      std::make_unique<RbfField>(RbfSystem(centres, Kernel::biharmonic_3d()).solve(values));
}

Points MotionPrediction::operator()(const Points& points) const {
  Points moved(points.rows(), 3);
  for (Index i = 0; i < points.rows(); ++i)
    moved.row(i) = alignment_(points.row(i).transpose()).transpose();
  if (remainder_) moved += remainder_->evaluate(points);
  return moved;
}

Vector3d MotionPrediction::operator()(const Vector3d& point) const {
  Points one(1, 3);
  one.row(0) = point;
  return (*this)(one).row(0);
}

}  // namespace cadmorph
