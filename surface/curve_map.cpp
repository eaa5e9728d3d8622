#include "surface/curve_map.h"

#include <algorithm>
#include <cmath>

#include "cad/alignment.h"

namespace cadmorph {
namespace {

using Eigen::Vector3d;

constexpr int kProbes = 24;
constexpr int kPhases = 96;
// Points that slide along a closed curve to and fro, by at most this part as a whole, tell of
// another parametrisation; points that all slide one way tell of a turn.
constexpr double kToAndFro = 0.2;
constexpr double kSameForm = 1e-4;   // of the curve's length: room for its sampling
constexpr double kLikeForm = 5e-2;   // of the curve's length
constexpr double kRounding = 1e-10;  // of the diagonal
constexpr double kSame = 1e-7;       // of the diagonal: one curve, whatever its parameters
constexpr double kDifferent = 1e-6;  // of the diagonal: not the same point
constexpr double kApart = 1e-4;      // of the curve's length, at least between joints
constexpr double kCarried = 0.2;     // straightness of a face parameter that tells places apart
constexpr double kSameRange = 1e-9;  // of the range of a chain's parameters

std::size_t link_index(const CadCurve& curve, int edge) {
  const auto it = std::find_if(curve.links.begin(), curve.links.end(),
                               [&](const CurveLink& link) { return link.edge == edge; });
  return static_cast<std::size_t>(it - curve.links.begin());
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
std::optional<bool> runs_against(const CadModel& model, const CurveLink& link, int face) {
  std::optional<bool> result;
  for (const int c : model.edges()[link.edge].coedges) {
    if (model.coedges()[c].face != face) continue;
    if (result) return std::nullopt;
    result = model.coedges()[c].is_reversed != link.is_reversed;
  }
  return result;
}

}  // namespace

CurveMap::CurveMap(const ModelPair& pair, int base_curve)
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

// The same parameters in other pieces.
CurveLocation CurveMap::by_range(const Way& way, const CurveLocation& base) const {
  const double all = range(variant_.model(), *variant_curve_);
  double covered = range_before(base_.model(), *base_curve_, base);
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
    case Mode::Nearest:
      break;
  }
  const Vector3d x = base_.model().evaluate_edge(base.edge, base.t).point;
  const EdgeFoot foot = variant_.nearest(alignment_(x));
  return {foot.edge, foot.t};
}

// Root mean square distance from the predicted positions.
double CurveMap::deviation(const Way& way) const {
  double sum = 0;
  for (int i = 0; i < kProbes; ++i) {
    const CurveLocation l = apply(way, probes_[i]);
    sum += (variant_.model().evaluate_edge(l.edge, l.t).point - predicted_[i]).squaredNorm();
  }
  return std::sqrt(sum / kProbes);
}

CurveMap::Way CurveMap::best_phase(bool is_reversed) const {
  Way best{Mode::Length, is_reversed, 0, 0};
  double least = 1e300;
  for (int i = 0; i < kPhases; ++i) {
    const Way way{Mode::Length, is_reversed, 0, static_cast<double>(i) / kPhases};
    const double d = deviation(way);
    if (d < least) {
      least = d;
      best = way;
    }
  }
  double step = 0.5 / kPhases;
  for (int i = 0; i < 40; ++i, step *= 0.6)  // shrinking steps towards the minimum
    for (const double sign : {-1.0, 1.0}) {
      Way way = best;
      way.phase += sign * step;
      const double d = deviation(way);
      if (d < least) {
        least = d;
        best = way;
      }
    }
  return polished(best);
}

// Newton's method on the phase: comparing deviations finds it to half the digits only.
CurveMap::Way CurveMap::polished(Way way) const {
  for (int iteration = 0; iteration < 8; ++iteration) {
    double along = 0, norm = 0;
    for (int i = 0; i < kProbes; ++i) {
      const CurveLocation l = apply(way, probes_[i]);
      const CurvePoint p = variant_.model().evaluate_edge(l.edge, l.t);
      const bool runs_back = variant_curve_->links[link_index(*variant_curve_, l.edge)].is_reversed;
      const Vector3d tangent = (runs_back ? -1 : 1) * variant_.length() * p.dt.normalized();
      along += (predicted_[i] - p.point).dot(tangent);
      norm += tangent.squaredNorm();
    }
    Way moved = way;
    moved.phase += along / norm;
    if (!(std::abs(along) < 1e-3 * norm)) break;  // far from the minimum: leave it
    way = moved;
  }
  return way;
}

bool CurveMap::is_same_under_alignment() const {
  const double tolerance = kSame * variant_.model().diagonal();
  return std::all_of(probes_.begin(), probes_.end(), [&](const CurveLocation& l) {
    return variant_.nearest(alignment_(base_.model().evaluate_edge(l.edge, l.t).point)).distance <
           tolerance;
  });
}

// Links against links in the sense of least motion: the start of a closed curve can't tell the
// sense.
CurveMap::Way CurveMap::best_shift() const {
  Way best;
  double least = 1e300;
  for (std::size_t shift = 0; shift < base_curve_->links.size(); ++shift) {
    const Way way{Mode::Parameter, least_motion_.is_reversed, shift, 0};
    const double d = deviation(way);
    if (d < least) {
      least = d;
      best = way;
    }
  }
  return best;
}

// Joints of a chain are where seams meet the curve, no places of the part, and the parameters of
// free forms are what the modeller made of them: those of an intersection run unevenly.
bool CurveMap::has_own_parameters() const {
  const auto is_natural = [](const CadModel& model, const CadCurve& curve) {
    return curve.links.size() == 1 && !model.edges()[curve.links.front().edge].is_free_form;
  };
  return is_natural(base_.model(), *base_curve_) && is_natural(variant_.model(), *variant_curve_);
}

// The parameter that runs straightest along the curve, of the faces beside it. Planes have none of
// their own.
void CurveMap::find_progress() {
  double best = kCarried;
  for (const int face : base_curve_->faces) {
    const int image = pair_->match.faces[static_cast<std::size_t>(face)];
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
CurveMap::Way CurveMap::best_start() const {
  const double all = range(variant_.model(), *variant_curve_);
  Way best;
  double least = 1e300, to_base = 0;
  for (const CurveLink& base_link : base_curve_->links) {
    double to_variant = 0;
    for (const CurveLink& link : variant_curve_->links) {
      const double start = least_motion_.is_reversed ? -to_base : to_base;
      const Way way{Mode::Range, least_motion_.is_reversed, 0, (to_variant - start) / all};
      const double d = deviation(way);
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

// Unit vector about which the variant runs, by the right-hand rule.
Vector3d CurveMap::axis() const {
  Vector3d area = Vector3d::Zero();
  const Vector3d origin = variant_.point(0);
  for (int i = 0; i < kProbes; ++i)
    area += (variant_.point(static_cast<double>(i) / kProbes) - origin)
                .cross(variant_.point((i + 1.0) / kProbes) - origin);
  return area.normalized();
}

// Length fraction from one location to another along the variant, in (-1/2, 1/2].
double CurveMap::shift_along(const CurveLocation& from, const CurveLocation& to) const {
  const double shift = variant_.fraction(to) - variant_.fraction(from);
  return shift - std::round(shift);
}

CurveMap::Way CurveMap::choose_closed(bool has_equal_links) {
  const std::optional<bool> sense = runs_backward_by_faces();
  least_motion_ = best_phase(sense.value_or(false));
  if (!sense) {
    const Way back = best_phase(true);
    if (deviation(back) < deviation(least_motion_)) least_motion_ = back;
  }
  is_by_least_motion_ = !has_equal_links && !has_equal_range();
  if (is_by_least_motion_) return least_motion_;
  const Way trusted = by_face(has_equal_links ? best_shift() : best_start());
  const double change = change_of_form(least_motion_) / variant_.length();
  if (change > kLikeForm) return trusted;
  keeps_form_ = change < kSameForm;
  const auto shift_at = [&](const CurveLocation& l) {
    return shift_along(apply(least_motion_, l), apply(trusted, l));
  };
  const double first = shift_at(probes_.front());
  double mean = first;
  for (const CurveLocation& l : probes_) {
    const double more = shift_at(l) - first;
    mean += (more - std::round(more)) / kProbes;
  }
  turn_ = (mean - std::round(mean)) * axis();
  return trusted;
}

// Sums of the scalar and the triple product of each place seen from the mean, before and after.
Eigen::Vector2d CurveMap::spin(const Way& way, const Vector3d& axis) const {
  Eigen::Matrix3Xd before(3, kProbes), after(3, kProbes);
  for (int i = 0; i < kProbes; ++i) {
    const CurveLocation to = apply(way, probes_[i]);
    before.col(i) = alignment_(base_.model().evaluate_edge(probes_[i].edge, probes_[i].t).point);
    after.col(i) = variant_.model().evaluate_edge(to.edge, to.t).point;
  }
  before.colwise() -= before.rowwise().mean().eval();
  after.colwise() -= after.rowwise().mean().eval();
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  for (int i = 0; i < kProbes; ++i) {
    const Vector3d from = before.col(i) - axis * axis.dot(before.col(i)), to = after.col(i);
    sum += Eigen::Vector2d(from.dot(to), from.cross(to).dot(axis));
  }
  return sum;
}

Eigen::Vector2d CurveMap::moved_beyond(const Similarity& motion) const {
  Eigen::Vector2d sums = Eigen::Vector2d::Zero();
  for (const CurveLocation& l : probes_) {
    const Vector3d from = motion(base_.model().evaluate_edge(l.edge, l.t).point);
    const CurveLocation images[2] = {apply(way_, l), apply(least_motion_, l)};
    for (int i = 0; i < 2; ++i)
      sums[i] +=
          (variant_.model().evaluate_edge(images[i].edge, images[i].t).point - from).squaredNorm();
  }
  return sums;
}

// Distance of the variant from the base curve, up to a similarity.
double CurveMap::change_of_form(const Way& way) const {
  std::vector<Vector3d> from, to;
  for (const CurveLocation& l : probes_) {
    const CurveLocation image = apply(way, l);
    from.push_back(base_.model().evaluate_edge(l.edge, l.t).point);
    to.push_back(variant_.model().evaluate_edge(image.edge, image.t).point);
  }
  return residual(fit_similarity(from, to), from, to);
}

// A face lies to the left of its coedges as seen from outside, in both models.
std::optional<bool> CurveMap::runs_backward_by_faces() const {
  if (!pair_->match.is_oriented) return std::nullopt;
  const CurveLink& from = base_curve_->links.front();
  const CurveLink& to = variant_curve_->links.front();
  for (const int face : base_curve_->faces) {
    if (pair_->base.faces()[face].other_solid >= 0) continue;  // both sides are outside
    const std::optional<bool> before = runs_against(pair_->base, from, face);
    const std::optional<bool> after =
        runs_against(pair_->variant, to, pair_->match.faces[static_cast<std::size_t>(face)]);
    if (before && after) return *before != *after;
  }
  return std::nullopt;
}

bool CurveMap::runs_backward() const {
  const auto& corners = pair_->match.corners;
  if (base_curve_->start != base_curve_->end)
    return corners[base_curve_->start] != variant_curve_->start;
  if (const std::optional<bool> sense = runs_backward_by_faces()) return *sense;
  return deviation({Mode::Length, true, 0, 0}) < deviation({Mode::Length, false, 0, 0});
}

CurveMap::Way CurveMap::choose() {
  const bool has_equal_links = base_curve_->links.size() == variant_curve_->links.size();
  Way way;
  if (base_curve_->is_closed()) {
    way = choose_closed(has_equal_links);
  } else {
    way.is_reversed = runs_backward();
    way.mode = has_equal_links ? Mode::Parameter : has_equal_range() ? Mode::Range : Mode::Length;
    way = by_face(way);
  }
  if (!is_same_under_alignment() || (base_curve_->is_closed() && stays(way))) return way;
  const Way nearest{Mode::Nearest, way.is_reversed, 0, 0};
  const double different =
      (pair_->match.is_congruent ? kRounding : kDifferent) * variant_.model().diagonal();
  if (deviation(nearest) + different >= deviation(way)) return way;
  const bool is_nearest =
      pair_->match.is_congruent || !base_curve_->is_closed() || is_reparametrised(way);
  if (!is_nearest) return way;
  turn_.reset();
  return nearest;
}

// A closed curve that both models have in the same place: it tells its parameters, even where all
// that is round it turned about its axis.
bool CurveMap::stays(const Way& way) const {
  return std::ranges::all_of(probes_, [&](const CurveLocation& l) {
    const CurveLocation to = apply(way, l);
    return (variant_.model().evaluate_edge(to.edge, to.t).point -
            base_.model().evaluate_edge(l.edge, l.t).point)
               .norm() <= kRounding * variant_.model().diagonal();
  });
}

bool CurveMap::is_reparametrised(const Way& way) const {
  const Way nearest{Mode::Nearest, way.is_reversed, 0, 0};
  double sum = 0, largest = 0;
  for (const CurveLocation& l : probes_) {
    const double shift = shift_along(apply(nearest, l), apply(way, l));
    sum += shift;
    largest = std::max(largest, std::abs(shift));
  }
  return std::abs(sum / kProbes) < kToAndFro * largest;
}

}  // namespace cadmorph
