#include "surface/face_map.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "cad/alignment.h"
#include "cad/face_sampler.h"
#include "surface/round_face.h"

namespace cadmorph {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kSame = 1e-7;             // of the diagonal: one surface, whatever its parameters
constexpr double kSameParameters = 1e-12;  // of the diagonal: equal to rounding
constexpr double kDifferent = 1e-6;        // of the diagonal: not the same point, ten times kSame
constexpr double kNoSpin = 1e-4;           // of a rotation matrix: what hardly is an accident
// Nodes of a face that are asked, or twice as many, and samples in each direction for the middle of
// a ball or ring, which their symmetry gives exactly. With half or twice of either 14 pairs come
// out the same.
constexpr int kProbes = 24, kGrid = 12;

// Where a sample of the base went.
struct SampleMotion {
  Vector3d from, to;
};

// Nothing at a pole, which lies on no curve.
std::optional<SampleMotion> motion_of(const FaceDomain::Sample& sample, const ModelPair& pair,
                                      const FaceMotion& motion) {
  if (sample.joint >= 0)
    return SampleMotion{motion.joints_before.row(sample.joint),
                        motion.joints_after.row(sample.joint)};
  const EdgeId edge = pair.base.coedges()[sample.coedge].edge;
  const CurveId curve = pair.base.skeleton().curve_of_edge[edge];
  if (curve < 0) return std::nullopt;
  const CurveLocation l = motion.curve_maps[curve]({edge, sample.t});
  return SampleMotion{pair.base.evaluate_edge(edge, sample.t).point,
                      pair.variant.evaluate_edge(l.edge, l.t).point};
}

FaceMapResult projected(const ModelPair& pair, FaceId variant, const Points& targets) {
  return {.uv = project_points(pair.variant, variant, targets), .is_projected = true};
}

Vector2d wrap(const CadFace& face, Vector2d uv) {
  for (int a = 0; a < 2; ++a)
    if (face.period[a] > 0 && (uv[a] < face.lower[a] || uv[a] > face.upper[a]))
      uv[a] -= face.period[a] * std::floor((uv[a] - face.lower[a]) / face.period[a]);
  return uv;
}

std::vector<Index> probe_rows(Index rows) {
  std::vector<Index> probes;
  const Index stride = std::max<Index>(1, rows / kProbes);
  for (Index i = 0; i < rows; i += stride) probes.push_back(i);
  return probes;
}

struct Deviation {
  double mapped = 0, aligned = 0;  // root mean square from the prediction
  double off_surface = 0;          // largest distance of aligned points from the variant face
};

Deviation judge(const FaceDomain& domain, const ModelPair& pair, const Parameters& mapped,
                const Points& points) {
  const FaceId variant = pair.match.faces[domain.face()];
  Deviation deviation;
  const auto probes = probe_rows(points.rows());
  Points at(static_cast<Index>(probes.size()), 3);
  for (Index i = 0; i < at.rows(); ++i) at.row(i) = points.row(probes[static_cast<std::size_t>(i)]);
  const Points predicted = pair.prediction(at);
  for (Index i = 0; i < at.rows(); ++i) {
    const Vector3d p = predicted.row(i), aligned = pair.match.alignment(at.row(i).transpose());
    const Vector2d uv = mapped.row(probes[static_cast<std::size_t>(i)]);
    deviation.mapped += (pair.variant.evaluate(variant, uv).point - p).squaredNorm();
    deviation.aligned += (aligned - p).squaredNorm();
  }
  deviation.mapped = std::sqrt(deviation.mapped / static_cast<double>(at.rows()));
  deviation.aligned = std::sqrt(deviation.aligned / static_cast<double>(at.rows()));
  if (deviation.mapped > deviation.aligned + kDifferent * pair.variant.diagonal())
    for (Index i = 0; i < at.rows() && deviation.off_surface < kSame * pair.variant.diagonal(); ++i)
      deviation.off_surface = std::max(
          deviation.off_surface,
          project_globally(pair.variant, variant, pair.match.alignment(at.row(i).transpose()))
              .distance);
  return deviation;
}

// Whether nodes of the face leave their places.
bool moves(const FaceDomain& domain, const ModelPair& pair, const Parameters& mapped,
           const Points& points) {
  const FaceId variant = pair.match.faces[domain.face()];
  return std::ranges::any_of(probe_rows(points.rows()), [&](Index i) {
    const Vector3d x = points.row(i);
    return (pair.variant.evaluate(variant, mapped.row(i)).point - x).norm() >
           kSameParameters * pair.variant.diagonal();
  });
}

bool samples_follow_alignment(const FaceDomain& domain, const ModelPair& pair,
                              const FaceMotion& motion) {
  const double tolerance = 2 * kDifferent * pair.variant.diagonal();
  return std::ranges::all_of(domain.samples(), [&](const FaceDomain::Sample& sample) {
    const auto moved = motion_of(sample, pair, motion);
    return !moved || (moved->to - pair.match.alignment(moved->from)).norm() <= tolerance;
  });
}

// Whether no wire of the face, and no joint within it, moved: then nothing on it tells of a motion.
bool samples_stay(const FaceDomain& domain, const ModelPair& pair, const FaceMotion& motion) {
  return std::ranges::all_of(domain.samples(), [&](const FaceDomain::Sample& sample) {
    const auto moved = motion_of(sample, pair, motion);
    return !moved || (moved->to - moved->from).norm() <=
                         std::max(sample.tolerance, kSame * pair.variant.diagonal());
  });
}

// The nodes where they are, on a variant that is the base's surface, whatever its parameters:
// nothing if it is another, or the wires moved. A sphere that spins is the same sphere.
std::optional<FaceMapResult> unchanged(const FaceDomain& domain, const ModelPair& pair,
                                       const FaceMotion& motion, const Parameters& uv,
                                       const Points& points) {
  const FaceId variant = pair.match.faces[domain.face()];
  const double tolerance =
      std::max(pair.variant.faces()[variant].tolerance, kSame * pair.variant.diagonal());
  const std::vector<Index> probes = probe_rows(points.rows());
  if (!samples_stay(domain, pair, motion) || !std::ranges::all_of(probes, [&](Index i) {
        return project_globally(pair.variant, variant, points.row(i)).distance <= tolerance;
      }))
    return std::nullopt;
  const bool has_same_parameters = std::ranges::all_of(probes, [&](Index i) {
    const Vector3d x = points.row(i);
    return (pair.variant.evaluate(variant, uv.row(i)).point - x).norm() <=
           kSameParameters * pair.variant.diagonal();
  });
  if (!has_same_parameters) return projected(pair, variant, points);
  FaceMapResult result;
  result.uv = uv;
  return result;
}

bool has_marks(const FaceDomain& domain, const ModelPair& pair, const FaceMotion& motion) {
  return std::ranges::any_of(domain.samples(), [&](const FaceDomain::Sample& sample) {
    return motion_of(sample, pair, motion).has_value();
  });
}

// What wires of the face, and joints within it, tell of its motion: each place once. O(samples^2).
std::vector<SampleMotion> marks_of(const FaceDomain& domain, const ModelPair& pair,
                                   const FaceMotion& motion) {
  std::vector<SampleMotion> marks;
  for (const auto& sample : domain.samples()) {
    const auto moved = motion_of(sample, pair, motion);
    if (!moved) continue;
    const bool is_new = std::ranges::none_of(marks, [&](const SampleMotion& mark) {
      return (mark.from - moved->from).norm() < kDifferent * pair.base.diagonal();
    });
    if (is_new) marks.push_back(*moved);
  }
  return marks;
}

// A face without wires, such as a ball, whose parameters spin it neither with the part nor as it
// was: only a seam moved, so the nodes go where they would without the spin. Nothing where that is
// no place of the variant's surface, or the parameters are right.
std::optional<FaceMapResult> without_spin(const FaceDomain& domain, const ModelPair& pair,
                                          const FaceMotion& motion, const Parameters& mapped,
                                          const Points& points) {
  if (has_marks(domain, pair, motion)) return std::nullopt;
  const FaceId variant = pair.match.faces[domain.face()];
  std::vector<Vector3d> from, to;
  for (const Index i : probe_rows(points.rows())) {
    from.push_back(points.row(i));
    to.push_back(pair.variant.evaluate(variant, mapped.row(i)).point);
  }
  Similarity t = fit_similarity(from, to);
  const Eigen::Matrix3d& part = pair.match.alignment.rotation;
  if (t.rotation.isIdentity(kNoSpin) || t.rotation.isApprox(part, kNoSpin)) return std::nullopt;
  Vector3d middle = Vector3d::Zero();  // balls and rings are symmetric in their parameters
  const auto grid = sample_domain(pair.base, domain.face(), kGrid);
  for (const Vector2d& at : grid)
    middle += pair.base.evaluate(domain.face(), at).point / static_cast<double>(grid.size());
  t.translation = t(middle) - t.scale * (part * middle);
  t.rotation = part;
  Points still(points.rows(), 3);
  for (Index i = 0; i < points.rows(); ++i) still.row(i) = t(points.row(i).transpose());
  const double tolerance = kDifferent * pair.variant.diagonal();
  if (!std::ranges::all_of(probe_rows(points.rows()), [&](Index i) {
        return project_globally(pair.variant, variant, still.row(i)).distance <= tolerance;
      }))
    return std::nullopt;
  return projected(pair, variant, still);
}

// The places that `carry` gives the points, corrected to meet the mapped curves and the joints.
template <class Carry>
FaceMapResult carry_face(const FaceDomain& domain, const ModelPair& pair, const FaceMotion& motion,
                         const Points& points, const Carry& carry) {
  Points targets = carry(points);
  const std::vector<SampleMotion> marks = marks_of(domain, pair, motion);
  if (!marks.empty()) {
    Points from(static_cast<Index>(marks.size()), 3), to(from.rows(), 3);
    for (Index i = 0; i < from.rows(); ++i) {
      from.row(i) = marks[static_cast<std::size_t>(i)].from;
      to.row(i) = marks[static_cast<std::size_t>(i)].to;
    }
    const RowMatrix missed = to - carry(from);
    targets += RbfSystem(from, Kernel::biharmonic_3d()).solve(missed).evaluate(points);
  }
  return projected(pair, pair.match.faces[domain.face()], targets);
}

// A sphere, or a torus without wires, as such; nothing where its parameters tell as much.
std::optional<FaceCarry> round_carry(const FaceDomain& domain, const ModelPair& pair,
                                     const FaceMotion& motion) {
  const SurfaceType type = pair.base.faces()[domain.face()].type;
  if (type == SurfaceType::Torus && !has_marks(domain, pair, motion))
    return carry_round_face(pair, domain.face());
  if (type != SurfaceType::Sphere) return std::nullopt;
  std::vector<Vector3d> from, to;
  for (const SampleMotion& mark : marks_of(domain, pair, motion)) {
    from.push_back(mark.from);
    to.push_back(mark.to);
  }
  return carry_round_face(pair, domain.face(), from, to);
}

}  // namespace

FaceMapResult map_face(const FaceDomain& domain, const ModelPair& pair, const FaceMotion& motion,
                       const Parameters& uv, const Points& points, int steps) {
  if (const auto carry = round_carry(domain, pair, motion)) {
    if (auto still = unchanged(domain, pair, motion, uv, points)) return std::move(*still);
    return carry_face(domain, pair, motion, points, [&](const Points& from) {
      Points to(from.rows(), 3);
      for (Index i = 0; i < from.rows(); ++i) to.row(i) = (*carry)(from.row(i)).transpose();
      return to;
    });
  }
  ParameterWarp warp(domain, pair, motion);
  const auto values = warp.sample_values();
  if (!values) {
    FaceMapResult result = project_face(domain, pair, motion, points);
    result.note = "its parametrisation differs";
    return result;
  }
  const CadFace& variant = pair.variant.faces()[pair.match.faces[domain.face()]];
  FaceMapResult result;
  const Parameters border = motion.border.uv();
  Parameters at(uv.rows() + border.rows(), 2);
  at << uv, border;
  const Parameters moved = steps > 1 && !domain.is_closed()
                               ? domain.interpolate_in_steps(*values, at, steps)
                               : domain.interpolate(*values, at);
  result.uv = moved.topRows(uv.rows());
  if (border.rows() > 0)
    if (const auto misfit = warp.border_misfit(moved.bottomRows(border.rows())))
      result.uv += motion.border.spread(*misfit, points);
  for (Index i = 0; i < uv.rows(); ++i)
    result.uv.row(i) = wrap(variant, warp.linear(uv.row(i)) + result.uv.row(i).transpose());
  if (uv.rows() == 0) return result;
  if (moves(domain, pair, result.uv, points))
    if (auto still = unchanged(domain, pair, motion, uv, points)) return std::move(*still);
  if (auto still = without_spin(domain, pair, motion, result.uv, points)) return std::move(*still);
  const Deviation d = judge(domain, pair, result.uv, points);
  const double diagonal = pair.variant.diagonal();
  if (d.mapped > d.aligned + kDifferent * diagonal && d.off_surface < kSame * diagonal &&
      samples_follow_alignment(domain, pair, motion)) {
    Points aligned(points.rows(), 3);
    for (Index i = 0; i < points.rows(); ++i)
      aligned.row(i) = pair.match.alignment(points.row(i).transpose());
    return projected(pair, pair.match.faces[domain.face()], aligned);
  }
  return result;
}

FaceMapResult project_face(const FaceDomain& domain, const ModelPair& pair,
                           const FaceMotion& motion, const Points& points) {
  return carry_face(domain, pair, motion, points, pair.prediction);
}

}  // namespace cadmorph
