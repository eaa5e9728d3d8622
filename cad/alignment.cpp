#include "cad/alignment.h"

#include <Eigen/Dense>
#include <cmath>
#include <numbers>

#include "cad/curve_table.h"
#include "cad/face_sampler.h"
#include "cad/projector.h"
#include "core/least_squares.h"

namespace cadmorph {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

// Samples of a face in each direction, for its moments: a border is known to half a cell, 1/24 of
// the face.
constexpr int kFaceGrid = 12;
constexpr int kCurvePieces = 32;  // of an edge: a circle to 1e-12 of its length
// Of the diagonal: above the tolerance of exchanged B-Reps (1e-7 of a part's size), far below a
// design change.
constexpr double kCoincident = 1e-6;
// Of the diagonal, root mean square, and radians: what exchanged B-Reps keep of a part that did not
// change.
constexpr double kExactFit = 1e-7;
// From here to kMirrored, half and double of all but kLargeTurn leave all known pairs as they are.

// The accidental turns that were seen were half turns: a hole that crossed the middle of a plate
// turned it over. A turn of less than this is taken as it is.
constexpr double kLargeTurn = std::numbers::pi / 4;
constexpr double kSmallMove = 0.2;  // of the diagonal, as a change of parameters makes
// A large turn is real where it leaves less than this part of what a shift leaves. An accidental
// one leaves the change of parameters, as the shift does.
constexpr double kFarBetter = 0.05;
// Means over the faces, weighted by area, of 1 - cos of the angle between a face's outer normals
// before and after. The part turned if that is more than the first (all faces by 8 degrees) and
// the rotation leaves less than the second part of it: what tilts by a change of parameters.
constexpr double kFewNormals = 0.01, kNormalsTurn = 0.25;
// The variant is a mirror image where the mirrored base leaves less than the first part of what the
// base itself leaves, and that is more than the second part of the diagonal. A symmetric part fits
// both ways alike, and exactly where nothing changed.
constexpr double kMirrorFits = 0.25, kMirrored = 1e-3;
// Of a line's length, by which points on it may be off. Files keep 1e-7: points that are off by
// more than the first tell a turn about the line to 1e-3 radians. Centroids of sampled faces may be
// off by half a cell of kFaceGrid.
constexpr double kOnLine = 1e-4, kSampledOnLine = 0.05;

EntityFeature face_feature(const CadModel& model, FaceId face) {
  const CadFace& f = model.faces()[face];
  auto uv = sample_domain(model, face, kFaceGrid);
  if (uv.empty())
    for (const auto& wire : f.wires)
      for (const CoedgeId c : wire) {
        const CadEdge& e = model.edges()[model.coedges()[c].edge];
        uv.push_back(model.pcurve(c, 0.5 * (e.first + e.last)));
      }
  if (uv.empty()) uv.push_back(0.5 * (f.lower + f.upper));
  Vector3d centre = Vector3d::Zero();
  double area = 0;
  for (const Vector2d& at : uv) {
    const SurfacePoint s = model.evaluate(face, at);
    const double weight = s.du.cross(s.dv).norm() + 1e-300;
    centre += weight * s.point;
    area += weight;
  }
  const double cell = (f.upper - f.lower).prod() / (kFaceGrid * kFaceGrid);
  return {centre / area, std::sqrt(area * cell)};
}

// By Gauss's rule of three points on pieces of each link, wherever the curve starts.
EntityFeature curve_feature(const CadModel& model, CurveId curve) {
  const double outer = std::sqrt(0.6);
  Vector3d centre = Vector3d::Zero();
  double length = 0;
  for (const CurveLink& link : model.skeleton().curves[curve].links) {
    const CadEdge& edge = model.edges()[link.edge];
    const double half = 0.5 * (edge.last - edge.first) / kCurvePieces;
    for (int piece = 0; piece < kCurvePieces; ++piece)
      for (const auto& [at, weight] : {std::pair{-outer, 5.0}, {0.0, 8.0}, {outer, 5.0}}) {
        const CurvePoint p =
            model.evaluate_edge(link.edge, edge.first + half * (2 * piece + 1 + at));
        const double part = half * weight / 9 * p.dt.norm();
        centre += part * p.point;
        length += part;
      }
  }
  return {centre / length, length};
}

bool spans_a_plane(const std::vector<Vector3d>& points) {
  if (points.size() < 3) return false;
  Vector3d mean = Vector3d::Zero();
  for (const auto& p : points) mean += p / static_cast<double>(points.size());
  Matrix3d scatter = Matrix3d::Zero();
  for (const auto& p : points) scatter += (p - mean) * (p - mean).transpose();
  const Vector3d values = Eigen::SelfAdjointEigenSolver<Matrix3d>(scatter).eigenvalues();
  return values[1] > kOnLine * kOnLine * values[2];
}

// Paired points to fit: corners if they determine a rotation, else curve centroids too, else all.
// Returns how far they may lie off a line that they mean: faces' centroids come from few samples.
double landmarks(const CadModel& base, const CadModel& variant, const TopologyMatch& match,
                 std::vector<Vector3d>& from, std::vector<Vector3d>& to) {
  const auto point = [](const CadModel& m, CornerId corner) {
    return m.vertices()[m.skeleton().corners[corner]].point;
  };
  for (const CornerId c : match.corners.ids()) {
    from.push_back(point(base, c));
    to.push_back(point(variant, match.corners[c]));
  }
  if (spans_a_plane(from)) return kOnLine;
  for (const CurveId c : match.curves.ids()) {
    from.push_back(curve_feature(base, c).centre);
    to.push_back(curve_feature(variant, match.curves[c]).centre);
  }
  if (spans_a_plane(from)) return kOnLine;
  for (const FaceId f : match.faces.ids()) {
    from.push_back(face_feature(base, f).centre);
    to.push_back(face_feature(variant, match.faces[f]).centre);
  }
  return kSampledOnLine;
}

// Whether t carries the corners and curves of one shape onto those of the other. Faces alone can't
// tell the two rims of a hole through a ring apart.
bool curves_coincide(const CadModel& base, const CadModel& variant, const TopologyMatch& match,
                     const Similarity& t) {
  const double tolerance = kCoincident * variant.diagonal();
  for (const CornerId c : match.corners.ids())
    if ((t(base.vertices()[base.skeleton().corners[c]].point) -
         variant.vertices()[variant.skeleton().corners[match.corners[c]]].point)
            .norm() > tolerance)
      return false;
  for (const CurveId c : match.curves.ids()) {
    const CurveTable image(variant, match.curves[c]);
    for (const CurveLink& link : base.skeleton().curves[c].links) {
      const CadEdge& edge = base.edges()[link.edge];
      const Vector3d middle = base.evaluate_edge(link.edge, 0.5 * (edge.first + edge.last)).point;
      const EdgeFoot foot = image.nearest(t(middle));
      const double loose = edge.tolerance + variant.edges()[foot.edge].tolerance;
      if (foot.distance > std::max(tolerance, loose)) return false;
    }
  }
  return true;
}

// Whether t carries one shape onto the other as point sets.
bool coincide(const CadModel& base, const CadModel& variant, const TopologyMatch& match,
              const Similarity& t) {
  const double tolerance = kCoincident * variant.diagonal();
  if (std::abs(t.scale * base.diagonal() - variant.diagonal()) > 0.5 * variant.diagonal() ||
      !curves_coincide(base, variant, match, t))
    return false;
  for (const FaceId f : match.faces.ids())
    for (const Vector2d& at : sample_domain(base, f, 3))
      if (project_globally(variant, match.faces[f], t(base.evaluate(f, at).point)).distance >
          tolerance)
        return false;
  return true;
}

void equal_parameters(const CadModel& base, const CadModel& variant, const TopologyMatch& match,
                      bool has_planes, std::vector<Vector3d>& from, std::vector<Vector3d>& to) {
  constexpr int n = 4;  // in each direction: points of a single face determine the rotation
  for (const FaceId f : match.faces.ids()) {
    const CadFace& a = base.faces()[f];
    const CadFace& b = variant.faces()[match.faces[f]];
    if (!has_planes && a.type == SurfaceType::Plane) continue;
    for (int i = 0; i < n; ++i)
      for (int j = 0; j < n; ++j) {
        const Vector2d s((i + 0.5) / n, (j + 0.5) / n);
        from.push_back(base.evaluate(f, a.lower + s.cwiseProduct(a.upper - a.lower)).point);
        to.push_back(
            variant.evaluate(match.faces[f], b.lower + s.cwiseProduct(b.upper - b.lower)).point);
      }
  }
}

Vector3d mean_of(const std::vector<Vector3d>& points) {
  Vector3d mean = Vector3d::Zero();
  for (const auto& p : points) mean += p;
  return mean / static_cast<double>(std::max<std::size_t>(points.size(), 1));
}

// Rotation of least angle among those that maximise trace(R C), C the cross-covariance of points
// that lie on a line where they leave it by less than `line`.
Matrix3d best_rotation(const Matrix3d& covariance, double line) {
  const RotationFit fit = fit_rotation(covariance);
  const Vector3d s = fit.singular_values;
  if (s[0] <= 1e-300) return Matrix3d::Identity();
  // Turn the direction of the line only.
  if (s[1] <= line * line * s[0]) return rotation_between(fit.from, fit.to);
  return fit.rotation;
}

// The integral of a face's outer normal; of a closed one zero.
Vector3d vector_area(const CadModel& model, FaceId face) {
  const CadFace& f = model.faces()[face];
  const double cell = (f.upper - f.lower).prod() / (kFaceGrid * kFaceGrid);
  Vector3d sum = Vector3d::Zero();
  for (const Vector2d& uv : sample_domain(model, face, kFaceGrid)) {
    const SurfacePoint s = model.evaluate(face, uv);
    sum += cell * s.du.cross(s.dv).norm() * model.normal(face, uv);
  }
  return sum;
}

// Whether the outsides of the faces of solids turn with the part. Those of a part that was turned
// do, whatever else changed; those about a bore that moved stay.
bool normals_turn(const CadModel& base, const CadModel& variant, const TopologyMatch& match,
                  const Matrix3d& rotation) {
  double all = 0, turned = 0, still = 0;  // sums of areas, and of these times 1 - cos(angle)
  for (const FaceId f : match.faces.ids()) {
    if (base.faces()[f].solid < 0 || variant.faces()[match.faces[f]].solid < 0) continue;
    const Vector3d from = vector_area(base, f), to = vector_area(variant, match.faces[f]);
    const double area = std::sqrt(from.norm() * to.norm());
    all += area;
    turned += area - (rotation * from.normalized()).dot(to.normalized()) * area;
    still += area - from.normalized().dot(to.normalized()) * area;
  }
  return still > kFewNormals * all && turned < kNormalsTurn * still;
}

// Whether points that move a little fit a large turn of the whole part by accident: a bore whose
// eccentricity changes its direction. Points that all lie on one line never prove a large turn.
bool is_accidental_turn(const Similarity& turned, const Similarity& unturned,
                        const std::vector<Vector3d>& from, const std::vector<Vector3d>& to,
                        double diagonal) {
  if (Eigen::AngleAxisd(turned.rotation).angle() < kLargeTurn) return false;
  const double left = residual(unturned, from, to);
  return left < kSmallMove * diagonal &&
         (!spans_a_plane(from) || residual(turned, from, to) > kFarBetter * left);
}

// Points where seams end: a spin that only moves seams leaves these points in place.
std::vector<Vector3d> poles(const CadModel& model) {
  std::vector<Vector3d> points;
  for (const CadEdge& edge : model.edges())
    if (edge.is_degenerate && edge.start >= 0) points.push_back(model.vertices()[edge.start].point);
  return points;
}

// An exact fit of parameters that only spins a body of revolution about its axis: its seams moved,
// not the part. The motion is least without the spin.
void undo_spin(const CadModel& base, const CadModel& variant, TopologyMatch& match) {
  const Similarity& spun = match.alignment;
  if (Eigen::AngleAxisd(spun.rotation).angle() < kExactFit) return;
  std::vector<Vector3d> centres;
  for (const EntityFeature& feature : entity_features(base)) centres.push_back(feature.centre);
  const Vector3d on_axis = mean_of(centres);
  Similarity still;
  still.scale = spun.scale;
  still.translation = spun(on_axis) - still.scale * on_axis;
  for (const Vector3d& pole : poles(base))
    if ((still(pole) - spun(pole)).norm() > kCoincident * variant.diagonal()) return;
  if (coincide(base, variant, match, still)) match.alignment = still;
}

}  // namespace

std::vector<EntityFeature> entity_features(const CadModel& model) {
  std::vector<EntityFeature> features;
  for (const FaceId f : model.faces().ids()) features.push_back(face_feature(model, f));
  for (const CurveId c : model.skeleton().curves.ids()) features.push_back(curve_feature(model, c));
  for (const VertexId v : model.skeleton().corners)
    features.push_back({model.vertices()[v].point, 0});
  return features;
}

Similarity fit_similarity(const std::vector<Vector3d>& from, const std::vector<Vector3d>& to,
                          double line) {
  Similarity s;
  const Vector3d a = mean_of(from), b = mean_of(to);
  Matrix3d covariance = Matrix3d::Zero();
  double variance_from = 0, variance_to = 0;
  for (std::size_t i = 0; i < from.size(); ++i) {
    covariance += (to[i] - b) * (from[i] - a).transpose();
    variance_from += (from[i] - a).squaredNorm();
    variance_to += (to[i] - b).squaredNorm();
  }
  s.rotation = best_rotation(covariance, line);
  if (variance_from > 0 && variance_to > 0)
    s.scale = (s.rotation.transpose() * covariance).trace() / variance_from;
  if (!(s.scale > 0)) s.scale = 1;
  s.translation = b - s.scale * (s.rotation * a);
  return s;
}

Similarity fit_shift(const std::vector<Vector3d>& from, const std::vector<Vector3d>& to,
                     double scale) {
  Similarity result;
  result.scale = scale;
  result.translation = mean_of(to) - scale * mean_of(from);
  return result;
}

double residual(const Similarity& s, const std::vector<Vector3d>& from,
                const std::vector<Vector3d>& to) {
  double sum = 0;
  for (std::size_t i = 0; i < from.size(); ++i) sum += (s(from[i]) - to[i]).squaredNorm();
  return std::sqrt(sum / static_cast<double>(std::max<std::size_t>(from.size(), 1)));
}

bool carries_parameters(const Similarity& motion, const CadModel& base, FaceId face,
                        const CadModel& variant, FaceId to_face) {
  const CadFace& a = base.faces()[face];
  const CadFace& b = variant.faces()[to_face];
  const double tolerance = kCoincident * variant.diagonal();
  for (const Vector2d& s : {Vector2d(0.2, 0.3), Vector2d(0.9, 0.4), Vector2d(0.4, 0.8)}) {
    const Vector2d from = a.lower + s.cwiseProduct(a.upper - a.lower);
    const Vector2d to = b.lower + s.cwiseProduct(b.upper - b.lower);
    const Vector3d moved = motion(base.evaluate(face, from).point);
    if ((moved - variant.evaluate(to_face, to).point).norm() >= tolerance) return false;
  }
  return true;
}

double parameter_agreement(const CadModel& base, const CadModel& variant,
                           const TopologyMatch& match) {
  int same = 0;
  for (const FaceId f : match.faces.ids())
    same += carries_parameters(match.alignment, base, f, variant, match.faces[f]);
  return static_cast<double>(same) / static_cast<double>(match.faces.size());
}

bool is_mirror_image(const CadModel& base, const CadModel& variant, const TopologyMatch& match) {
  if (match.is_congruent || match.is_oriented) return false;
  std::vector<Vector3d> from, mirrored, to;
  for (const CornerId c : match.corners.ids()) {
    from.push_back(base.vertices()[base.skeleton().corners[c]].point);
    to.push_back(variant.vertices()[variant.skeleton().corners[match.corners[c]]].point);
  }
  for (const CurveId c : match.curves.ids()) {
    from.push_back(curve_feature(base, c).centre);
    to.push_back(curve_feature(variant, match.curves[c]).centre);
  }
  for (const Vector3d& point : from) mirrored.push_back(-point);
  const double plain = residual(fit_similarity(from, to), from, to);
  return plain > kMirrored * variant.diagonal() &&
         residual(fit_similarity(mirrored, to), mirrored, to) < kMirrorFits * plain;
}

bool stays(const TopologyMatch& match) {
  const Similarity& t = match.alignment;
  return match.is_congruent && t.scale == 1 && t.rotation.isIdentity(0) && t.translation.isZero(0);
}

void align(const CadModel& base, const CadModel& variant, TopologyMatch& match) {
  match.alignment = {};
  match.is_congruent = coincide(base, variant, match, match.alignment);
  if (match.is_congruent) return;
  std::vector<Vector3d> from, to;
  // Exporters turn planes over: the curved faces alone may tell.
  for (const bool has_planes : {true, false}) {
    from.clear();
    to.clear();
    equal_parameters(base, variant, match, has_planes, from, to);
    match.alignment = fit_similarity(from, to);
    match.is_congruent = !from.empty() &&
                         residual(match.alignment, from, to) < kExactFit * variant.diagonal() &&
                         (has_planes ? curves_coincide(base, variant, match, match.alignment)
                                     : coincide(base, variant, match, match.alignment));
    if (match.is_congruent) return undo_spin(base, variant, match);
  }
  from.clear();
  to.clear();
  const double line = landmarks(base, variant, match, from, to);
  match.alignment = fit_similarity(from, to, line);
  const Similarity unturned = fit_shift(from, to, variant.diagonal() / base.diagonal());
  if (is_accidental_turn(match.alignment, unturned, from, to, variant.diagonal()) &&
      !normals_turn(base, variant, match, match.alignment.rotation))
    match.alignment = unturned;
  if (!spans_a_plane(from) && from.size() < 3) {
    match.alignment.scale = variant.diagonal() / base.diagonal();
    match.alignment.translation =
        mean_of(to) - match.alignment.scale * (match.alignment.rotation * mean_of(from));
  }
  match.is_congruent = coincide(base, variant, match, match.alignment);
}

}  // namespace cadmorph
