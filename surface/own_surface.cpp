#include "surface/own_surface.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <unsupported/Eigen/LevenbergMarquardt>

#include "core/least_squares.h"

namespace cadmorph {
namespace {

using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

// Part of a triangle's sides within which a point is on them: above rounding.
constexpr double kOnEdge = 1e-12;

// A cone that widens by less than the tolerance over its length is a cylinder. Only its name
// depends on this.
constexpr double kLeastGrowth = 1e-9;

std::vector<RowId> corners_of(const SurfaceMesh& surface, const std::vector<FacetId>& facets) {
  std::vector<RowId> nodes;
  for (const FacetId f : facets)
    nodes.insert(nodes.end(), surface.facets[f].begin(),
                 surface.facets[f].begin() + surface.corners[f]);
  std::ranges::sort(nodes);
  nodes.erase(std::unique(nodes.begin(), nodes.end()), nodes.end());
  return nodes;
}

// The sphere of least algebraic distance: |x|^2 = 2 centre x + rest.
std::pair<Vector3d, double> fit_sphere(const Points& points) {
  const Vector3d mean = points.colwise().mean();
  const Points x = points.rowwise() - mean.transpose();
  MatrixXd a(x.rows(), 4);
  a << 2 * x, VectorXd::Ones(x.rows());
  const Eigen::Vector4d s = least_squares(a, x.rowwise().squaredNorm());
  const Vector3d centre = s.head<3>();
  return {mean + centre, std::sqrt(std::max(s[3] + centre.squaredNorm(), 0.0))};
}

// A cone round an axis near e3 of a frame: its axis passes the plane of e1 and e2 at (a, b), its
// direction is (u, v, 1), its radius r + g times the way along.
struct ConeMisfit : Eigen::DenseFunctor<double> {
  ConeMisfit(const Points& points, const Matrix3d& frame)
      : DenseFunctor(6, static_cast<int>(points.rows())), local(points * frame) {}

  int operator()(const VectorXd& p, VectorXd& misfit) const {
    const Vector3d origin(p[0], p[1], 0), axis = Vector3d(p[2], p[3], 1).normalized();
    for (Index i = 0; i < local.rows(); ++i) {
      const Vector3d x = local.row(i).transpose() - origin;
      const double along = x.dot(axis);
      misfit[i] = ((x - along * axis).norm() - p[4] - p[5] * along) / std::hypot(1, p[5]);
    }
    return 0;
  }

  int df(const VectorXd& p, MatrixXd& slope) const {
    const Vector3d origin(p[0], p[1], 0), axis = Vector3d(p[2], p[3], 1).normalized();
    const double stretch = std::hypot(1, p[5]);
    const Matrix3d turn = (Matrix3d::Identity() - axis * axis.transpose()) * axis[2];
    for (Index i = 0; i < local.rows(); ++i) {
      const Vector3d x = local.row(i).transpose() - origin;
      const double along = x.dot(axis), away = (x - along * axis).norm();
      const Vector3d by_origin = p[5] * axis - (x - along * axis) / away;
      const Vector3d by_axis = -(along / away + p[5]) * (turn * x);
      const double misfit = (away - p[4] - p[5] * along) / stretch;
      slope.row(i) << by_origin[0], by_origin[1], by_axis[0], by_axis[1], -1,
          -along - misfit * p[5] / stretch;
      slope.row(i) /= stretch;
    }
    return 0;
  }

  Points local;
};

// Normals of a cone lie on a circle about its axis.
Vector3d axis_of_normals(const SurfaceMesh& surface, const std::vector<FacetId>& facets) {
  Points normals(facets.size(), 3);
  for (std::size_t i = 0; i < facets.size(); ++i)
    normals.row(static_cast<Index>(i)) =
        area_vector(surface, surface.points, facets[i]).normalized();
  const Points off = normals.rowwise() - normals.colwise().mean();
  return Eigen::SelfAdjointEigenSolver<Matrix3d>(off.transpose() * off).eigenvectors().col(0);
}

double root_or_0(double square) { return std::sqrt(std::max(square, 0.0)); }

// x^2 + y^2 = 2 a x + 2 b y + c + e z + f z^2 about an axis along e3.
VectorXd first_cone(const Points& local) {
  MatrixXd m(local.rows(), 5);
  m << 2 * local.leftCols<2>(), VectorXd::Ones(local.rows()), local.col(2),
      local.col(2).cwiseAbs2();
  const VectorXd s = least_squares(m, local.leftCols<2>().rowwise().squaredNorm());
  VectorXd p(6);
  p << s[0], s[1], 0, 0, root_or_0(s[2] + s[0] * s[0] + s[1] * s[1]),
      std::copysign(root_or_0(s[4]), s[3]);
  return p;
}

struct ConeFit {
  Vector3d origin, axis;
  double radius, growth, misfit;
};

ConeFit fit_cone(const SurfaceMesh& surface, const std::vector<FacetId>& facets,
                 const Points& points) {
  const Vector3d mean = points.colwise().mean();
  Matrix3d frame;
  frame.col(2) = axis_of_normals(surface, facets);
  frame.col(0) = frame.col(2).unitOrthogonal();
  frame.col(1) = frame.col(2).cross(frame.col(0));
  ConeMisfit misfit(points.rowwise() - mean.transpose(), frame);
  VectorXd p = first_cone(misfit.local);
  Eigen::LevenbergMarquardt<decltype(misfit)> solver(misfit);
  solver.setFtol(std::numeric_limits<double>::epsilon());
  solver.setXtol(std::numeric_limits<double>::epsilon());
  solver.minimize(p);
  return {mean + frame * Vector3d(p[0], p[1], 0), frame * Vector3d(p[2], p[3], 1).normalized(),
          p[4], p[5], solver.fvec().cwiseAbs().maxCoeff()};
}

// The point of a triangle nearest to x (Ericson, Real-Time Collision Detection, sect. 5.1.5), by
// its weights at the corners.
Vector3d nearest_on_triangle(const Vector3d& a, const Vector3d& b, const Vector3d& c,
                             const Vector3d& x) {
  const Vector3d ab = b - a, ac = c - a, ax = x - a, bx = x - b, cx = x - c;
  const double d1 = ab.dot(ax), d2 = ac.dot(ax), d3 = ab.dot(bx), d4 = ac.dot(bx), d5 = ab.dot(cx),
               d6 = ac.dot(cx);
  if (d1 <= 0 && d2 <= 0) return {1, 0, 0};
  if (d3 >= 0 && d4 <= d3) return {0, 1, 0};
  if (d6 >= 0 && d5 <= d6) return {0, 0, 1};
  const double vc = d1 * d4 - d3 * d2, vb = d5 * d2 - d1 * d6, va = d3 * d6 - d5 * d4;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) return {1 - d1 / (d1 - d3), d1 / (d1 - d3), 0};
  if (vb <= 0 && d2 >= 0 && d6 <= 0) return {1 - d2 / (d2 - d6), 0, d2 / (d2 - d6)};
  if (va <= 0 && d4 >= d3 && d5 >= d6) {
    const double w = (d4 - d3) / ((d4 - d3) + (d5 - d6));
    return {0, 1 - w, w};
  }
  return Vector3d(va, vb, vc) / (va + vb + vc);
}

}  // namespace

OwnSurface::OwnSurface(const SurfaceMesh& surface, const std::vector<FacetId>& facets,
                       double tolerance) {
  const std::vector<RowId> nodes = corners_of(surface, facets);
  const Points points = surface.points(nodes, Eigen::all);
  if (points.rows() > 6) {
    const auto [centre, radius] = fit_sphere(points);
    const auto off = ((points.rowwise() - centre.transpose()).rowwise().norm().array() - radius);
    if (off.abs().maxCoeff() <= tolerance) {
      form_ = Sphere{centre, radius};
      return;
    }
    if (const ConeFit cone = fit_cone(surface, facets, points); cone.misfit <= tolerance) {
      form_ = Cone{cone.origin, cone.axis, cone.radius, cone.growth};
      return;
    }
  }
  Facets own;
  own.points = surface.points;
  own.normals = Points::Zero(surface.points.rows(), 3);
  own.nodes = nodes;
  own.tree = std::make_shared<const KdTree>(points);
  own.at_node.resize(static_cast<std::size_t>(surface.points.rows()));
  for (const FacetId f : facets)
    for (int i = 2; i < surface.corners[f]; ++i)
      own.triangles.push_back(
          {surface.facets[f][0], surface.facets[f][i - 1], surface.facets[f][i]});
  for (std::size_t t = 0; t < own.triangles.size(); ++t) {
    const auto& [a, b, c] = own.triangles[t];
    const Vector3d ab = own.points.row(b) - own.points.row(a),
                   ac = own.points.row(c) - own.points.row(a);
    for (const RowId n : own.triangles[t]) {
      own.at_node[n].push_back(static_cast<int>(t));
      own.normals.row(n) += ab.cross(ac);
    }
  }
  own.normals.rowwise().normalize();
  // A mid-side node walks from the triangles of its facet.
  for (const FacetId f : facets)
    for (std::size_t i = surface.corners[f]; i < surface.facets[f].size(); ++i)
      own.at_node[surface.facets[f][i]] = own.at_node[surface.facets[f][0]];
  form_ = std::move(own);
}

OwnSurface::Foot OwnSurface::foot(const Vector3d& x, RowId node) const {
  return std::visit([&](const auto& form) { return foot_on(form, x, node); }, form_);
}

OwnSurface::Foot OwnSurface::foot_on(const Sphere& sphere, const Vector3d& x, RowId) {
  const Vector3d off = x - sphere.centre, n = off.normalized();
  return {sphere.centre + sphere.radius * n,
          sphere.radius / off.norm() * (Matrix3d::Identity() - n * n.transpose())};
}

OwnSurface::Foot OwnSurface::foot_on(const Cone& cone, const Vector3d& x, RowId) {
  const Vector3d off = x - cone.origin;
  const double along = off.dot(cone.axis);
  const Vector3d away = off - along * cone.axis, outwards = away.normalized();
  // In the plane of the axis the foot is on the line with direction (1, growth) / norm.
  const Vector3d generator = (cone.axis + cone.growth * outwards).normalized();
  const Vector3d start = cone.origin + cone.radius * outwards;
  const Vector3d point = start + (x - start).dot(generator) * generator;
  const double radius = (point - cone.origin).dot(outwards);
  const Vector3d round = cone.axis.cross(outwards);
  return {point,
          generator * generator.transpose() + radius / away.norm() * round * round.transpose()};
}

// Solves p(u, v) + h n(u, v) = x by Newton's method, p and n linear in the triangle.
std::optional<OwnSurface::Foot> OwnSurface::Facets::over(int triangle, const Vector3d& x) const {
  constexpr int kMostSteps = 20;  // of Newton's method, which takes a few near the triangle
  const Matrix3d p = points(triangles[triangle], Eigen::all).transpose(),
                 n = normals(triangles[triangle], Eigen::all).transpose();
  Eigen::Matrix<double, 3, 2> along, turning;
  along << p.col(1) - p.col(0), p.col(2) - p.col(0);
  turning << n.col(1) - n.col(0), n.col(2) - n.col(0);
  Vector3d s = Vector3d::Zero();  // u, v, h
  Matrix3d slope;
  for (int step = 0; step < kMostSteps; ++step) {
    const Vector3d normal = n.col(0) + turning * s.head<2>();
    slope << along + s[2] * turning, normal;
    const Vector3d miss = x - p.col(0) - along * s.head<2>() - s[2] * normal;
    const Vector3d change = slope.inverse() * miss;
    if (!change.allFinite()) return std::nullopt;
    s += change;
    if (change.head<2>().norm() <= kOnEdge) break;
  }
  if (s[0] < -kOnEdge || s[1] < -kOnEdge || s[0] + s[1] > 1 + kOnEdge) return std::nullopt;
  return Foot{p.col(0) + along * s.head<2>(), along * slope.inverse().topRows<2>()};
}

// Nodes to go on by: within some distance, some tens of them, on the side that looks like `normal`.
std::vector<RowId> OwnSurface::Facets::around(const Vector3d& from, const Vector3d& normal,
                                              double distance) const {
  // For five unknowns: six times as many, and at most so many that a fit takes some ten
  // microseconds.
  // The tests of slides pass with half and twice of either.
  constexpr std::size_t kLeast = 30, kMost = 200;
  auto near = tree->within(from.data(), distance);
  if (near.size() < kLeast) near = tree->nearest(from.data(), kLeast);
  const std::size_t stride = (near.size() + kMost - 1) / kMost;
  std::vector<RowId> result;
  for (std::size_t i = 0; i < near.size(); i += stride)
    if (const RowId n = nodes[static_cast<std::size_t>(near[i].index)];
        normals.row(n).dot(normal) > 0)
      result.push_back(n);
  return result;
}

// Goes on from the point of a triangle with these weights by the quadric through it that is nearest
// to the nodes around.
OwnSurface::Foot OwnSurface::Facets::beyond(int triangle, const Vector3d& weights,
                                            const Vector3d& x) const {
  const Vector3d from = points(triangles[triangle], Eigen::all).transpose() * weights;
  Matrix3d frame;
  frame.col(2) = (normals(triangles[triangle], Eigen::all).transpose() * weights).normalized();
  frame.col(0) = frame.col(2).unitOrthogonal();
  frame.col(1) = frame.col(2).cross(frame.col(0));
  const Vector3d at = frame.transpose() * (x - from);
  const Points local =
      (points(around(from, frame.col(2), 2 * at.head<2>().norm()), Eigen::all).rowwise() -
       from.transpose()) *
      frame;
  const Eigen::ArrayXd u = local.col(0), v = local.col(1);
  MatrixXd terms(local.rows(), 5);
  terms << u, v, u.square(), u * v, v.square();
  const VectorXd q = least_squares(terms, local.col(2));
  const Vector3d up(q[0] + 2 * q[2] * at[0] + q[3] * at[1], q[1] + q[3] * at[0] + 2 * q[4] * at[1],
                    0);
  const double height = q[0] * at[0] + q[1] * at[1] + q[2] * at[0] * at[0] + q[3] * at[0] * at[1] +
                        q[4] * at[1] * at[1];
  Matrix3d slope = Vector3d(1, 1, 0).asDiagonal();
  slope.row(2) = up;
  return {from + frame * Vector3d(at[0], at[1], height), frame * slope * frame.transpose()};
}

OwnSurface::Foot OwnSurface::foot_on(const Facets& facets, const Vector3d& x, RowId node) {
  struct {
    int triangle = -1;
    Vector3d weights;
    double distance = std::numeric_limits<double>::infinity();
  } nearest;
  std::vector<int> around = facets.at_node[node];
  for (int last = -2; last != nearest.triangle;) {
    last = nearest.triangle;
    for (const int t : around) {
      const Matrix3d corners = facets.points(facets.triangles[t], Eigen::all).transpose();
      const Vector3d weights =
          nearest_on_triangle(corners.col(0), corners.col(1), corners.col(2), x);
      if (const double distance = (x - corners * weights).norm(); distance < nearest.distance)
        nearest = {t, weights, distance};
    }
    around.clear();
    for (const RowId n : facets.triangles[nearest.triangle])
      around.insert(around.end(), facets.at_node[n].begin(), facets.at_node[n].end());
  }
  std::optional<Foot> over;
  for (const int t : around)
    if (const auto foot = facets.over(t, x);
        foot && (!over || (x - foot->point).norm() < (x - over->point).norm()))
      over = foot;
  return over ? *over : facets.beyond(nearest.triangle, nearest.weights, x);
}

std::string OwnSurface::kind() const {
  if (std::holds_alternative<Sphere>(form_)) return "sphere";
  if (const Cone* cone = std::get_if<Cone>(&form_))
    return std::abs(cone->growth) > kLeastGrowth ? "cone" : "cylinder";
  return "facets";
}

}  // namespace cadmorph
