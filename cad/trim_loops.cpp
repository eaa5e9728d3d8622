#include "cad/trim_loops.h"

#include <Geom2d_BSplineCurve.hxx>
#include <Geom2d_Line.hxx>
#include <Geom2d_TrimmedCurve.hxx>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace cadmorph {
namespace {

using Eigen::Vector2d;

// Of a ray against the u direction: hardly ever along the round parameters of structured meshes.
constexpr double kTilt = 0.3137;
// Of the domain: more than the gaps that pcurves leave at a vertex. Other uses of the vertex, at a
// seam, lie a period away.
constexpr double kSameJoint = 1e-2;
constexpr double kStraight = 1e-12;  // of the domain: above the rounding of a pcurve's points
// Of the largest of four samples of a bulge: the top of a parabola is 1.04 times as high.
constexpr double kBulgeMargin = 1.25;
// Reached by splines of 64 knots and more, whose chords need not be finer: near a chord the pcurve
// itself decides.
constexpr int kMostChords = 512;
constexpr int kMostEntries = 8;  // in bins, a chord on average: as much memory as the chord itself
constexpr int kIterations = 60;  // more than halving would take to kStraight, 40

double cross(const Vector2d& a, const Vector2d& b) { return a.x() * b.y() - a.y() * b.x(); }

// Pieces short enough to be graphs over their chords: the 64th part of a circle bulges by 0.12 % of
// the radius.
int chord_count(const Pcurve& pcurve) {
  Handle(Geom2d_Curve) curve = pcurve.curve;
  while (const auto trimmed = Handle(Geom2d_TrimmedCurve)::DownCast(curve))
    curve = trimmed->BasisCurve();
  if (curve->IsKind(STANDARD_TYPE(Geom2d_Line))) return 1;
  if (const auto spline = Handle(Geom2d_BSplineCurve)::DownCast(curve))
    return std::min(kMostChords, std::max(32, 8 * spline->NbKnots()));
  return 64;
}

}  // namespace

void TrimLoops::add(const Pcurve& pcurve, bool is_reversed, VertexId start, VertexId end) {
  const int count = chord_count(pcurve), id = static_cast<int>(pcurves_.size());
  pcurves_.push_back(pcurve);
  const auto parameter = [&](int i) {
    const double share = i / static_cast<double>(count);
    return pcurve.edge_first + (pcurve.edge_last - pcurve.edge_first) * share;
  };
  for (int i = 0; i < count; ++i) {
    double from = parameter(i), to = parameter(i + 1);
    if (is_reversed) std::swap(from, to);
    chords_.push_back({pcurve(from), pcurve(to), id, from, to});
  }
  const End first{start, pcurve(pcurve.edge_first)}, last{end, pcurve(pcurve.edge_last)};
  departures_.push_back(is_reversed ? last : first);
  arrivals_.push_back(is_reversed ? first : last);
}

void TrimLoops::close() {
  if (chords_.empty()) return;
  lower_ = upper_ = chords_.front().from;
  for (const Chord& c : chords_) {
    lower_ = lower_.cwiseMin(c.from).cwiseMin(c.to);
    upper_ = upper_.cwiseMax(c.from).cwiseMax(c.to);
  }
  join_ends();
  for (Chord& c : chords_) measure_bulge(c);
  fill_bins();
}

// The nearest departure at its vertex takes each arrival up. A loop that nothing takes up stays
// open.
void TrimLoops::join_ends() {
  const auto by_vertex = [](const End& a, const End& b) { return a.vertex < b.vertex; };
  std::ranges::stable_sort(departures_, by_vertex);
  std::vector<char> is_taken(departures_.size(), 0);
  for (const End& arrival : arrivals_) {
    const auto [begin, end] =
        std::equal_range(departures_.begin(), departures_.end(), arrival, by_vertex);
    auto nearest = end;
    double least = std::numeric_limits<double>::infinity();
    for (auto it = begin; it != end; ++it) {
      const double gap = (scaled(it->at) - scaled(arrival.at)).norm();
      if (is_taken[it - departures_.begin()] || gap >= least) continue;
      nearest = it;
      least = gap;
    }
    if (least > kSameJoint) {
      is_open_ = true;
      continue;
    }
    is_taken[nearest - departures_.begin()] = 1;
    if (least > 0) chords_.push_back({arrival.at, nearest->at});
  }
  arrivals_.clear();
  departures_.clear();
}

Vector2d TrimLoops::scaled(const Vector2d& uv) const {
  const Vector2d size = (upper_ - lower_).cwiseMax(std::numeric_limits<double>::min());
  const Vector2d p = (uv - lower_).cwiseQuotient(size);
  return {p.x(), p.y() + kTilt * p.x()};
}

void TrimLoops::measure_bulge(Chord& chord) const {
  if (chord.pcurve < 0) return;
  const Vector2d from = scaled(chord.from), along = scaled(chord.to) - from;
  const double squared = along.squaredNorm();
  if (squared == 0) return;
  double most = 0;
  for (const double share : {0.2, 0.4, 0.6, 0.8}) {
    const double t = chord.t_from + share * (chord.t_to - chord.t_from);
    const Vector2d p = scaled(pcurves_[chord.pcurve](t));
    most = std::max(most, std::abs(cross(along, p - from)) / squared);
  }
  if (most * std::sqrt(squared) > kStraight) chord.bulge = kBulgeMargin * most;
}

// Bins of heights: as many as keep the entries few.
void TrimLoops::fill_bins() {
  struct Heights {
    double least, most;
  };
  std::vector<Heights> heights;
  double least = std::numeric_limits<double>::infinity(), most = -least, sum = 0;
  for (const Chord& c : chords_) {
    const Vector2d from = scaled(c.from), to = scaled(c.to);
    const double margin = c.bulge * (to - from).norm();
    heights.push_back({std::min(from.y(), to.y()) - margin, std::max(from.y(), to.y()) + margin});
    least = std::min(least, heights.back().least);
    most = std::max(most, heights.back().most);
    sum += heights.back().most - heights.back().least;
  }
  const auto chords = static_cast<double>(chords_.size());
  const double range = std::max(most - least, std::numeric_limits<double>::min());
  const double bins = std::clamp(kMostEntries * chords * range / std::max(sum, range), 1.0, chords);
  least_height_ = least;
  bins_per_height_ = std::floor(bins) / range;
  first_of_bin_.assign(static_cast<std::size_t>(bins) + 1, 0);
  const auto each_bin = [&](const auto& visit) {
    for (std::size_t i = 0; i < chords_.size(); ++i)
      for (std::size_t b = bin(heights[i].least); b <= bin(heights[i].most); ++b) visit(b, i);
  };
  each_bin([&](std::size_t b, std::size_t) { ++first_of_bin_[b + 1]; });
  for (std::size_t b = 1; b < first_of_bin_.size(); ++b) first_of_bin_[b] += first_of_bin_[b - 1];
  binned_.resize(first_of_bin_.back());
  auto next = first_of_bin_;
  each_bin([&](std::size_t b, std::size_t i) { binned_[next[b]++] = i; });
}

std::size_t TrimLoops::bin(double height) const {
  const auto last = static_cast<double>(first_of_bin_.size()) - 2;
  return static_cast<std::size_t>(
      std::clamp((height - least_height_) * bins_per_height_, 0.0, last));
}

// Even-odd along a ray, which the area between a chord and its pcurve turns over.
bool TrimLoops::contains(const Vector2d& uv) const {
  if (chords_.empty()) return false;
  const Vector2d q = scaled(uv);
  bool is_odd = false;
  const std::size_t b = bin(q.y());
  for (std::size_t i = first_of_bin_[b]; i < first_of_bin_[b + 1]; ++i) {
    const Chord& chord = chords_[binned_[i]];
    const Vector2d from = scaled(chord.from) - q, to = scaled(chord.to) - q;
    if ((from.y() <= 0) != (to.y() <= 0))
      is_odd ^= from.x() - from.y() / (to.y() - from.y()) * (to.x() - from.x()) > 0;
    if (chord.bulge > 0) is_odd ^= is_between(chord, q);
  }
  return is_odd || (is_open_ && winding_angle(uv) > std::numbers::pi);
}

// Whether a point (scaled) lies between a chord and its pcurve: a graph over the chord, found by
// the method of false position.
bool TrimLoops::is_between(const Chord& chord, const Vector2d& at) const {
  const Vector2d from = scaled(chord.from), along = scaled(chord.to) - from;
  const double squared = along.squaredNorm();
  const double place = along.dot(at - from) / squared, height = cross(along, at - from) / squared;
  if (place <= 0 || place >= 1 || std::abs(height) > chord.bulge) return false;
  double low = 0, high = 1, below = -place, above = 1 - place, curve_height = 0;
  for (int i = 0; i < kIterations; ++i) {
    const double share = low - below * (high - low) / (above - below);
    const double t = chord.t_from + share * (chord.t_to - chord.t_from);
    const Vector2d p = scaled(pcurves_[chord.pcurve](t)) - from;
    const double off = along.dot(p) / squared - place;
    curve_height = cross(along, p) / squared;
    if (std::abs(off) < kStraight) break;
    if (off < 0) {
      low = share;
      below = off;
      above /= 2;  // Illinois
    } else {
      high = share;
      above = off;
      below /= 2;
    }
  }
  return height * curve_height > 0 && std::abs(height) < std::abs(curve_height);
}

// Angle that the chords wind round a point: 2 pi inside, 0 outside. Unlike ray crossings it bears
// gaps.
double TrimLoops::winding_angle(const Vector2d& uv) const {
  double winding = 0;
  for (const Chord& c : chords_) {
    const Vector2d a = c.from - uv, b = c.to - uv;
    winding += std::atan2(cross(a, b), a.dot(b));
  }
  return winding;
}

std::vector<double> TrimLoops::crossings(double v) const {
  std::vector<double> u;
  for (const Chord& c : chords_)
    if ((c.from.y() <= v) != (c.to.y() <= v))
      u.push_back(c.from.x() +
                  (v - c.from.y()) / (c.to.y() - c.from.y()) * (c.to.x() - c.from.x()));
  std::ranges::sort(u);
  return u;
}

}  // namespace cadmorph
