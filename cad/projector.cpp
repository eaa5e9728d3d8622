#include "cad/projector.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

namespace cadmorph {
namespace {

using Eigen::Matrix2d;
using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr int kMaxIterations = 40;  // of Newton's method, which takes a few where it converges
constexpr double kStepTolerance = 1e-14;  // of the model's diagonal: 45 times a double's rounding
constexpr double kSamePoint = 1e-10;  // of the diagonal: above the rounding of a foot near a pole
// Of the trimmed domain, beyond it: feet of points just outside of the wires are found, and a
// surface without a period is not extrapolated far.
constexpr double kDomainMargin = 0.1;
// Cells of 22 degrees where a face goes round: Newton's method starts near the foot.
constexpr int kSeedGrid = 16;
constexpr double kLengthMargin = 1.01;  // lengths come from a quadrature

Vector2d clamp_to_domain(const CadFace& face, const Vector2d& uv) {
  Vector2d clamped = uv;
  for (int a = 0; a < 2; ++a) {
    if (face.period[a] > 0) continue;
    const double margin = kDomainMargin * (face.upper[a] - face.lower[a]);
    clamped[a] = std::clamp(uv[a], face.lower[a] - margin, face.upper[a] + margin);
  }
  return clamped;
}

// Newton direction of |S - x|^2 / 2, Gauss-Newton where the Hessian is not positive definite.
Vector2d descent(const SurfaceCurvature& s, const Vector3d& r) {
  const Vector2d gradient(r.dot(s.first.du), r.dot(s.first.dv));
  Matrix2d gauss;
  gauss << s.first.du.squaredNorm(), s.first.du.dot(s.first.dv), s.first.du.dot(s.first.dv),
      s.first.dv.squaredNorm();
  Matrix2d hessian = gauss;
  hessian(0, 0) += r.dot(s.duu);
  hessian(0, 1) += r.dot(s.duv);
  hessian(1, 0) = hessian(0, 1);
  hessian(1, 1) += r.dot(s.dvv);
  const bool is_definite =
      hessian(0, 0) > 0 && hessian.determinant() > 1e-12 * hessian(0, 0) * hessian(1, 1);
  Matrix2d system = is_definite ? hessian : gauss;
  // At a pole one derivative vanishes: keep the other direction, leave this one alone.
  for (int a = 0; a < 2; ++a) system(a, a) += 1e-30 + 1e-15 * system.trace();
  return -system.inverse() * gradient;
}

// No point of an edge is farther from its nearer end than half its length.
double least_distance(const CadModel& model, EdgeId edge, const Vector3d& x) {
  const CadEdge& e = model.edges()[edge];
  double to_end = std::numeric_limits<double>::infinity();
  for (const VertexId end : {e.start, e.end}) {
    if (end < 0) return 0;
    const CadVertex& vertex = model.vertices()[end];
    to_end = std::min(to_end, (vertex.point - x).norm() - vertex.tolerance);
  }
  return std::max(0.0, to_end - kLengthMargin * e.length / 2);
}

EdgeFoot descend_on_edge(const CadModel& model, EdgeId edge, const Vector3d& x, double seed) {
  const CadEdge& e = model.edges()[edge];
  const double tolerance = kStepTolerance * model.diagonal();
  double t = std::clamp(seed, e.first, e.last);
  CurvePoint c = model.evaluate_edge(edge, t);
  double best = (c.point - x).squaredNorm();
  for (int i = 0; i < kMaxIterations; ++i) {
    const double speed = c.dt.squaredNorm();
    if (speed == 0) break;
    double step = -(c.point - x).dot(c.dt) / speed;  // Gauss-Newton: the residual is small
    bool is_better = false;
    double moved = 0;
    for (int halving = 0; halving < 12 && !is_better; ++halving, step *= 0.5) {
      const double trial = std::clamp(t + step, e.first, e.last);
      const CurvePoint at = model.evaluate_edge(edge, trial);
      const double squared = (at.point - x).squaredNorm();
      if (squared > best) continue;
      is_better = true;
      moved = std::abs(trial - t);
      t = trial;
      best = squared;
      c = at;
    }
    if (!is_better || moved * c.dt.norm() < tolerance) break;
  }
  return {edge, t, c.point, std::sqrt(best)};
}

FaceFoot descend_on_face(const CadModel& model, FaceId face, const Vector3d& x,
                         const Vector2d& seed) {
  const CadFace& f = model.faces()[face];
  const double tolerance = kStepTolerance * model.diagonal();
  Vector2d uv = model.into_domain(face, seed);
  SurfaceCurvature s = model.evaluate_second(face, uv);
  double best = (s.first.point - x).squaredNorm();
  for (int i = 0; i < kMaxIterations; ++i) {
    Vector2d step = descent(s, s.first.point - x);
    if (!step.allFinite()) break;
    const Vector2d reach = f.upper - f.lower;
    const double excess = (step.array().abs() / (0.25 * reach.array() + 1e-300)).maxCoeff();
    if (excess > 1) step /= excess;
    bool is_better = false;
    Vector2d moved = Vector2d::Zero();
    for (int halving = 0; halving < 12 && !is_better; ++halving, step *= 0.5) {
      // A closed surface need not be periodic: beyond its seam it would be extrapolated.
      const Vector2d beyond = clamp_to_domain(f, uv + step);
      const Vector2d trial = model.into_domain(face, beyond);
      const SurfaceCurvature at = model.evaluate_second(face, trial);
      const double squared = (at.first.point - x).squaredNorm();
      if (squared > best && halving < 11) continue;
      is_better = squared <= best;
      if (!is_better) break;
      moved = beyond - uv;
      uv = trial;
      best = squared;
      s = at;
    }
    if (!is_better ||
        std::abs(moved.x()) * s.first.du.norm() + std::abs(moved.y()) * s.first.dv.norm() <
            tolerance)
      break;
  }
  return {uv, s.first.point, std::sqrt(best)};
}

// Where parameters beyond a pole come back to on the other side of it.
std::optional<Vector2d> across_pole(const CadModel& model, FaceId face, const Vector2d& uv) {
  const CadFace& f = model.faces()[face];
  for (const int a : {0, 1}) {
    if (f.period[a] > 0 || (uv[a] >= f.lower[a] && uv[a] <= f.upper[a])) continue;
    const int round = 1 - a;
    const double half = (f.upper[round] - f.lower[round]) / 2;
    Vector2d pole = uv;
    pole[a] = uv[a] < f.lower[a] ? f.lower[a] : f.upper[a];
    const SurfacePoint at = model.evaluate(face, pole);
    if ((round == 0 ? at.du : at.dv).norm() * half > kStepTolerance * model.diagonal()) continue;
    Vector2d other = uv;
    other[a] = 2 * pole[a] - uv[a];
    other[round] += uv[round] < f.lower[round] + half ? half : -half;
    return other;
  }
  return std::nullopt;
}

}  // namespace

FaceFoot project_on_face(const CadModel& model, FaceId face, const Vector3d& x,
                         const Vector2d& seed) {
  const FaceFoot foot = descend_on_face(model, face, x, seed);
  const std::optional<Vector2d> across = across_pole(model, face, foot.uv);
  if (!across) return foot;
  // Beyond a pole lies the same point once more, but outside of the face.
  const FaceFoot other = descend_on_face(model, face, x, *across);
  const double tolerance = kSamePoint * model.diagonal();
  return other.distance <= foot.distance + tolerance ? other : foot;
}

FaceFoot project_globally(const CadModel& model, FaceId face, const Vector3d& x) {
  const CadFace& f = model.faces()[face];
  std::vector<std::pair<double, Vector2d>> seeds;
  for (int i = 0; i <= kSeedGrid; ++i)
    for (int j = 0; j <= kSeedGrid; ++j) {
      const Vector2d uv = f.lower + Vector2d(i, j).cwiseProduct(f.upper - f.lower) / kSeedGrid;
      seeds.emplace_back((model.evaluate(face, uv).point - x).squaredNorm(), uv);
    }
  const auto closer = [](const auto& a, const auto& b) { return a.first < b.first; };
  std::partial_sort(seeds.begin(), seeds.begin() + 4, seeds.end(), closer);
  FaceFoot best = project_on_face(model, face, x, seeds[0].second);
  for (int i = 1; i < 4; ++i) {
    const FaceFoot foot = project_on_face(model, face, x, seeds[i].second);
    if (foot.distance < best.distance) best = foot;
  }
  return best;
}

double distance_to_trimmed(const CadModel& model, FaceId face, const Vector2d& uv) {
  if (model.is_inside(face, uv)) return 0;
  const Vector3d x = model.evaluate(face, uv).point;
  std::vector<std::pair<double, EdgeId>> edges;  // with what they are away at least
  for (const auto& wire : model.faces()[face].wires)
    for (const CoedgeId c : wire) {
      const EdgeId edge = model.coedges()[c].edge;
      edges.emplace_back(least_distance(model, edge, x), edge);
    }
  std::ranges::sort(edges);
  double least = std::numeric_limits<double>::infinity();
  for (const auto& [at_least, edge] : edges) {
    if (at_least >= least) break;
    const CadEdge& e = model.edges()[edge];
    double nearest = std::numeric_limits<double>::infinity(), seed = e.first;
    for (int i = 0; i <= kSeedGrid; ++i) {
      const double t = e.first + (e.last - e.first) * i / kSeedGrid;
      const double squared = (model.evaluate_edge(edge, t).point - x).squaredNorm();
      if (squared < nearest) nearest = squared, seed = t;
    }
    least = std::min(least, project_on_edge(model, edge, x, seed).distance);
  }
  return least;
}

EdgeFoot project_on_edge(const CadModel& model, EdgeId edge, const Vector3d& x, double seed) {
  const CadEdge& e = model.edges()[edge];
  const EdgeFoot foot = descend_on_edge(model, edge, x, seed);
  if (e.start != e.end || (foot.t > e.first && foot.t < e.last)) return foot;
  // The ends of a closed edge are one point: the foot may lie beyond, at the other end.
  const EdgeFoot other = descend_on_edge(model, edge, x, foot.t == e.first ? e.last : e.first);
  return other.distance < foot.distance ? other : foot;
}

}  // namespace cadmorph
