#include "surface/face_progress.h"

#include <algorithm>
#include <cmath>

namespace cadmorph {
namespace {

// Of a link: a whole circle has chords of 11 degrees, which are 0.2 % short, along its parameter.
constexpr int kSamples = 32;
// Of the span: pcurves meet at joints within their tolerance. With half or twice of this, or of
// kSamples, 14 pairs come out the same.
constexpr double kGap = 1e-3;
constexpr double kRound = 1e-6;  // of the period: ten times what files keep of whole turns

}  // namespace

std::vector<EdgeId> seams(const CadModel& model, FaceId face) {
  std::vector<EdgeId> result;
  for (const auto& wire : model.faces()[face].wires)
    for (const CoedgeId coedge : wire)
      if (const EdgeId edge = model.coedges()[coedge].edge; model.edges()[edge].is_seam)
        result.push_back(edge);
  return result;
}

std::optional<FaceProgress> FaceProgress::along(const CadModel& model, const CadCurve& curve,
                                                FaceId face, int parameter) {
  FaceProgress progress(model, face, parameter);
  if (!progress.chain(curve) || !progress.runs_one_way()) return std::nullopt;
  return progress;
}

bool FaceProgress::chain(const CadCurve& curve) {
  is_closed_ = curve.is_closed();
  const double period = model_->faces()[face_].period[parameter_];
  std::vector<double> gaps;
  for (const CurveLink& link : curve.links) {
    const CadEdge& edge = model_->edges()[link.edge];
    CoedgeId coedge;
    for (const CoedgeId c : edge.coedges) {
      if (model_->coedges()[c].face != face_) continue;
      if (coedge >= 0) return false;  // both its sides
      coedge = c;
    }
    if (coedge < 0) return false;
    Link next{link.edge, coedge, edge.first, edge.last, 0};
    if (link.is_reversed) std::swap(next.first, next.last);
    if (!links_.empty()) {
      double gap = at(links_.back(), links_.back().last) - at(next, next.first);
      if (period > 0) next.shift = period * std::round(gap / period);
      gaps.push_back(std::abs(gap - next.shift));
    }
    links_.push_back(next);
  }
  start_ = at(links_.front(), links_.front().first);
  span_ = at(links_.back(), links_.back().last) - start_;
  if (is_closed_ && !(std::abs(std::abs(span_) - period) <= kRound * period)) return false;
  return span_ != 0 &&
         std::ranges::all_of(gaps, [&](double gap) { return gap <= kGap * std::abs(span_); });
}

bool FaceProgress::runs_one_way() {
  for (const Link& link : links_) {
    double value = at(link, link.first);
    Eigen::Vector3d point = model_->evaluate_edge(link.edge, link.first).point;
    for (int i = 1; i <= kSamples; ++i) {
      const auto t_at = [&](double s) {
        return link.first + s / kSamples * (link.last - link.first);
      };
      const double next = at(link, t_at(i));
      const Eigen::Vector3d there = model_->evaluate_edge(link.edge, t_at(i)).point;
      const SurfacePoint s = model_->evaluate(face_, model_->pcurve(link.coedge, t_at(i - 0.5)));
      const double step = (next - value) / span_ * std::abs(span_);
      const double along = step * (parameter_ == 0 ? s.du : s.dv).norm();
      const double length = (there - point).norm();
      if (!(step > 0 && length > 0)) return false;
      straightness_ = std::min(straightness_, along / length);
      value = next;
      point = there;
    }
  }
  return true;
}

double FaceProgress::at(const Link& link, double t) const {
  return model_->pcurve(link.coedge, t)[parameter_] + link.shift;
}

double FaceProgress::operator()(const CurveLocation& location) const {
  const auto link = std::ranges::find(links_, location.edge, &Link::edge);
  return (at(*link, location.t) - start_) / span_;
}

CurveLocation FaceProgress::locate(double progress) const {
  if (is_closed_) progress -= std::floor(progress);
  const double value = start_ + std::clamp(progress, 0.0, 1.0) * span_;
  for (const Link& link : links_)
    if (&link == &links_.back() || (at(link, link.last) - value) / span_ >= 0)
      return {link.edge, solve(link, value)};
  return {};
}

// The parameter of the edge at a value, by regula falsi (Illinois), which keeps a bracket.
double FaceProgress::solve(const Link& link, double value) const {
  double a = link.first, b = link.last;
  double below = (at(link, a) - value) / span_, above = (at(link, b) - value) / span_;
  if (below >= 0) return a;
  if (above <= 0) return b;
  int side = 0;
  for (int i = 0; i < 100; ++i) {
    const double t = a + (b - a) * (below / (below - above));
    const double miss = (at(link, t) - value) / span_;
    if (miss == 0 || t == a || t == b) return t;
    if (miss < 0) {
      a = t;
      below = miss;
      if (side == -1) above /= 2;
      side = -1;
    } else {
      b = t;
      above = miss;
      if (side == 1) below /= 2;
      side = 1;
    }
  }
  return a + (b - a) * (below / (below - above));
}

std::optional<CurveLocation> FaceProgress::seam() const {
  const std::vector<EdgeId> seam_edges = seams(*model_, face_);
  std::optional<CurveLocation> found;
  for (const Link& link : links_) {
    const CadEdge& edge = model_->edges()[link.edge];
    const VertexId vertex = link.first == edge.first ? edge.start : edge.end;
    const bool is_seam_end = std::ranges::any_of(seam_edges, [&](EdgeId seam) {
      return model_->edges()[seam].start == vertex || model_->edges()[seam].end == vertex;
    });
    if (!is_seam_end) continue;
    if (found) return std::nullopt;
    found = CurveLocation{link.edge, link.first};
  }
  return found;
}

}  // namespace cadmorph
