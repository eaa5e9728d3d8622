#include "cad/pcurve_repair.h"

#include <Eigen/Core>
#include <Geom2dAPI_Interpolate.hxx>
#include <Geom2d_BSplineCurve.hxx>
#include <Geom_Plane.hxx>
#include <TColStd_HArray1OfReal.hxx>
#include <TColgp_HArray1OfPnt2d.hxx>
#include <algorithm>
#include <array>
#include <cmath>

#include "core/least_squares.h"

namespace cadmorph {
namespace {

using Eigen::Matrix2d;
using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr std::array<double, 7> kProbes{0.03, 0.1, 0.25, 0.5,
                                        0.75, 0.9, 0.97};  // of an edge, denser at its ends
constexpr double kManyTolerances = 10;  // exporters state tolerances that are somewhat too small
// Of an edge's length: half of a sound pcurve's points are off by less than the first, a point of a
// wrong one by more than the second, where it takes another way.
constexpr double kOnEdge = 1e-4, kOffEdge = 1e-2;
// What replaces a pcurve is off by this part of it at most: a sound one by a hundredth of a wrong
// one (kOnEdge, kOffEdge).
constexpr double kBetter = 0.1;
// Of the period's length: above what files and B-splines leave where a surface closes (kSeamGap) or
// where it is a point (kNoPole), far below the period that it would be otherwise.
constexpr double kSeamGap = 1e-3;
constexpr double kNoPole = 1e-3;
// Of a pcurve that is made anew: the cubic spline follows a full circle to 1e-6 of its radius.
constexpr int kIntervals = 64;
constexpr double kNoChain = 1e300;
constexpr double kBlurred = 1e-4;  // of the domain: an end of a pcurve that a pole has blurred
// Of an edge, how far a blur reaches, tried by doubling. The parabola in place of it rests on
// points at up to three times as far: less than half of the edge, so that both ends may be blurred.
constexpr double kLeastBlur = 0.01, kMostBlur = 0.16;

class FaceRepair {
 public:
  FaceRepair(const CadModel::Impl& model, FaceId face, std::vector<std::vector<EdgeUse>>& wires)
      : model_(model), surface_(model.surfaces[face]), wires_(wires) {
    surface_->Bounds(low_[0], high_[0], low_[1], high_[1]);
    measure();
    period_ = model.natural_period[face];
  }

  void run() {
    for (auto& wire : wires_)
      for (EdgeUse& use : wire) put_on_edge(use);
    measure();
    find_periods();
    for (auto& wire : wires_) {
      if (!period_.isZero(0)) join(wire);
      sharpen_poles(wire);
    }
    if (period_.minCoeff() > 0 && signed_area() < 0) swap_seams();
  }

 private:
  struct Foot {
    Vector2d uv;
    double distance;
  };

  const CadEdge& edge(const EdgeUse& use) const { return model_.edges[use.edge]; }

  Vector3d point(const Vector2d& uv) const {
    const gp_Pnt p = surface_->Value(uv.x(), uv.y());
    return {p.X(), p.Y(), p.Z()};
  }

  Vector3d point(const EdgeUse& use, double t) const {
    if (edge(use).is_degenerate) return model_.vertices[edge(use).start].point;
    const gp_Pnt p = model_.curves[use.edge]->Value(t);
    return {p.X(), p.Y(), p.Z()};
  }

  double parameter(const EdgeUse& use, double fraction) const {
    return edge(use).first + fraction * (edge(use).last - edge(use).first);
  }

  Vector2d start(const EdgeUse& use) const {
    return use.pcurve(use.is_reversed ? edge(use).last : edge(use).first);
  }

  Vector2d end(const EdgeUse& use) const {
    return use.pcurve(use.is_reversed ? edge(use).first : edge(use).last);
  }

  void measure() {
    Vector2d lower = Vector2d::Constant(1e300), upper = -lower;
    for (const auto& wire : wires_)
      for (const EdgeUse& use : wire)
        for (int i = 0; i <= 4; ++i) {
          const Vector2d uv = use.pcurve(parameter(use, 0.25 * i));
          lower = lower.cwiseMin(uv);
          upper = upper.cwiseMax(uv);
        }
    middle_ = 0.5 * (lower + upper);
    size_ = upper - lower;
  }

  // Gauss-Newton: the points lie on the surface, or nearly so.
  Foot project(const Vector3d& x, Vector2d uv) const {
    Foot best{uv, (point(uv) - x).norm()};
    for (int i = 0; i < 20; ++i) {
      gp_Pnt p;
      gp_Vec du, dv;
      surface_->D1(uv.x(), uv.y(), p, du, dv);
      Eigen::Matrix<double, 3, 2> j;
      j << du.X(), dv.X(), du.Y(), dv.Y(), du.Z(), dv.Z();
      const Vector3d r = x - Vector3d(p.X(), p.Y(), p.Z());
      const Vector2d step = small_least_squares(j, r);
      if (!step.allFinite()) break;
      uv += step;
      for (int a = 0; a < 2; ++a)
        if (period_[a] <= 0) uv[a] = std::clamp(uv[a], low_[a], high_[a]);
      const double distance = (point(uv) - x).norm();
      if (distance >= best.distance) break;
      best = {uv, distance};
    }
    return best;
  }

  std::array<double, kProbes.size()> deviations(const EdgeUse& use) const {
    std::array<double, kProbes.size()> off{};
    for (std::size_t i = 0; i < kProbes.size(); ++i) {
      const double t = parameter(use, kProbes[i]);
      off[i] = (point(use.pcurve(t)) - point(use, t)).norm();
    }
    std::sort(off.begin(), off.end());
    return off;
  }

  double deviation(const EdgeUse& use) const { return deviations(use).back(); }

  // A pcurve that leaves its edge and comes back is made anew, from where it is nearest. One that
  // is off all along is what the exporter meant.
  void put_on_edge(EdgeUse& use) const {
    if (edge(use).is_degenerate) return;
    const auto all = deviations(use);
    const double room = kManyTolerances * edge(use).tolerance, length = edge(use).length;
    const double off = all.back(), common = all[kProbes.size() / 2];
    if (common > std::max(room, kOnEdge * length) || off <= std::max(room, kOffEdge * length))
      return;
    EdgeUse other = use;
    other.pcurve.curve = projected(use);
    other.pcurve.first = edge(use).first;
    other.pcurve.last = edge(use).last;
    if (!other.pcurve.curve.IsNull() && deviation(other) < kBetter * off) use = other;
  }

  Handle(Geom2d_Curve) projected(const EdgeUse& use) const {
    const auto fraction = [](int i) { return static_cast<double>(i) / kIntervals; };
    int seed = 0;
    double least = 1e300;
    for (int i = 1; i < kIntervals; ++i) {
      const double t = parameter(use, fraction(i));
      const double off = (point(use.pcurve(t)) - point(use, t)).norm();
      if (off < least) {
        least = off;
        seed = i;
      }
    }
    const Handle(TColgp_HArray1OfPnt2d) points = new TColgp_HArray1OfPnt2d(1, kIntervals + 1);
    const Handle(TColStd_HArray1OfReal) parameters = new TColStd_HArray1OfReal(1, kIntervals + 1);
    std::vector<Vector2d> uv(kIntervals + 1);
    uv[seed] = use.pcurve(parameter(use, fraction(seed)));
    const auto follow = [&](int i, int from) {
      uv[i] = project(point(use, parameter(use, fraction(i))), uv[from]).uv;
    };
    follow(seed, seed);
    for (int i = seed + 1; i <= kIntervals; ++i) follow(i, i - 1);
    for (int i = seed - 1; i >= 0; --i) follow(i, i + 1);
    for (int i = 0; i <= kIntervals; ++i) {
      points->SetValue(i + 1, gp_Pnt2d(uv[i].x(), uv[i].y()));
      parameters->SetValue(i + 1, parameter(use, fraction(i)));
      if (i > 0 && (uv[i] - uv[i - 1]).isZero(0)) return nullptr;
    }
    Geom2dAPI_Interpolate interpolation(points, parameters, false, 1e-12);
    interpolation.Perform();
    if (!interpolation.IsDone()) return nullptr;
    return Handle(Geom2d_Curve)(interpolation.Curve());
  }

  // A surface that isn't periodic closes where the two pcurves of a seam stand apart, or where its
  // other side has the points of the seam, too.
  void find_periods() {
    for (const auto& wire : wires_)
      for (std::size_t i = 0; i < wire.size(); ++i)
        for (std::size_t j = i + 1; j < wire.size(); ++j)
          if (wire[i].edge == wire[j].edge && wire[i].is_reversed != wire[j].is_reversed &&
              edge(wire[i]).is_seam)
            find_period(wire[i], wire[j]);
  }

  void find_period(const EdgeUse& one, const EdgeUse& two) {
    const double t = parameter(one, 0.5);
    const Vector2d at = one.pcurve(t), gap = (two.pcurve(t) - at).cwiseAbs();
    const Vector3d x = point(one, t);
    for (int a = 0; a < 2; ++a) {
      if (period_[a] > 0) continue;
      if (gap[a] > 0.5 * size_[a]) {
        period_[a] = gap[a];
        continue;
      }
      for (const double way : {1.0, -1.0}) {
        Vector2d seed = at;
        seed[a] = std::clamp(at[a] + way * size_[a], low_[a], high_[a]);
        if (std::abs(seed[a] - at[a]) < 0.5 * size_[a]) continue;
        const Foot foot = project(x, seed);
        const Vector2d moved = (foot.uv - at).cwiseAbs();
        if (moved[a] > 0.5 * size_[a] && moved[1 - a] < 0.1 * size_[1 - a] &&
            foot.distance <
                std::max(kManyTolerances * edge(one).tolerance, kSeamGap * length_along(a)))
          period_[a] = moved[a];
      }
    }
  }

  // Of the longest of some iso-parametric lines.
  double length_along(int axis) const {
    double most = 0;
    for (const double s : {-0.45, 0.0, 0.45}) {
      Vector2d uv = middle_;
      uv[1 - axis] += s * size_[1 - axis];
      gp_Pnt p;
      gp_Vec du, dv;
      surface_->D1(uv.x(), uv.y(), p, du, dv);
      most = std::max(most, (axis == 0 ? du : dv).Magnitude());
    }
    return most * (period_[axis] > 0 ? period_[axis] : size_[axis]);
  }

  // An edge of no length that spans a period although the surface is no point there.
  bool is_spurious(const EdgeUse& use) const {
    if (!edge(use).is_degenerate) return false;
    const Vector2d span = (end(use) - start(use)).cwiseAbs();
    for (int a = 0; a < 2; ++a) {
      if (period_[a] <= 0 || span[a] < 0.5 * period_[a]) continue;
      if (deviation(use) >
          std::max(kManyTolerances * edge(use).tolerance, kNoPole * length_along(a)))
        return true;
    }
    return false;
  }

  // The uses of a wire one after the other: files list them so, or the other way round. Empty when
  // they are no chain.
  std::vector<EdgeUse*> chain(std::vector<EdgeUse>& wire) const {
    std::vector<EdgeUse*> forward;
    for (EdgeUse& use : wire) forward.push_back(&use);
    const std::vector<EdgeUse*> backward(forward.rbegin(), forward.rend());
    const double gap = joint_gaps(forward), other_gap = joint_gaps(backward);
    if (std::min(gap, other_gap) == kNoChain) return {};
    return gap <= other_gap ? forward : backward;
  }

  // Sum of the gaps at the joints of a chain, whole periods left out, in parts of the domain.
  double joint_gaps(const std::vector<EdgeUse*>& uses) const {
    double sum = 0;
    for (std::size_t i = 0; i < uses.size(); ++i) {
      const EdgeUse &a = *uses[i], &b = *uses[(i + 1) % uses.size()];
      const VertexId from = a.is_reversed ? edge(a).start : edge(a).end;
      const VertexId to = b.is_reversed ? edge(b).end : edge(b).start;
      if (from != to) return kNoChain;
      const Vector2d gap = end(a) - start(b);
      sum += (gap - periods_to(gap)).cwiseQuotient(size_).norm();
    }
    return sum;
  }

  // Shifts the pieces of a wire by periods until they meet.
  void join(std::vector<EdgeUse>& wire) const {
    std::vector<EdgeUse> joined = wire;
    std::erase_if(joined, [&](const EdgeUse& use) { return is_spurious(use); });
    bool is_changed = joined.size() < wire.size();
    const std::vector<EdgeUse*> uses = chain(joined);
    for (std::size_t i = 1; i < uses.size(); ++i) {
      const Vector2d shift = periods_to(end(*uses[i - 1]) - start(*uses[i]));
      is_changed |= !shift.isZero(0);
      uses[i]->pcurve.shift += shift;
    }
    if (!is_changed || uses.empty()) return;
    into_bounds(joined);
    wire = std::move(joined);
  }

  Vector2d periods_to(const Vector2d& gap) const {
    Vector2d shift = Vector2d::Zero();
    for (int a = 0; a < 2; ++a)
      if (period_[a] > 0) shift[a] = period_[a] * std::round(gap[a] / period_[a]);
    return shift;
  }

  void into_bounds(std::vector<EdgeUse>& wire) const {
    Vector2d lower = Vector2d::Constant(1e300), upper = -lower;
    for (const EdgeUse& use : wire)
      for (const Vector2d& uv : {start(use), end(use)}) {
        lower = lower.cwiseMin(uv);
        upper = upper.cwiseMax(uv);
      }
    const Vector2d shift = periods_to(0.5 * (low_ + high_) - 0.5 * (lower + upper));
    for (EdgeUse& use : wire) use.pcurve.shift += shift;
  }

  // Of the part of the domain to the left of the wires.
  double signed_area() const {
    double area = 0;
    for (const auto& wire : wires_)
      for (const EdgeUse& use : wire) {
        constexpr int n = 16;  // chords: only the sign of the area counts
        for (int i = 0; i < n; ++i) {
          const Vector2d a = use.pcurve(parameter(use, static_cast<double>(i) / n)) - middle_,
                         b = use.pcurve(parameter(use, (i + 1.0) / n)) - middle_;
          area += (use.is_reversed ? -0.5 : 0.5) * (a.x() * b.y() - a.y() * b.x());
        }
      }
    return area;
  }

  // Where a face closes both ways, nothing but the sense of its wires tells which use of a seam
  // lies on which side.
  void swap_seams() {
    for (auto& wire : wires_)
      for (std::size_t i = 0; i < wire.size(); ++i)
        for (std::size_t j = i + 1; j < wire.size(); ++j)
          if (wire[i].edge == wire[j].edge && wire[i].is_reversed != wire[j].is_reversed &&
              edge(wire[i]).is_seam)
            std::swap(wire[i].pcurve, wire[j].pcurve);
  }

  // At a pole a projection finds any parameter. The edges on both sides tell the right one by
  // where they come from.
  void sharpen_poles(std::vector<EdgeUse>& wire) const {
    const std::vector<EdgeUse*> uses = chain(wire);
    const std::size_t n = uses.size();
    for (std::size_t i = 0; n > 2 && i < n; ++i) {
      EdgeUse &pole = *uses[i], &before = *uses[(i + n - 1) % n], &after = *uses[(i + 1) % n];
      if (!edge(pole).is_degenerate || edge(before).is_degenerate || edge(after).is_degenerate)
        continue;
      const Vector2d span = (end(pole) - start(pole)).cwiseAbs().cwiseQuotient(size_);
      const int axis = span[0] > span[1] ? 0 : 1;
      if (span[axis] < 0.1) continue;
      const bool is_before = sharpen(before, axis, !before.is_reversed);
      const bool is_after = sharpen(after, axis, after.is_reversed);
      if (is_before || is_after) lay_pole(pole, end(before), start(after));
    }
  }

  // Returns whether there was need.
  bool sharpen(EdgeUse& use, int axis, bool is_at_last) const {
    Pcurve sharp = use.pcurve;
    if (sharp.pole_axis < 0) {
      sharp.sound_first = sharp.first;
      sharp.sound_last = sharp.last;
    }
    sharp.pole_axis = axis;
    double& sound = is_at_last ? sharp.sound_last : sharp.sound_first;
    const double at = is_at_last ? sharp.last : sharp.first;
    const double far = is_at_last ? sharp.first : sharp.last;
    const auto told_from = [&](double part) {
      return sharp.parabola(at + part * (far - at), at, at);
    };
    const double limit = kBlurred * size_[axis];
    double part = kLeastBlur;
    while (part < kMostBlur && std::abs(told_from(part) - told_from(2 * part)) > limit) part *= 2;
    if (part >= kMostBlur || std::abs(told_from(part) - sharp.at(at)[axis]) <= limit) return false;
    sound = at + 2 * part * (far - at);  // ripples reach further than the blur itself
    use.pcurve = sharp;
    return true;
  }

  void lay_pole(EdgeUse& pole, Vector2d from, Vector2d to) const {
    if (pole.is_reversed) std::swap(from, to);
    const Handle(TColgp_HArray1OfPnt2d) points = new TColgp_HArray1OfPnt2d(1, 2);
    points->SetValue(1, gp_Pnt2d(from.x(), from.y()));
    points->SetValue(2, gp_Pnt2d(to.x(), to.y()));
    const Handle(TColStd_HArray1OfReal) parameters = new TColStd_HArray1OfReal(1, 2);
    parameters->SetValue(1, pole.pcurve.first);
    parameters->SetValue(2, pole.pcurve.last);
    Geom2dAPI_Interpolate line(points, parameters, false, 1e-12);
    line.Perform();
    if (!line.IsDone()) return;
    pole.pcurve.curve = line.Curve();
    pole.pcurve.shift.setZero();
  }

  const CadModel::Impl& model_;
  const Handle(Geom_Surface) surface_;
  std::vector<std::vector<EdgeUse>>& wires_;
  Vector2d low_, high_;     // bounds of the surface
  Vector2d middle_, size_;  // of the trimmed domain
  Vector2d period_ = Vector2d::Zero();
};

}  // namespace

void repair_pcurves(const CadModel::Impl& model, FaceId face,
                    std::vector<std::vector<EdgeUse>>& wires) {
  if (Handle(Geom_Plane)::DownCast(model.surfaces[face]).IsNull() && !wires.empty())
    FaceRepair(model, face, wires).run();
}

}  // namespace cadmorph
