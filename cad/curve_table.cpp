#include "cad/curve_table.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

namespace cadmorph {
namespace {

// Chords of an edge, each passed in proportion to its parameters: a circle is 0.01 % short, and
// alike all round.
constexpr int kSamplesPerLink = 128;
// Of the length: the gap where two edges meet is no chord, and has any direction.
constexpr double kGap = 1e-6;

double angle(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b));
}

// The angle that chords between the points turn through, up to each point; those up to `gap` are
// none.
std::vector<double> turned(const std::vector<Eigen::Vector3d>& points, double gap) {
  std::vector<double> result(points.size(), 0);
  std::optional<Eigen::Vector3d> before;
  for (std::size_t i = 1; i < points.size(); ++i) {
    const Eigen::Vector3d chord = points[i] - points[i - 1];
    result[i] = result[i - 1];
    if (chord.norm() <= gap) continue;
    if (before) result[i] += angle(*before, chord);
    before = chord;
  }
  return result;
}

}  // namespace

CurveTable::CurveTable(const CadModel& model, CurveId curve)
    : model_(&model), is_closed_(model.skeleton().curves[curve].is_closed()) {
  for (const CurveLink& link : model.skeleton().curves[curve].links) {
    const CadEdge& edge = model.edges()[link.edge];
    for (int i = 0; i <= kSamplesPerLink; ++i) {
      const double s = static_cast<double>(i) / kSamplesPerLink;
      const double t = edge.first + (link.is_reversed ? 1 - s : s) * (edge.last - edge.first);
      const Eigen::Vector3d p = model.evaluate_edge(link.edge, t).point;
      const double step = point_.empty() || i == 0 ? 0 : (p - point_.back()).norm();
      arc_.push_back(arc_.empty() ? 0 : arc_.back() + step);
      location_.push_back({link.edge, t});
      point_.push_back(p);
    }
  }
  shape_ = turned(point_, kGap * length());
  for (std::size_t i = 0; i < shape_.size(); ++i)
    shape_[i] = shape_[i] / (2 * std::numbers::pi) + arc_[i] / length();
}

double CurveTable::fraction(const CurveLocation& location, CurveMeasure measure) const {
  const std::vector<double>& covered = measured(measure);
  const auto begin = std::find_if(location_.begin(), location_.end(),
                                  [&](const CurveLocation& l) { return l.edge == location.edge; });
  const auto first = static_cast<std::size_t>(begin - location_.begin());
  const double from = location_[first].t, to = location_[first + kSamplesPerLink].t;
  const double s = std::clamp((location.t - from) / (to - from), 0.0, 1.0) * kSamplesPerLink;
  const auto i = first + static_cast<std::size_t>(std::min<double>(s, kSamplesPerLink - 1));
  return (covered[i] + (s - static_cast<double>(i - first)) * (covered[i + 1] - covered[i])) /
         covered.back();
}

CurveLocation CurveTable::locate(double fraction, CurveMeasure measure) const {
  const std::vector<double>& covered = measured(measure);
  const double wrapped =
      is_closed_ ? fraction - std::floor(fraction) : std::clamp(fraction, 0.0, 1.0);
  const double wanted = wrapped * covered.back();
  auto upper = std::upper_bound(covered.begin() + 1, covered.end() - 1, wanted);
  const auto i = static_cast<std::size_t>(upper - covered.begin());
  const double span = covered[i] - covered[i - 1];
  const double s = span > 0 ? (wanted - covered[i - 1]) / span : 0;
  if (location_[i].edge != location_[i - 1].edge) return location_[i];
  return {location_[i].edge, location_[i - 1].t + s * (location_[i].t - location_[i - 1].t)};
}

Eigen::Vector3d CurveTable::point(double fraction) const {
  const CurveLocation l = locate(fraction);
  return model_->evaluate_edge(l.edge, l.t).point;
}

EdgeFoot CurveTable::nearest(const Eigen::Vector3d& x) const {
  std::size_t best = 0;
  double smallest = 1e300;
  for (std::size_t i = 0; i < point_.size(); ++i) {
    const double squared = (point_[i] - x).squaredNorm();
    if (squared < smallest) {
      smallest = squared;
      best = i;
    }
  }
  EdgeFoot foot = project_on_edge(*model_, location_[best].edge, x, location_[best].t);
  // At a joint of two links the foot may lie on the other one.
  for (const std::size_t i : {best == 0 ? point_.size() - 1 : best - 1, (best + 1) % point_.size()})
    if (location_[i].edge != foot.edge) {
      const EdgeFoot other = project_on_edge(*model_, location_[i].edge, x, location_[i].t);
      if (other.distance < foot.distance) foot = other;
    }
  return foot;
}

}  // namespace cadmorph
