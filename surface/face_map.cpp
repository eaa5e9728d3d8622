#include "surface/face_map.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "cad/alignment.h"
#include "cad/face_sampler.h"
#include "core/kd_tree.h"
#include "surface/round_face.h"

namespace cadmorph {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kSame = 1e-7;             // of the diagonal: one surface, whatever its parameters
constexpr double kSameParameters = 1e-12;  // of the diagonal: equal to rounding
constexpr double kDifferent = 1e-6;        // of the diagonal: not the same point
constexpr double kEqualPhase = 1e-6;       // of a period
constexpr double kSeamShift = 0.02;        // of a period: above what changed dimensions make of it
constexpr double kNoSpin = 1e-4;           // of a rotation matrix: what hardly is an accident
constexpr int kProbes = 24, kGrid = 12;
// Warped nodes this far from the prediction, in sizes of the face, mean that parameters don't
// correspond at all.
constexpr double kLost = 0.5;

// The variant's coedge that uses `edge` in `face`, the `occurrence`-th of them.
CoedgeId find_coedge(const CadModel& model, FaceId face, EdgeId edge, int occurrence) {
  CoedgeId found;
  for (const CoedgeId c : model.edges()[edge].coedges)
    if (model.coedges()[c].face == face) {
      found = c;
      if (occurrence-- == 0) break;
    }
  return found;
}

// Positions of a coedge among those of the same edge and face.
int occurrence_of(const CadModel& model, CoedgeId coedge) {
  const CadCoedge& c = model.coedges()[coedge];
  int count = 0;
  for (const CoedgeId other : model.edges()[c.edge].coedges) {
    if (other == coedge) break;
    count += model.coedges()[other].face == c.face;
  }
  return count;
}

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

FaceMapResult project_points(const ModelPair& pair, FaceId variant, const Points& targets) {
  if (targets.rows() == 0) return {};
  const auto seeds = sample_domain(pair.variant, variant, 24);
  RowMatrix at(std::max<Index>(1, static_cast<Index>(seeds.size())), 3);
  for (Index i = 0; i < static_cast<Index>(seeds.size()); ++i)
    at.row(i) = pair.variant.evaluate(variant, seeds[static_cast<std::size_t>(i)]).point;
  if (seeds.empty()) at.setZero();
  const KdTree tree(at);
  FaceMapResult result;
  result.is_projected = true;
  result.uv.resize(targets.rows(), 2);
  for (Index i = 0; i < targets.rows(); ++i) {
    const Vector3d x = targets.row(i);
    const Index seed = tree.nearest(x.data(), 1)[0].index;
    result.uv.row(i) =
        seeds.empty()
            ? project_globally(pair.variant, variant, x).uv
            : project_on_face(pair.variant, variant, x, seeds[static_cast<std::size_t>(seed)]).uv;
  }
  return result;
}

class ParameterWarp {
 public:
  ParameterWarp(const FaceDomain& domain, const ModelPair& pair, const FaceMotion& motion)
      : domain_(domain),
        pair_(pair),
        motion_(motion),
        base_(pair.base.faces()[domain.face()]),
        variant_id_(pair.match.faces[domain.face()]),
        variant_(pair.variant.faces()[variant_id_]) {}

  // Displacement of the samples beyond the linear pre-map; empty when parameters don't correspond.
  std::optional<Parameters> sample_values() {
    for (int a = 0; a < 2; ++a)
      if ((base_.period[a] > 0) != (variant_.period[a] > 0)) return std::nullopt;
    if (!map_samples()) return std::nullopt;
    find_linear_part();
    unwrap();
    return values_;
  }

  // Displacement of the border's nodes beyond the linear pre-map and `carried`, which the warp
  // gives them; nothing where one has no image.
  std::optional<Parameters> border_misfit(const Parameters& carried) const {
    Parameters result = -carried;
    for (Index i = 0; i < result.rows(); ++i) {
      const FaceDomain::Sample& node = motion_.border.nodes()[i];
      const auto image = image_of(node);
      if (!image) return std::nullopt;
      const Vector2d to = wire_parameters(pair_.variant, image->coedge, image->t, 0);
      result.row(i) += (to - linear(node.uv)).transpose();
      for (int a = 0; a < 2; ++a)
        if (const double period = variant_.period[a]; period > 0)
          result(i, a) -= period * std::round(result(i, a) / period);
    }
    return result;
  }

  // u' = offset + stretch u before the displacement.
  Vector2d linear(const Vector2d& uv) const { return offset_ + stretch_.cwiseProduct(uv); }

 private:
  bool map_samples() {
    const auto& samples = domain_.samples();
    image_.resize(static_cast<Index>(samples.size()), 2);
    const Parameters joints = project_points(pair_, variant_id_, motion_.joints_after).uv;
    for (std::size_t i = 0; i < samples.size(); ++i) {
      if (is_pole(i)) continue;
      if (samples[i].joint >= 0) {
        image_.row(static_cast<Index>(i)) = joints.row(samples[i].joint);
        continue;
      }
      const auto image = image_of(samples[i]);
      if (!image) return false;
      image_.row(static_cast<Index>(i)) = wire_parameters(pair_.variant, image->coedge, image->t);
    }
    for (std::size_t i = 0; i < samples.size();) {
      std::size_t end = i + 1;
      while (end < samples.size() && samples[end].coedge == samples[i].coedge) ++end;
      if (is_pole(i) && !map_pole(i, end)) return false;
      i = end;
    }
    return true;
  }

  struct OnCoedge {
    CoedgeId coedge;
    double t;
  };

  // Nothing where the variant's face does not use the curve.
  std::optional<OnCoedge> image_of(const FaceDomain::Sample& sample) const {
    const EdgeId edge = pair_.base.coedges()[sample.coedge].edge;
    const CurveId curve = pair_.base.skeleton().curve_of_edge[edge];
    const CurveLocation l = motion_.curve_maps[curve]({edge, sample.t});
    const CoedgeId c =
        find_coedge(pair_.variant, variant_id_, l.edge, occurrence_of(pair_.base, sample.coedge));
    if (c < 0) return std::nullopt;
    return OnCoedge{c, l.t};
  }

  // A pole maps to the variant's pole nearest to the prediction, by relative parameter along it, in
  // the sense of the curves that end there.
  bool map_pole(std::size_t begin, std::size_t end) {
    const auto& samples = domain_.samples();
    const Vector2d uv = samples[begin].uv;
    const Vector3d at = pair_.prediction(pair_.base.evaluate(domain_.face(), uv).point);
    CoedgeId pole;
    double least = 1e300;
    for (const auto& wire : variant_.wires)
      for (const CoedgeId c : wire) {
        const CadEdge& e = pair_.variant.edges()[pair_.variant.coedges()[c].edge];
        if (!e.is_degenerate || fills_gap(pair_.variant, c)) continue;
        const Vector2d there = pair_.variant.pcurve(c, e.first);
        const double d = (pair_.variant.evaluate(variant_id_, there).point - at).squaredNorm();
        if (d < least) {
          least = d;
          pole = c;
        }
      }
    if (pole < 0) return false;
    const CadEdge& from = pair_.base.edges()[pair_.base.coedges()[samples[begin].coedge].edge];
    const CadEdge& to = pair_.variant.edges()[pair_.variant.coedges()[pole].edge];
    const bool is_reversed = runs_backward(samples[begin].coedge, pole);
    for (std::size_t i = begin; i < end; ++i) {
      const double s = (samples[i].t - from.first) / (from.last - from.first);
      image_.row(static_cast<Index>(i)) =
          pair_.variant.pcurve(pole, to.first + (is_reversed ? 1 - s : s) * (to.last - to.first));
    }
    return true;
  }

  // Whether the images of the samples nearest to the ends of a pole lie the other way round.
  bool runs_backward(CoedgeId pole, CoedgeId variant_pole) const {
    const CadEdge& from = pair_.base.edges()[pair_.base.coedges()[pole].edge];
    const CadEdge& to = pair_.variant.edges()[pair_.variant.coedges()[variant_pole].edge];
    const Vector2d along =
        pair_.variant.pcurve(variant_pole, to.last) - pair_.variant.pcurve(variant_pole, to.first);
    const auto first = nearest_image(pair_.base.pcurve(pole, from.first)),
               last = nearest_image(pair_.base.pcurve(pole, from.last));
    return first && last && along.dot(*last - *first) < 0;
  }

  std::optional<Vector2d> nearest_image(const Vector2d& uv) const {
    const Vector2d size = base_.upper - base_.lower;
    std::optional<Vector2d> image;
    double least = 1e300;
    for (std::size_t i = 0; i < domain_.samples().size(); ++i) {
      const double d = (domain_.samples()[i].uv - uv).cwiseQuotient(size).squaredNorm();
      if (is_pole(i) || d >= least) continue;
      least = d;
      image = image_.row(static_cast<Index>(i));
    }
    return image;
  }

  bool is_pole(std::size_t i) const {
    const CoedgeId coedge = domain_.samples()[i].coedge;
    return coedge >= 0 && pair_.base.edges()[pair_.base.coedges()[coedge].edge].is_degenerate;
  }

  bool is_on_curve(std::size_t i) const { return domain_.samples()[i].joint < 0 && !is_pole(i); }

  // Along a closed direction the RBF has no linear part: period and sense are taken out before.
  void find_linear_part() {
    stretch_.setOnes();
    offset_.setZero();
    for (int a = 0; a < 2; ++a) {
      if (base_.period[a] <= 0) continue;
      const double ratio = variant_.period[a] / base_.period[a];
      stretch_[a] = sense(a) * (std::abs(ratio - 1) < 1e-12 ? 1 : ratio);
    }
    bool has_curves = false;
    for (std::size_t i = 0; i < domain_.samples().size(); ++i) has_curves |= is_on_curve(i);
    for (int a = 0; a < 2 && !has_curves; ++a) carry_range(a);
  }

  // No curve tells about a direction: carry the whole range.
  void carry_range(int a) {
    if (base_.period[a] <= 0) {
      const double ratio =
          (variant_.upper[a] - variant_.lower[a]) / (base_.upper[a] - base_.lower[a]);
      stretch_[a] = std::abs(ratio - 1) < 1e-12 ? 1 : ratio;
    }
    const bool is_same_range =
        stretch_[a] == 1 && (base_.period[a] > 0 || base_.lower[a] == variant_.lower[a]);
    if (is_same_range) return;
    offset_[a] =
        (stretch_[a] > 0 ? variant_.lower[a] : variant_.upper[a]) - stretch_[a] * base_.lower[a];
  }

  // Whether u' runs with u or against it, by the curves that go round; else by the surfaces'
  // tangents.
  double sense(int a) const {
    double with = 0;
    const auto& samples = domain_.samples();
    for (std::size_t i = 1; i < samples.size(); ++i) {
      if (samples[i].coedge != samples[i - 1].coedge || !is_on_curve(i)) continue;
      const double d = samples[i].uv[a] - samples[i - 1].uv[a];
      double moved = image_(static_cast<Index>(i), a) - image_(static_cast<Index>(i) - 1, a);
      moved -= variant_.period[a] * std::round(moved / variant_.period[a]);
      with += d * moved;
    }
    if (std::abs(with) > 1e-6 * base_.period[a] * variant_.period[a] / 100)
      return with > 0 ? 1 : -1;
    const Vector2d middle = 0.5 * (base_.lower + base_.upper);
    const SurfacePoint s = pair_.base.evaluate(domain_.face(), middle);
    const FaceFoot foot = project_globally(pair_.variant, variant_id_, pair_.prediction(s.point));
    const SurfacePoint t = pair_.variant.evaluate(variant_id_, foot.uv);
    const Vector3d along = pair_.match.alignment.rotation * (a == 0 ? s.du : s.dv);
    return along.dot(a == 0 ? t.du : t.dv) < 0 ? -1 : 1;
  }

  // Displacements, in closed directions by the representative nearest to the first one's.
  void unwrap() {
    const auto& samples = domain_.samples();
    values_.resize(image_.rows(), 2);
    for (Index i = 0; i < image_.rows(); ++i)
      values_.row(i) = image_.row(i) - linear(samples[static_cast<std::size_t>(i)].uv).transpose();
    for (int a = 0; a < 2; ++a)
      if (variant_.period[a] > 0) unwrap_direction(a);
  }

  // A seam that begins elsewhere is no displacement to hold the interpolation to. At a pole the
  // closed direction has no meaning: it takes the phase of the rest.
  void unwrap_direction(int a) {
    const double period = variant_.period[a];
    if (values_.rows() > 0) {
      const double shift = phase(a, pair_.match.alignment, kSeamShift);
      offset_[a] += shift;
      values_.col(a).array() -= shift;
    }
    std::optional<double> reference;
    for (Index i = 0; i < values_.rows(); ++i) {
      if (is_pole(static_cast<std::size_t>(i))) continue;
      if (!reference) reference = values_(i, a) - period * std::round(values_(i, a) / period);
      values_(i, a) -= period * std::round((values_(i, a) - *reference) / period);
    }
    // Of a face without curves the seam moved only where all of it says so, to the digit.
    if (!reference) reference = phase(a, pair_.prediction, kEqualPhase);
    for (Index i = 0; i < values_.rows(); ++i)
      if (is_pole(static_cast<std::size_t>(i))) values_(i, a) = *reference;
    if (values_.rows() == 0) offset_[a] += *reference;
  }

  // By how much the parameters of the surface are others where `carry` takes its points: zero where
  // these differ by more than `rough` of the period, or are all that near.
  template <class Carry>
  double phase(int a, const Carry& carry, double rough) const {
    const double period = variant_.period[a];
    std::optional<double> reference;
    double sum = 0, spread = 0;
    constexpr int n = 4;
    for (int i = 0; i < n; ++i)
      for (int j = 0; j < n; ++j) {
        const Vector2d uv =
            base_.lower +
            Vector2d((i + 0.5) / n, (j + 0.5) / n).cwiseProduct(base_.upper - base_.lower);
        const Vector3d x = carry(pair_.base.evaluate(domain_.face(), uv).point);
        double d = project_globally(pair_.variant, variant_id_, x).uv[a] - linear(uv)[a];
        if (!reference) reference = d - period * std::round(d / period);
        d -= period * std::round((d - *reference) / period);
        sum += d;
        spread = std::max(spread, std::abs(d - *reference));
      }
    const double mean = sum / (n * n);
    return spread > rough * period || std::abs(mean) < rough * period ? 0 : mean;
  }

  const FaceDomain& domain_;
  const ModelPair& pair_;
  const FaceMotion& motion_;
  const CadFace& base_;
  FaceId variant_id_;
  const CadFace& variant_;
  Vector2d stretch_ = Vector2d::Ones(), offset_ = Vector2d::Zero();
  Parameters image_, values_;
};

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
  if (!has_same_parameters) return project_points(pair, variant, points);
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
  return project_points(pair, variant, still);
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
  return project_points(pair, pair.match.faces[domain.face()], targets);
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

double face_size(const CadModel& model, FaceId face) {
  const CadFace& f = model.faces()[face];
  const Vector2d lengths = mean_derivatives(model, face).cwiseProduct(f.upper - f.lower);
  return lengths.minCoeff();
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
    return project_points(pair, pair.match.faces[domain.face()], aligned);
  }
  if (d.mapped > kLost * face_size(pair.variant, pair.match.faces[domain.face()])) {
    FaceMapResult projected = project_face(domain, pair, motion, points);
    if (judge(domain, pair, projected.uv, points).mapped < 0.5 * d.mapped) {
      projected.note = "its warped parameters lie far from where the part moved";
      return projected;
    }
  }
  return result;
}

FaceMapResult project_face(const FaceDomain& domain, const ModelPair& pair,
                           const FaceMotion& motion, const Points& points) {
  return carry_face(domain, pair, motion, points, pair.prediction);
}

}  // namespace cadmorph
