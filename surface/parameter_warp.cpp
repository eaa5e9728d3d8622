#include "surface/parameter_warp.h"

#include <algorithm>
#include <cmath>

#include "cad/face_sampler.h"
#include "core/kd_tree.h"

namespace cadmorph {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kEqualPhase = 1e-6;  // of a period: ten times what files keep of equal shifts
// Of a period: above what changed dimensions make of it. With half or twice of it 30 pairs come out
// the same; with 0 or 0.49 nodes of a pierced ring whose seams begin elsewhere go 7 mm astray.
constexpr double kSeamShift = 0.02;

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

}  // namespace

Parameters project_points(const CadModel& model, FaceId face, const Points& targets) {
  Parameters result(targets.rows(), 2);
  if (targets.rows() == 0) return result;
  const auto seeds = sample_domain(model, face, 24);
  RowMatrix at(std::max<Index>(1, std::ssize(seeds)), 3);
  for (Index i = 0; i < std::ssize(seeds); ++i) at.row(i) = model.evaluate(face, seeds[i]).point;
  if (seeds.empty()) at.setZero();
  const KdTree tree(at);
  for (Index i = 0; i < targets.rows(); ++i) {
    const Vector3d x = targets.row(i);
    const Index seed = tree.nearest(x.data(), 1)[0].index;
    result.row(i) = seeds.empty() ? project_globally(model, face, x).uv
                                  : project_on_face(model, face, x, seeds[seed]).uv;
  }
  return result;
}

std::optional<Parameters> ParameterWarp::sample_values() {
  for (int a = 0; a < 2; ++a)
    if ((base_.period[a] > 0) != (variant_.period[a] > 0)) return std::nullopt;
  if (!map_samples()) return std::nullopt;
  find_linear_part();
  unwrap();
  return values_;
}

std::optional<Parameters> ParameterWarp::border_misfit(const Parameters& carried) const {
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

bool ParameterWarp::map_samples() {
  const auto& samples = domain_.samples();
  image_.resize(static_cast<Index>(samples.size()), 2);
  const Parameters joints = project_points(pair_.variant, variant_id_, motion_.joints_after);
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

// Nothing where the variant's face does not use the curve.
std::optional<ParameterWarp::OnCoedge> ParameterWarp::image_of(
    const FaceDomain::Sample& sample) const {
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
bool ParameterWarp::map_pole(std::size_t begin, std::size_t end) {
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
bool ParameterWarp::runs_backward(CoedgeId pole, CoedgeId variant_pole) const {
  const CadEdge& from = pair_.base.edges()[pair_.base.coedges()[pole].edge];
  const CadEdge& to = pair_.variant.edges()[pair_.variant.coedges()[variant_pole].edge];
  const Vector2d along =
      pair_.variant.pcurve(variant_pole, to.last) - pair_.variant.pcurve(variant_pole, to.first);
  const auto first = nearest_image(pair_.base.pcurve(pole, from.first)),
             last = nearest_image(pair_.base.pcurve(pole, from.last));
  return first && last && along.dot(*last - *first) < 0;
}

std::optional<Vector2d> ParameterWarp::nearest_image(const Vector2d& uv) const {
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

bool ParameterWarp::is_pole(std::size_t i) const {
  const CoedgeId coedge = domain_.samples()[i].coedge;
  return coedge >= 0 && pair_.base.edges()[pair_.base.coedges()[coedge].edge].is_degenerate;
}

// Along a closed direction the RBF has no linear part: period and sense are taken out before.
void ParameterWarp::find_linear_part() {
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
void ParameterWarp::carry_range(int a) {
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
double ParameterWarp::sense(int a) const {
  double with = 0;
  const auto& samples = domain_.samples();
  for (std::size_t i = 1; i < samples.size(); ++i) {
    if (samples[i].coedge != samples[i - 1].coedge || !is_on_curve(i)) continue;
    const double d = samples[i].uv[a] - samples[i - 1].uv[a];
    double moved = image_(static_cast<Index>(i), a) - image_(static_cast<Index>(i) - 1, a);
    moved -= variant_.period[a] * std::round(moved / variant_.period[a]);
    with += d * moved;
  }
  if (std::abs(with) > 1e-6 * base_.period[a] * variant_.period[a] / 100) return with > 0 ? 1 : -1;
  const Vector2d middle = 0.5 * (base_.lower + base_.upper);
  const SurfacePoint s = pair_.base.evaluate(domain_.face(), middle);
  const FaceFoot foot = project_globally(pair_.variant, variant_id_, pair_.prediction(s.point));
  const SurfacePoint t = pair_.variant.evaluate(variant_id_, foot.uv);
  const Vector3d along = pair_.match.alignment.rotation * (a == 0 ? s.du : s.dv);
  return along.dot(a == 0 ? t.du : t.dv) < 0 ? -1 : 1;
}

// Displacements, in closed directions by the representative nearest to the first one's.
void ParameterWarp::unwrap() {
  const auto& samples = domain_.samples();
  values_.resize(image_.rows(), 2);
  for (Index i = 0; i < image_.rows(); ++i)
    values_.row(i) = image_.row(i) - linear(samples[static_cast<std::size_t>(i)].uv).transpose();
  for (int a = 0; a < 2; ++a)
    if (variant_.period[a] > 0) unwrap_direction(a);
}

// A seam that begins elsewhere is no displacement to hold the interpolation to. At a pole the
// closed direction has no meaning: it takes the phase of the rest.
void ParameterWarp::unwrap_direction(int a) {
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
  // Of a face without curves the seam moved only where the prediction shifts all samples alike.
  if (!reference) reference = phase(a, pair_.prediction, kEqualPhase);
  for (Index i = 0; i < values_.rows(); ++i)
    if (is_pole(static_cast<std::size_t>(i))) values_(i, a) = *reference;
  if (values_.rows() == 0) offset_[a] += *reference;
}

// By how much the parameters of the surface are others where `carry` takes its points: zero where
// these differ by more than `rough` of the period, or are all that near.
template <class Carry>
double ParameterWarp::phase(int a, const Carry& carry, double rough) const {
  const double period = variant_.period[a];
  std::optional<double> reference;
  double sum = 0, spread = 0;
  constexpr int n = 4;  // in each direction: what all agree on, 16 tell
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

}  // namespace cadmorph
