#include "surface/curve_map.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "cad/alignment.h"

namespace cadmorph {
namespace {

using Eigen::Vector3d;

// With half or twice of kProbes, kPhases, kApart, kCarried, kPredictedBits, kBendUnit, kStrainUnit
// or kClearlyLess, 14 pairs come out the same; with half of the first two, and with half or twice
// of the others but kApart, the tests of seams and of curves pass. Where no way is
// clearly less strained, a blade does not keep its leading edge.
constexpr int kProbes = 24;  // points of a curve that its motion is judged by, 15 degrees apart
constexpr int kPhases = 48;  // starts tried, one each 7.5 degrees of a circle
// Of the curve: the start found by shrinking steps is nearer to the minimum (1e-4) than this.
constexpr double kNear = 1e-3;
constexpr double kRounding = 1e-10;  // of the diagonal: above the rounding of a nearest point
constexpr double kSame = 1e-7;       // of the diagonal: one curve, whatever its parameters
constexpr double kDifferent = 1e-6;  // of the diagonal: not the same point, ten times kSame
// Of the curve's length, at least between joints: they are nodes, a mesh edge apart.
constexpr double kApart = 1e-4;
// Straightness of a face's parameter, a cosine: along the curve an error of it counts five times.
constexpr double kCarried = 0.2;
constexpr double kSameRange = 1e-9;  // of the range of a chain's parameters: above its rounding
// A turn against what is round the curve costs the first bit at 0.1 radians: so far a prediction
// may err where proportions change, and a hole that tilts turns against the block.
constexpr double kTurnUnit = 0.1;
// Parameters that turn a curve exactly as the part, or not at all, do so one time in ten thousand
// by accident: they tell where it is.
constexpr double kAgrees = 1e-4;
// Of a start that is turned as what is round it, which no parameter confirms: as much as one that
// is turned by 0.3 radians against that.
constexpr double kPredictedBits = 2;
// Kernels start the parameters of cylinders anywhere; those of free forms are their control points:
// they may turn a curve by 0.3 radians for nothing. Beyond, another section's start is as likely:
// with 4 bits rims of frustums and nozzles turn with a seam that moved by 0.9 radians, with 1 bit a
// narrow groove does not follow the part's twist.
constexpr double kFreeFormBits = 2;
// What a change bends a curve by, of its size, that costs the first bit: parts change by some
// hundredths, a profile laid on from elsewhere by tenths.
constexpr double kBendUnit = 0.01;
// What a change strains a curve by, of the most possible, that costs the first bit: parts are
// strained by some hundredths. A way of running that strains by a sixth less than the parameters is
// no accident.
constexpr double kStrainUnit = 0.05, kClearlyLess = 0.25;
constexpr int kStrainProbes = 48;  // twice kProbes: a strain is made of differences between them

std::size_t link_index(const CadCurve& curve, EdgeId edge) {
  const auto it = std::find_if(curve.links.begin(), curve.links.end(),
                               [&](const CurveLink& link) { return link.edge == edge; });
  return static_cast<std::size_t>(it - curve.links.begin());
}

Vector3d corner_point(const CadModel& model, CornerId corner) {
  return model.vertices()[model.skeleton().corners[corner]].point;
}

double range(const CadModel& model, const CurveLink& link) {
  const CadEdge& edge = model.edges()[link.edge];
  return edge.last - edge.first;
}

double range(const CadModel& model, const CadCurve& curve) {
  double sum = 0;
  for (const CurveLink& link : curve.links) sum += range(model, link);
  return sum;
}

// Parameters that the chain runs through up to a location.
double range_before(const CadModel& model, const CadCurve& curve, const CurveLocation& location) {
  double sum = 0;
  for (const CurveLink& link : curve.links) {
    const CadEdge& edge = model.edges()[link.edge];
    if (link.edge == location.edge)
      return sum + (link.is_reversed ? edge.last - location.t : location.t - edge.first);
    sum += edge.last - edge.first;
  }
  return sum;
}

CurveLocation locate_range(const CadModel& model, const CadCurve& curve, double covered) {
  for (const CurveLink& link : curve.links) {
    const CadEdge& edge = model.edges()[link.edge];
    const double more = edge.last - edge.first;
    if (covered <= more || &link == &curve.links.back()) {
      const double s = std::clamp(covered, 0.0, more);
      return {link.edge, link.is_reversed ? edge.last - s : edge.first + s};
    }
    covered -= more;
  }
  return {};
}

// Whether a face's only use of a link's edge runs against the link.
std::optional<bool> runs_against(const CadModel& model, const CurveLink& link, FaceId face) {
  std::optional<bool> result;
  for (const CoedgeId c : model.edges()[link.edge].coedges) {
    if (model.coedges()[c].face != face) continue;
    if (result) return std::nullopt;
    result = model.coedges()[c].is_reversed != link.is_reversed;
  }
  return result;
}

Vector3d mean(const std::vector<Vector3d>& points) {
  Vector3d sum = Vector3d::Zero();
  for (const Vector3d& point : points) sum += point;
  return sum / static_cast<double>(points.size());
}

double root_mean_square(const std::vector<Vector3d>& a, const std::vector<Vector3d>& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += (a[i] - b[i]).squaredNorm();
  return std::sqrt(sum / static_cast<double>(a.size()));
}

}  // namespace

CurveMap::CurveMap(const ModelPair& pair, CurveId base_curve)
    : pair_(&pair),
      alignment_(pair.match.alignment),
      base_curve_(&pair.base.skeleton().curves[base_curve]),
      variant_curve_(&pair.variant.skeleton().curves[pair.match.curves[base_curve]]),
      base_(pair.base, base_curve),
      variant_(pair.variant, pair.match.curves[base_curve]) {
  Points at(kProbes, 3);
  for (int i = 0; i < kProbes; ++i) {
    probes_.push_back(base_.locate((i + 0.5) / kProbes));
    at.row(i) = pair.base.evaluate_edge(probes_.back().edge, probes_.back().t).point;
  }
  const Points moved = pair.prediction(at);
  for (int i = 0; i < kProbes; ++i) predicted_.push_back(moved.row(i));
  rests_ = rests(at);
  if (rests_) alignment_ = {};
  way_ = choose();
  pair_ = nullptr;
}

CurveLocation CurveMap::operator()(const CurveLocation& base) const {
  const CurveLocation to = apply(way_, base);
  if (stretches_.empty()) return to;
  const double fraction = variant_.fraction(to);
  const CurveLocation from = variant_.locate(fraction);  // differs by the table's rounding
  const CurveLocation shifted = variant_.locate(fraction + shift(fraction));
  if (from.edge != to.edge || shifted.edge != to.edge) return shifted;
  const CadEdge& edge = variant_.model().edges()[to.edge];
  return {to.edge, std::clamp(to.t + shifted.t - from.t, edge.first, edge.last)};
}

// Linear between the joints.
double CurveMap::shift(double fraction) const {
  const double first = stretches_.front().fraction;
  if (fraction < first) fraction += 1;  // closed
  const auto after =
      std::ranges::find_if(stretches_.begin() + 1, stretches_.end() - 1,
                           [&](const Stretch& stretch) { return stretch.fraction > fraction; });
  const Stretch& b = *after;
  const Stretch& a = *(after - 1);
  return a.shift + (b.shift - a.shift) * (fraction - a.fraction) / (b.fraction - a.fraction);
}

void CurveMap::lead_through(const std::vector<CurveJoint>& joints) {
  const bool is_closed = base_curve_->is_closed();
  std::vector<Stretch> found;
  for (const CurveJoint& joint : joints) {
    const EdgeFoot foot = variant_.nearest(joint.to);
    if (foot.distance > kDifferent * variant_.model().diagonal()) continue;
    const double from = variant_.fraction(apply(way_, joint.base));
    double shift = variant_.fraction({foot.edge, foot.t}) - from;
    if (is_closed) shift -= std::round(shift);
    found.push_back({from, shift});
  }
  if (found.empty()) return;
  std::ranges::sort(found, {}, &Stretch::fraction);
  const Stretch begin = is_closed ? found.front() : Stretch{0, 0};
  const Stretch end{begin.fraction + 1, begin.shift};
  const auto is_ordered = [](const Stretch& a, const Stretch& b) {
    const double before = b.fraction - a.fraction;
    return std::min(before, before + b.shift - a.shift) > kApart;
  };
  stretches_ = {begin};
  for (const Stretch& stretch : found)
    if (is_ordered(stretches_.back(), stretch) && is_ordered(stretch, end))
      stretches_.push_back(stretch);
  stretches_.push_back(end);
  const bool is_still = std::ranges::all_of(
      stretches_, [](const Stretch& stretch) { return std::abs(stretch.shift) < kDifferent; });
  if (is_still) stretches_.clear();
}

CurveLocation CurveMap::by_parameter(const Way& way, const CurveLocation& base) const {
  const std::size_t i = link_index(*base_curve_, base.edge);
  const CurveLink& from = base_curve_->links[i];
  const std::size_t links = variant_curve_->links.size();
  const std::size_t j = (way.is_reversed ? links - 1 - i : i) + way.shift;
  const CurveLink& to = variant_curve_->links[j % links];
  const CadEdge& a = base_.model().edges()[from.edge];
  const CadEdge& b = variant_.model().edges()[to.edge];
  const bool is_flipped = (from.is_reversed != to.is_reversed) != way.is_reversed;
  if (!is_flipped && a.first == b.first && a.last == b.last) return {to.edge, base.t};
  const double s = (base.t - a.first) / (a.last - a.first);
  return {to.edge, is_flipped ? b.last - s * (b.last - b.first) : b.first + s * (b.last - b.first)};
}

// Equal parts of the parameters' range, in whatever pieces.
CurveLocation CurveMap::by_range(const Way& way, const CurveLocation& base) const {
  const double all = range(variant_.model(), *variant_curve_);
  double covered = range_before(base_.model(), *base_curve_, base);
  if (!has_equal_range()) covered *= all / range(base_.model(), *base_curve_);
  if (way.is_reversed) covered = all - covered;
  covered += way.phase * all;
  if (base_curve_->is_closed()) covered -= all * std::floor(covered / all);
  return locate_range(variant_.model(), *variant_curve_, covered);
}

bool CurveMap::has_equal_range() const {
  const double a = range(base_.model(), *base_curve_);
  return std::abs(range(variant_.model(), *variant_curve_) - a) < kSameRange * a;
}

CurveLocation CurveMap::apply(const Way& way, const CurveLocation& base) const {
  switch (way.mode) {
    case Mode::Parameter:
      return by_parameter(way, base);
    case Mode::Range:
      return by_range(way, base);
    case Mode::Face: {
      const double progress = (*base_progress_)(base);
      const bool is_closed = base_curve_->is_closed();
      return variant_progress_->locate(
          (way.is_reversed ? (is_closed ? 0 : 1) - progress : progress) + way.phase);
    }
    case Mode::Length: {
      const double fraction = base_.fraction(base);
      return variant_.locate((way.is_reversed ? 1 - fraction : fraction) + way.phase);
    }
    case Mode::Shape: {
      const double fraction = base_.fraction(base, CurveMeasure::Shape);
      return variant_.locate((way.is_reversed ? 1 - fraction : fraction) + way.phase,
                             CurveMeasure::Shape);
    }
    case Mode::Nearest:
      break;
  }
  const Vector3d x = base_.model().evaluate_edge(base.edge, base.t).point;
  const EdgeFoot foot = variant_.nearest(alignment_(x));
  return {foot.edge, foot.t};
}

CurveMap::Images CurveMap::places() const {
  Images points;
  for (const CurveLocation& l : probes_)
    points.push_back(base_.model().evaluate_edge(l.edge, l.t).point);
  return points;
}

CurveMap::Images CurveMap::images(const Way& way) const {
  Images points;
  for (const CurveLocation& probe : probes_) {
    const CurveLocation l = apply(way, probe);
    points.push_back(variant_.model().evaluate_edge(l.edge, l.t).point);
  }
  return points;
}

double CurveMap::deviation(const Way& way, const Images& from) const {
  return root_mean_square(images(way), from);
}

// By how much the curve would bend, in bits: what is left of the probes' motion but for a
// similarity.
double CurveMap::bend(const Way& way) const {
  const Images to = images(way);
  Images turned = places();
  const Similarity fit = fit_similarity(turned, to);
  for (Vector3d& point : turned) point = fit(point);
  const double size = root_mean_square(to, Images(kProbes, mean(to)));
  return std::log2(1 + root_mean_square(turned, to) / (kBendUnit * size));
}

// By how much the curve would be strained, in bits: the distance of the square root velocities of
// the curve and its image, which bending and stretching both add to (Srivastava et al. 2011,
// docs/cad-and-surface.md).
double CurveMap::strain(const Way& way) const {
  const auto tangent = [](const CurveTable& table, const CadCurve& curve, const CurveLocation& at) {
    const bool runs_back = curve.links[link_index(curve, at.edge)].is_reversed;
    return Vector3d((runs_back ? -1 : 1) *
                    table.model().evaluate_edge(at.edge, at.t).dt.normalized());
  };
  const auto place = [&](double i) {
    return base_.locate(i / kStrainProbes, CurveMeasure::Shape);  // noses have as many as sides
  };
  const auto length = [&](const CurveTable& table, const CurveLocation& a, const CurveLocation& b) {
    const double part = table.fraction(b) - table.fraction(a);
    return std::abs(base_curve_->is_closed() ? part - std::round(part) : part);
  };
  Images from, to;
  std::vector<Vector3d> before, after;
  std::vector<double> lengths, stretches;
  for (int i = 0; i < kStrainProbes; ++i) {
    const CurveLocation base = place(i + 0.5), image = apply(way, base);
    from.push_back(base_.model().evaluate_edge(base.edge, base.t).point);
    to.push_back(variant_.model().evaluate_edge(image.edge, image.t).point);
    before.push_back(tangent(base_, *base_curve_, base));
    after.push_back((way.is_reversed ? -1 : 1) * tangent(variant_, *variant_curve_, image));
    lengths.push_back(length(base_, place(i), place(i + 1)));
    stretches.push_back(length(variant_, apply(way, place(i)), apply(way, place(i + 1))));
  }
  const Eigen::Matrix3d rotation = fit_similarity(from, to).rotation;
  double sum = 0;
  for (int i = 0; i < kStrainProbes; ++i)
    sum += (std::sqrt(stretches[i]) * after[i] - std::sqrt(lengths[i]) * (rotation * before[i]))
               .squaredNorm();
  return std::log2(1 + std::sqrt(sum) / kStrainUnit);
}

// The same by shape, from the same start, where that strains the curve clearly less.
CurveMap::Way CurveMap::less_strained(const Way& way) const {
  if (has_own_parameters()) return way;
  const CurveLink& first = base_curve_->links.front();
  const CadEdge& edge = base_.model().edges()[first.edge];
  const CurveLocation start{first.edge, first.is_reversed ? edge.last : edge.first};
  Way by_shape{Mode::Shape, way.is_reversed, 0, 0};
  if (base_curve_->is_closed())
    by_shape.phase = variant_.fraction(apply(way, start), CurveMeasure::Shape) -
                     variant_.fraction(apply(by_shape, start), CurveMeasure::Shape);
  return strain(by_shape) < strain(way) - kClearlyLess ? by_shape : way;
}

// The phase that comes nearest to the given places of the probes.
CurveMap::Way CurveMap::best_phase(Way way, const Images& to) const {
  Way best = way;
  double least = 1e300;
  for (int i = 0; i < kPhases; ++i) {
    way.phase = static_cast<double>(i) / kPhases;
    const double d = deviation(way, to);
    if (d < least) {
      least = d;
      best = way;
    }
  }
  double step = 0.5 / kPhases;
  for (int i = 0; i < 12; ++i, step *= 0.6)  // shrinking steps towards the minimum
    for (const double sign : {-1.0, 1.0}) {
      way = best;
      way.phase += sign * step;
      const double d = deviation(way, to);
      if (d < least) {
        least = d;
        best = way;
      }
    }
  return polished(best, to);
}

// The secant method on the phase, from near the minimum: it finds all digits, also where the curve
// grows or shrinks, which Gauss and Newton's steps do not see.
CurveMap::Way CurveMap::polished(Way way, const Images& to) const {
  double before = 0, step = 0;
  for (int iteration = 0; iteration < 8; ++iteration) {
    double along = 0, norm = 0;
    for (int i = 0; i < kProbes; ++i) {
      const CurveLocation l = apply(way, probes_[i]);
      const CurvePoint p = variant_.model().evaluate_edge(l.edge, l.t);
      const bool runs_back = variant_curve_->links[link_index(*variant_curve_, l.edge)].is_reversed;
      const Vector3d tangent = (runs_back ? -1 : 1) * variant_.length() * p.dt.normalized();
      along += (to[i] - p.point).dot(tangent);
      norm += tangent.squaredNorm();
    }
    const double slope = along / norm;
    step = iteration == 0 ? slope : -slope * step / (slope - before);
    if (!(std::abs(step) < kNear)) break;  // far from the minimum: leave it
    before = slope;
    way.phase += step;
  }
  return way;
}

// With its ends: a line that the motion shifts along itself is not.
bool CurveMap::is_same_under(const Similarity& motion) const {
  const double tolerance = kSame * variant_.model().diagonal();
  const auto meets = [&](CornerId corner) {
    return (motion(corner_point(pair_->base, corner)) -
            corner_point(pair_->variant, pair_->match.corners[corner]))
               .norm() < tolerance;
  };
  if (!base_curve_->is_closed() && !(meets(base_curve_->start) && meets(base_curve_->end)))
    return false;
  return std::all_of(probes_.begin(), probes_.end(), [&](const CurveLocation& l) {
    return variant_.nearest(motion(base_.model().evaluate_edge(l.edge, l.t).point)).distance <
           tolerance;
  });
}

// Whether the curve lies where it lay, though the alignment of all that moves would carry it off: a
// rim far from a small body. A closed curve may turn in itself: it rests only where the alignment
// hardly moves its points.
bool CurveMap::rests(const Points& at) const {
  if (is_same_under(alignment_) || !is_same_under({})) return false;
  if (!base_curve_->is_closed()) {
    const auto stays = [&](CornerId corner) {
      return (corner_point(pair_->base, corner) -
              corner_point(pair_->variant, pair_->match.corners[corner]))
                 .norm() < kDifferent * variant_.model().diagonal();
    };
    return stays(base_curve_->start) && stays(base_curve_->end);
  }
  return std::ranges::all_of(at.rowwise(), [&](const auto& point) {
    const Vector3d x = point;
    return (alignment_(x) - x).norm() < kNear * base_.length();
  });
}

// Of the ways that lay links on links, the one nearest to the prediction: from whichever link on.
CurveMap::Way CurveMap::best_shift(bool is_reversed) const {
  Way best;
  double least = 1e300;
  for (std::size_t shift = 0; shift < base_curve_->links.size(); ++shift) {
    const Way way{Mode::Parameter, is_reversed, shift, 0};
    const double d = deviation(way, predicted_);
    if (d < least) {
      least = d;
      best = way;
    }
  }
  return best;
}

// Joints of a chain are where seams meet the curve, no places of the part, and the parameters of
// free forms are what the modeller made of them: those of an intersection run unevenly. A circle
// goes once round, in however many pieces.
bool CurveMap::has_own_parameters() const {
  const auto is_natural = [](const CadModel& model, const CadCurve& curve) {
    const bool is_any_free = std::ranges::any_of(
        curve.links, [&](const CurveLink& link) { return model.edges()[link.edge].is_free_form; });
    const double turn = 2 * std::numbers::pi;
    return !is_any_free &&
           (curve.links.size() == 1 || std::abs(range(model, curve) - turn) < kSameRange * turn);
  };
  return is_natural(base_.model(), *base_curve_) && is_natural(variant_.model(), *variant_curve_);
}

// The parameter that runs straightest along the curve, of the faces beside it. Planes have none of
// their own.
void CurveMap::find_progress() {
  double best = kCarried;
  for (const FaceId face : base_curve_->faces) {
    const FaceId image = pair_->match.faces[face];
    const SurfaceType type = pair_->base.faces()[face].type;
    if (type == SurfaceType::Plane || type != pair_->variant.faces()[image].type) continue;
    for (const int parameter : {0, 1}) {
      auto base = FaceProgress::along(pair_->base, *base_curve_, face, parameter);
      if (!base || base->straightness() <= best) continue;
      auto variant = FaceProgress::along(pair_->variant, *variant_curve_, image, parameter);
      if (!variant || variant->straightness() <= best) continue;
      best = std::min(base->straightness(), variant->straightness());
      base_progress_ = std::move(base);
      variant_progress_ = std::move(variant);
    }
  }
}

// The same by the parameter of a face, unless it agrees with the curve's own.
CurveMap::Way CurveMap::by_face(const Way& way) {
  if (has_own_parameters()) return way;
  find_progress();
  if (!base_progress_) return way;
  Way result{Mode::Face, way.is_reversed, 0, 0};
  if (base_curve_->is_closed()) {
    const auto base_seam = base_progress_->seam(), variant_seam = variant_progress_->seam();
    if (!base_seam || !variant_seam) return way;
    const double at = (*base_progress_)(*base_seam);
    result.phase = (*variant_progress_)(*variant_seam) - (way.is_reversed ? -at : at);
  }
  const auto agrees = [&](const CurveLocation& l) {
    const CurveLocation a = apply(way, l), b = apply(result, l);
    const CadModel& model = variant_.model();
    const double tolerance = std::max(model.edges()[a.edge].tolerance, kSame * model.diagonal());
    return (model.evaluate_edge(a.edge, a.t).point - model.evaluate_edge(b.edge, b.t).point)
               .norm() <= tolerance;
  };
  return std::ranges::all_of(probes_, agrees) ? way : result;
}

// A chain cut into other pieces starts where one of them does, on both sides.
CurveMap::Way CurveMap::best_start(bool is_reversed) const {
  const double all = range(variant_.model(), *variant_curve_);
  Way best;
  double least = 1e300, to_base = 0;
  for (const CurveLink& base_link : base_curve_->links) {
    double to_variant = 0;
    for (const CurveLink& link : variant_curve_->links) {
      const double start = is_reversed ? -to_base : to_base;
      const Way way{Mode::Range, is_reversed, 0, (to_variant - start) / all};
      const double d = deviation(way, predicted_);
      if (d < least) {
        least = d;
        best = way;
      }
      to_variant += range(variant_.model(), link);
    }
    to_base += range(base_.model(), base_link);
  }
  return best;
}

// Where the curve may start: by the parameters, where these correspond, and so that it turns as
// little as possible, in place or with the part.
void CurveMap::find_starts() {
  const bool has_equal_links = base_curve_->links.size() == variant_curve_->links.size();
  const std::optional<bool> sense = runs_backward_by_faces();
  turned_ = {Mode::Length, sense.value_or(false), 0, 0};
  if (!sense) {
    Way back = turned_;
    back.is_reversed = true;
    turned_.is_reversed = deviation(best_phase(back, predicted_), predicted_) <
                          deviation(best_phase(turned_, predicted_), predicted_);
  }
  const bool is_reversed = turned_.is_reversed;
  auto& [by_parameters, in_place, with_part, predicted] = starts_;
  if (has_equal_links || has_equal_range())
    by_parameters =
        less_strained(by_face(has_equal_links ? best_shift(is_reversed) : best_start(is_reversed)));
  else if (!has_own_parameters())
    find_progress();
  if (has_own_parameters() || (by_parameters && by_parameters->mode == Mode::Range))
    turned_.mode = Mode::Range;
  else if (base_progress_)
    turned_.mode = Mode::Face;
  in_place = turned_by(Similarity{});
  if (!has_own_parameters()) {
    for (const Mode mode : {Mode::Length, Mode::Shape}) {
      turned_.mode = mode;
      const Way way = turned_by(Similarity{});
      if (strain(way) < strain(*in_place) - kClearlyLess) in_place = way;
    }
    turned_.mode = in_place->mode;
  }
  is_same_ = pair_->match.is_congruent || is_same_under(alignment_);
  with_part = is_same_ ? Way{Mode::Nearest, is_reversed, 0, 0} : turned_by(alignment_);
  // Where seams cut a circle into other pieces, these tell its start only if that hardly turns it.
  if (by_parameters && !has_equal_links && has_own_parameters() &&
      turn(*by_parameters, images(*in_place)) > kTurnUnit &&
      turn(*by_parameters, images(*with_part)) > kTurnUnit)
    by_parameters.reset();
  is_free_form_ = !pair_->match.is_congruent && starts_at_free_form();
}

// The phase of a curve that turns by a motion, wherever it goes.
CurveMap::Way CurveMap::turned_by(const Similarity& motion) const {
  Images to = places();
  for (Vector3d& point : to) point = motion(point);
  const Vector3d shift = mean(images(turned_)) - mean(to);
  for (Vector3d& point : to) point += shift;
  return best_phase(turned_, to);
}

// Whether in one of the models the curve, or all faces whose seams meet it, are free forms.
bool CurveMap::starts_at_free_form() const {
  const auto is_free = [](const CadModel& model, const CadCurve& curve) {
    bool is_any = false, is_all = true;
    for (const FaceId face : curve.faces)
      for (const EdgeId seam : seams(model, face)) {
        const CadEdge& edge = model.edges()[seam];
        const bool meets = std::ranges::any_of(curve.links, [&](const CurveLink& link) {
          const CadEdge& own = model.edges()[link.edge];
          return own.start == edge.start || own.start == edge.end;
        });
        if (!meets) continue;
        const SurfaceType type = model.faces()[face].type;
        is_any = true;
        is_all &= type == SurfaceType::BSpline;
      }
    return is_any ? is_all : model.edges()[curve.links.front().edge].is_free_form;
  };
  return is_free(base_.model(), *base_curve_) || is_free(variant_.model(), *variant_curve_);
}

// By how much a closed curve is laid otherwise than there, in radians of a circle.
double CurveMap::turn(const Way& way, const Images& against) const {
  return deviation(way, against) / root_mean_square(against, Images(kProbes, mean(against)));
}

void CurveMap::rate_starts(const std::optional<MotionAround>& around) {
  auto& [by_parameters, in_place, with_part, predicted] = starts_;
  predicted = around ? turned_by(around->motion) : best_phase(turned_, predicted_);
  Images expected = images(*predicted);
  if (is_same_ && !around)
    for (int i = 0; i < kProbes; ++i) expected[i] = variant_.nearest(predicted_[i]).point;
  const auto bits = [&](const Way& way) { return std::log2(1 + turn(way, expected) / kTurnUnit); };
  costs_[1] = bits(*in_place) + bend(*in_place);
  costs_[2] = bits(*with_part) + bend(*with_part);
  // A turn told by the centres of other curves is no guess: it costs nothing.
  is_told_by_places_ = around && around->is_of_places;
  costs_[3] = (is_told_by_places_ ? 0 : kPredictedBits) + bend(*predicted);
  if (!by_parameters) {
    costs_[0] = *std::min_element(costs_.begin() + 1, costs_.end());
    return;
  }
  const bool agrees = !is_told_by_places_ && (turn(*by_parameters, images(*in_place)) < kAgrees ||
                                              turn(*by_parameters, images(*with_part)) < kAgrees);
  costs_[0] = bend(*by_parameters);
  if (!agrees)
    costs_[0] += std::max(bits(*by_parameters) - (is_free_form_ ? kFreeFormBits : 0), 0.0);
}

void CurveMap::take(Start start) {
  const auto wanted = static_cast<std::size_t>(start);
  const auto cheapest = std::min_element(costs_.begin() + 1, costs_.end()) - costs_.begin();
  way_ = starts_[wanted] ? *starts_[wanted] : *starts_[static_cast<std::size_t>(cheapest)];
}

ClosedPlace CurveMap::place() const {
  const Images places = this->places();
  const Vector3d centre = mean(places);
  Vector3d area = Vector3d::Zero();
  for (int i = 0; i < kProbes; ++i)
    area += (places[i] - centre).cross(places[(i + 1) % kProbes] - centre);
  return {centre, mean(images(way_)), area.normalized(),
          root_mean_square(places, Images(kProbes, centre))};
}

void CurveMap::add_images(Images& from, Images& to) const {
  const Images own = places();
  const Images images = this->images(way_);
  const Vector3d before = mean(own), after = mean(images);
  for (int i = 0; i < kProbes; ++i) {
    from.push_back(own[i] - before);
    to.push_back(images[i] - after);
  }
}

// A face lies to the left of its coedges as seen from outside, in both models. Where its two faces
// contradict each other, a file's wire runs the wrong way round (a ball between two circles).
std::optional<bool> CurveMap::runs_backward_by_faces() const {
  if (!pair_->match.is_oriented) return std::nullopt;
  const CurveLink& from = base_curve_->links.front();
  const CurveLink& to = variant_curve_->links.front();
  std::optional<bool> result;
  for (const FaceId face : base_curve_->faces) {
    if (pair_->base.faces()[face].other_solid >= 0) continue;  // both sides are outside
    const std::optional<bool> before = runs_against(pair_->base, from, face);
    const std::optional<bool> after = runs_against(pair_->variant, to, pair_->match.faces[face]);
    if (!before || !after) continue;
    const bool is_backward = *before != *after;
    if (result && *result != is_backward) return std::nullopt;
    result = is_backward;
  }
  return result;
}

bool CurveMap::runs_backward() const {
  const auto& corners = pair_->match.corners;
  if (base_curve_->start != base_curve_->end)
    return corners[base_curve_->start] != variant_curve_->start;
  if (const std::optional<bool> sense = runs_backward_by_faces()) return *sense;
  return deviation({Mode::Length, true, 0, 0}, predicted_) <
         deviation({Mode::Length, false, 0, 0}, predicted_);
}

CurveMap::Way CurveMap::choose() {
  Way way;
  if (base_curve_->is_closed()) {
    find_starts();
    return *starts_[2];  // until one is taken
  }
  const bool has_equal_links = base_curve_->links.size() == variant_curve_->links.size();
  way.is_reversed = runs_backward();
  way.mode = has_equal_links ? Mode::Parameter : has_equal_range() ? Mode::Range : Mode::Length;
  way = less_strained(by_face(way));
  if (!is_same_under(alignment_)) return way;
  const Way nearest{Mode::Nearest, way.is_reversed, 0, 0};
  const double different =
      (pair_->match.is_congruent ? kRounding : kDifferent) * variant_.model().diagonal();
  const bool is_better =
      rests_ || deviation(nearest, predicted_) + different < deviation(way, predicted_);
  return is_better ? nearest : way;
}

}  // namespace cadmorph
