#include "surface/face_domain.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include "cad/face_sampler.h"
#include "cad/projector.h"
#include "core/kd_tree.h"
#include "core/least_squares.h"
#include "core/rbf/anchors.h"

namespace cadmorph {
namespace {

using Eigen::Vector2d;

// Samples that all wires of a face may have together: kMostSamples, a dense solve of a tenth of a
// second, or kMostCurves times as many as one curve, which is more where a fold asks for finer
// ones. Where these are too few, half are shared out equally among the curves, half by length. A
// curve has 6 at least, down to 2 on a face with thousands of them. With 3 or 12 for 6, 14 pairs
// come out the same.
constexpr double kMostSamples = 1500, kMostCurves = 7.5;
constexpr double kLeastSamples = 2, kFewSamples = 6;
constexpr double kLinear = 1e-10;     // of the domain: rounding of parameters
constexpr double kSameJoint = 1e-2;   // of the domain: gaps that pcurves leave at a vertex
constexpr double kSameSample = 1e-6;  // of the size of the domain: nearer, the system is singular
// Of the distance to the nearest node that is asked for: samples closer to each other than this are
// one to it. Where a short edge grows many times over, they would ask for a slope that the warp
// carries on far into the face. With half or twice of it 11 of 14 pairs come out the same, others
// to 3e-5 of the smallest scaled Jacobian.
constexpr double kUnresolved = 0.02;

// Of a pcurve's deviation: a foot is that much nearer at least. With half or twice of it 14 pairs
// come out the same.
constexpr double kFoot = 0.5;

// Samples along each of a face's coedges: long ones among many short ones, such as a rim among
// holes, get more.
auto sample_counts(const CadModel& base, FaceId face, int samples_per_curve) {
  double coedges = 0, length = 0;
  for (const auto& wire : base.faces()[face].wires)
    for (const CoedgeId c : wire) {
      ++coedges;
      length += base.edges()[base.coedges()[c].edge].length;
    }
  const double budget = std::max(kMostSamples, kMostCurves * samples_per_curve);
  const double least = std::clamp(4 * budget / std::max(coedges, 1.0), kLeastSamples, kFewSamples);
  return [=, &base](CoedgeId coedge) {
    if (coedges * samples_per_curve <= budget) return samples_per_curve;
    const double part = base.edges()[base.coedges()[coedge].edge].length / length;
    const double wanted = budget / 2 * (1 / coedges + part);
    return static_cast<int>(std::max(least, std::min<double>(samples_per_curve, wanted)));
  };
}

}  // namespace

Vector2d mean_derivatives(const CadModel& model, FaceId face) {
  auto uv = sample_domain(model, face, 6);
  const CadFace& f = model.faces()[face];
  if (uv.empty()) uv.push_back(0.5 * (f.lower + f.upper));
  Vector2d sum = Vector2d::Zero();
  for (const Vector2d& at : uv) {
    const SurfacePoint s = model.evaluate(face, at);
    sum += Vector2d(s.du.norm(), s.dv.norm());
  }
  return (sum / static_cast<double>(uv.size())).cwiseMax(1e-12);
}

Vector2d wire_parameters(const CadModel& model, CoedgeId coedge, double t) {
  return wire_parameters(model, coedge, t, model.edges()[model.coedges()[coedge].edge].tolerance);
}

Vector2d wire_parameters(const CadModel& model, CoedgeId coedge, double t, double tolerance) {
  const CadCoedge& c = model.coedges()[coedge];
  const CadEdge& edge = model.edges()[c.edge];
  const Vector2d uv = model.pcurve(coedge, t);
  if (edge.is_degenerate) return uv;
  const Eigen::Vector3d x = model.evaluate_edge(c.edge, t).point;
  const double off = (model.evaluate(c.face, uv).point - x).norm();
  if (off <= tolerance) return uv;
  const FaceFoot foot = project_on_face(model, c.face, x, uv);
  if (foot.distance > kFoot * off) return uv;
  const Vector2d period = model.faces()[c.face].period;
  Vector2d moved = foot.uv - uv;
  for (int a = 0; a < 2; ++a)
    if (period[a] > 0) moved[a] -= period[a] * std::round(moved[a] / period[a]);
  return uv + moved;
}

bool fills_gap(const CadModel& model, CoedgeId coedge) {
  const CadCoedge& c = model.coedges()[coedge];
  const CadEdge& edge = model.edges()[c.edge];
  const CadFace& face = model.faces()[c.face];
  const Vector2d span = model.pcurve(coedge, edge.last) - model.pcurve(coedge, edge.first);
  return edge.is_degenerate &&
         (span.array().abs() < kSameJoint * (face.upper - face.lower).array()).all();
}

FaceDomain::FaceDomain(const CadModel& base, FaceId face, int samples_per_curve,
                       const Parameters& joints, const Parameters& asked)
    : face_(face), scale_(mean_derivatives(base, face)), period_(base.faces()[face].period) {
  const CadFace& f = base.faces()[face];
  size_ = f.upper - f.lower;
  const auto sample_count = sample_counts(base, face, samples_per_curve);
  std::vector<std::pair<int, Vector2d>> ends;  // vertex and place of the wires' joints
  const auto is_new_end = [&](VertexId vertex, const Vector2d& uv) {
    for (const auto& [other, at] : ends) {
      Vector2d gap = at - uv;
      for (int a = 0; a < 2; ++a)
        if (period_[a] > 0) gap[a] -= period_[a] * std::round(gap[a] / period_[a]);
      if (other == vertex && (gap.array().abs() <= kSameJoint * size_.array()).all()) return false;
    }
    ends.emplace_back(vertex, uv);
    return true;
  };
  for (const auto& wire : f.wires)
    for (const CoedgeId c : wire) {
      const CadEdge& edge = base.edges()[base.coedges()[c].edge];
      if (edge.is_seam || fills_gap(base, c)) continue;
      const int count = sample_count(c);
      for (int i = 0; i <= count; ++i) {
        const double t = edge.first + (edge.last - edge.first) * i / count;
        const Vector2d uv = wire_parameters(base, c, t);
        const bool is_end = i == 0 || i == count;
        if (!is_end || is_new_end(i == 0 ? edge.start : edge.end, uv))
          samples_.push_back({c, t, uv, edge.tolerance});
      }
    }
  for (Index i = 0; i < joints.rows(); ++i)
    samples_.push_back({CoedgeId(), 0, joints.row(i), f.tolerance, static_cast<int>(i)});
  thin_out(asked);
  sample_uv_.resize(static_cast<Index>(samples_.size()), 2);
  for (std::size_t i = 0; i < samples_.size(); ++i)
    sample_uv_.row(static_cast<Index>(i)) = samples_[i].uv;
}

// Samples that nearly coincide, of edges far shorter than the face or on both sides of a slit,
// would make the system singular to rounding. Those nearest to a node that is asked for come first;
// of equals the first in the wires.
void FaceDomain::thin_out(const Parameters& asked) {
  if (samples_.empty()) return;
  Parameters uv(static_cast<Index>(samples_.size()), 2);
  for (Index i = 0; i < uv.rows(); ++i) uv.row(i) = samples_[static_cast<std::size_t>(i)].uv;
  const RowMatrix at = embed(uv);
  const KdTree tree(at);
  Eigen::VectorXd reach =
      Eigen::VectorXd::Constant(at.rows(), kSameSample * scale_.cwiseProduct(size_).norm());
  std::vector<Index> order(samples_.size());
  std::iota(order.begin(), order.end(), Index{0});
  if (asked.rows() > 0) {
    const KdTree nodes(embed(asked));
    for (Index i = 0; i < at.rows(); ++i)
      reach[i] =
          std::max(reach[i],
                   kUnresolved * std::sqrt(nodes.nearest(at.row(i).data(), 1)[0].squared_distance));
    std::ranges::stable_sort(order, {}, [&](Index i) { return reach[i]; });
  }
  std::vector<char> is_kept(samples_.size(), 0);
  for (const Index i : order) {
    const auto near = tree.within(at.row(i).data(), reach[i]);
    is_kept[i] = std::ranges::none_of(near, [&](const Neighbour& n) { return is_kept[n.index]; });
  }
  std::vector<Sample> kept;
  for (std::size_t i = 0; i < samples_.size(); ++i)
    if (is_kept[i]) kept.push_back(samples_[i]);
  samples_ = std::move(kept);
}

// Scaled coordinates; a closed direction becomes a circle of its own length.
RowMatrix FaceDomain::embed(const Parameters& uv) const {
  const int columns = 2 + (period_[0] > 0) + (period_[1] > 0);
  RowMatrix x(uv.rows(), columns);
  int column = 0;
  for (int a = 0; a < 2; ++a) {
    if (period_[a] <= 0) {
      x.col(column++) = scale_[a] * uv.col(a);
      continue;
    }
    const double turn = 2 * std::numbers::pi / period_[a], radius = scale_[a] / turn;
    x.col(column++) = radius * (turn * uv.col(a)).array().cos();
    x.col(column++) = radius * (turn * uv.col(a)).array().sin();
  }
  return x;
}

// Of displacements, so that what a solution misses compares with the samples' distances.
Parameters FaceDomain::in_lengths(const Parameters& d) const { return d * scale_.asDiagonal(); }

Parameters FaceDomain::in_parameters(const Parameters& d) const {
  return d * scale_.cwiseInverse().asDiagonal();
}

bool FaceDomain::is_within_tolerance(const Parameters& misfit) const {
  for (Index i = 0; i < misfit.rows(); ++i)
    for (int a = 0; a < 2; ++a)
      if (std::abs(misfit(i, a)) > kLinear * size_[a] &&
          scale_[a] * std::abs(misfit(i, a)) > samples_[static_cast<std::size_t>(i)].tolerance)
        return false;
  return true;
}

// Constant and, in directions that are not closed, linear functions.
Eigen::MatrixXd FaceDomain::linear_basis(const Parameters& uv) const {
  Eigen::MatrixXd p = Eigen::MatrixXd::Ones(uv.rows(), 3);
  for (int a = 0; a < 2; ++a)
    if (period_[a] > 0)
      p.col(1 + a).setZero();
    else
      p.col(1 + a) = (uv.col(a).array() - sample_uv_(0, a)) / size_[a];
  return p;
}

Eigen::MatrixXd FaceDomain::fit_linear(const Parameters& values) const {
  return least_squares(linear_basis(sample_uv_), values);
}

Parameters FaceDomain::interpolate(const Parameters& values, const Parameters& at) const {
  if (values.rows() == 0 || is_within_tolerance(values)) return Parameters::Zero(at.rows(), 2);
  const Eigen::MatrixXd linear = fit_linear(values);
  if (is_within_tolerance(values - linear_basis(sample_uv_) * linear))
    return linear_basis(at) * linear;
  const RowMatrix lengths = in_lengths(values), points = embed(at);
  RowMatrix moved = interpolate_freely(lengths, points);
  if (overshoot(lengths, moved) > kMostOvershoot)
    moved = interpolate_bounded(embed(sample_uv_), lengths, Kernel::biharmonic_2d(), points);
  return in_parameters(moved);
}

// Of lengths at embedded points, however far it overshoots them.
RowMatrix FaceDomain::interpolate_freely(const RowMatrix& lengths, const RowMatrix& points) const {
  {
    const std::lock_guard lock(mutex_);
    if (!system_) system_ = std::make_unique<RbfSystem>(embed(sample_uv_), Kernel::biharmonic_2d());
  }
  return system_->solve(lengths).evaluate(points);
}

// The linear part comes first, in one step: half-way through a reversal the domain would be a
// point. A warp that overshoots the wires by far has none.
Parameters FaceDomain::interpolate_in_steps(const Parameters& values, const Parameters& at,
                                            int steps) const {
  if (values.rows() == 0) return interpolate(values, at);
  Eigen::MatrixXd linear = fit_linear(values);
  const RowMatrix lengths = in_lengths(values);
  if (overshoot(lengths, interpolate_freely(lengths, embed(at))) > kMostOvershoot) linear.setZero();
  const Parameters carried = linear_basis(sample_uv_) * linear;
  Parameters samples = sample_uv_ + carried, moved = at + linear_basis(at) * linear;
  const Parameters step = (values - carried) / steps;
  for (int k = 0; k < steps; ++k) {
    moved += in_parameters(interpolate_bounded(embed(samples), in_lengths(step),
                                               Kernel::biharmonic_2d(), embed(moved)));
    samples += step;
  }
  return moved - at;
}

}  // namespace cadmorph
