#include "surface/motion_prediction.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "cad/alignment.h"

namespace cadmorph {
namespace {

using Eigen::Vector3d;

constexpr std::size_t kMaxLandmarks = 1500;  // a dense solve of a tenth of a second
// Least extent over largest: centroids of faces err by as much. With half or twice of this, or of
// kAnchorDistance, 14 pairs come out the same.
constexpr double kThin = 0.03;
constexpr double kAnchorDistance = 1.5;  // diagonals from the mean: the part is within one
constexpr double kExact = 1e-7;          // of the diagonal: the tolerance of exchanged B-Reps
constexpr double kApart = 1e-6;  // of the diagonal: nearer landmarks are one, ten times kExact
constexpr double kBallRadius = 0.282;  // of the square root of its area: 1 / sqrt(4 pi)
constexpr double kMoved = 0.05;        // of a closed face's size: its centroid is that exact

struct Landmarks {
  std::vector<Vector3d> from, to;
  double largest = 0;  ///< distance from the alignment, as far as it is no noise of centroids
};

void add(Landmarks& marks, const std::vector<EntityFeature>& a, const std::vector<EntityFeature>& b,
         std::size_t begin, const auto& map) {
  for (const auto id : map.ids()) {
    marks.from.push_back(a[begin + static_cast<std::size_t>(id)].centre);
    marks.to.push_back(b[begin + static_cast<std::size_t>(map[id])].centre);
  }
}

bool has_curves(const CadModel& model, FaceId face) {
  return std::ranges::any_of(model.faces()[face].wires, [&](const auto& wire) {
    return std::ranges::any_of(wire, [&](CoedgeId c) {
      return model.skeleton().curve_of_edge[model.coedges()[c].edge] >= 0;
    });
  });
}

// A closed face, such as a ball, has no curve to tell of its motion: marks around its centroid
// keep it in one piece.
void add_closed_face(const Similarity& alignment, const EntityFeature& a, const EntityFeature& b,
                     Landmarks& marks) {
  const double moved = (alignment(a.centre) - b.centre).norm();
  if (moved > kMoved * b.size) marks.largest = std::max(marks.largest, moved);
  for (int axis = 0; axis < 3; ++axis)
    for (const double side : {-kBallRadius, kBallRadius}) {
      const Vector3d way = side * Vector3d::Unit(axis);
      marks.from.push_back(a.centre + a.size * way);
      marks.to.push_back(b.centre + b.size * (alignment.rotation * way));
    }
}

// Corners first: they are exact, centroids only nearly so.
Landmarks collect(const CadModel& base, const CadModel& variant, const TopologyMatch& match) {
  const auto a = entity_features(base), b = entity_features(variant);
  const std::size_t faces = match.faces.size(), curves = match.curves.size();
  Landmarks marks;
  add(marks, a, b, faces + curves, match.corners);
  add(marks, a, b, faces, match.curves);
  for (std::size_t i = 0; i < marks.from.size(); ++i)
    marks.largest = std::max(marks.largest, (match.alignment(marks.from[i]) - marks.to[i]).norm());
  add(marks, a, b, 0, match.faces);
  for (const FaceId f : match.faces.ids())
    if (!has_curves(base, f)) add_closed_face(match.alignment, a[f], b[match.faces[f]], marks);
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
  if (marks.largest < kExact * variant.diagonal()) return;
  const std::size_t stride = (marks.from.size() + kMaxLandmarks - 1) / kMaxLandmarks;
  std::vector<Vector3d> from, value;
  std::vector<int> count;
  for (std::size_t i = 0; i < marks.from.size(); i += stride) {
    const Vector3d moved = marks.to[i] - alignment_(marks.from[i]);
    const auto same = std::ranges::find_if(from, [&](const Vector3d& p) {
      return (p - marks.from[i]).norm() < kApart * base.diagonal();
    });
    if (same != from.end()) {  // two circles about one point: the mean, whichever comes first
      const auto at = same - from.begin();
      value[at] += (moved - value[at]) / ++count[at];
      continue;
    }
    from.push_back(marks.from[i]);
    value.push_back(moved);
    count.push_back(1);
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
