#include "surface/face_unfold.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>

#include "cad/projector.h"
#include "core/foldover.h"
#include "core/lbfgs.h"

namespace cadmorph {
namespace {

using Eigen::Matrix2d;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr int kRounds = 30;     // minimisations, each with the next smaller regularisation
constexpr int kSteps = 150;     // of one of them
constexpr double kFlat = 1e-9;  // height over length of a triangle without a shape to keep
// Minimisations end when they lower the energy by less than this share, none folded.
constexpr double kSettled = 1e-3;
// Triangles evaluated: ten seconds or so. Faces of real parts took a hundredth.
constexpr double kMostWork = 1e8;

// Corner triangles round a ring of rows; one for a triangle.
void add_corners(const std::vector<int>& ring, std::vector<std::array<int, 3>>& triangles) {
  const std::size_t n = ring.size();
  for (std::size_t i = 0; i < (n == 3 ? 1 : n); ++i)
    triangles.push_back({ring[i], ring[(i + 1) % n], ring[(i + n - 1) % n]});
}

// Triangles whose areas have the sign of the facet's everywhere when none is folded.
std::vector<std::array<int, 3>> triangles_of(const SurfaceMesh& surface,
                                             const std::vector<int>& facets) {
  std::vector<std::array<int, 3>> triangles;
  for (const int f : facets) {
    const std::vector<int>& rows = surface.facets[f];
    const auto corners = std::size_t(surface.corners[f]);
    if (rows.size() < 2 * corners) {
      add_corners({rows.begin(), rows.begin() + std::ptrdiff_t(corners)}, triangles);
      continue;
    }
    const std::vector<int> middles(rows.begin() + std::ptrdiff_t(corners),
                                   rows.begin() + std::ptrdiff_t(2 * corners));
    for (std::size_t i = 0; i < corners; ++i)
      triangles.push_back({rows[i], middles[i], middles[(i + corners - 1) % corners]});
    add_corners(middles, triangles);
  }
  return triangles;
}

// The distortion of a map of triangles into the plane of a face's parameters.
class FaceDistortion : public HessianGuess {
 public:
  FaceDistortion(const SurfaceMesh& surface, const std::vector<int>& facets,
                 const std::vector<int>& rows, const FaceSide& mapped)
      : free_(std::ssize(rows)) {
    for (const int row : rows) nodes_.emplace(row, std::ssize(nodes_));
    places_.resize(rows.size());
    for (Index i = 0; i < free_; ++i) places_[i] = mapped.uv.row(i).transpose();
    double area = 0;
    for (const auto& t : triangles_of(surface, facets)) area += add_triangle(surface, mapped, t);
    for (Triangle& t : triangles_)
      if (area < 0) t.to_plane.row(1) *= -1;
  }

  VectorXd start() const {
    VectorXd x(2 * free_);
    for (Index i = 0; i < free_; ++i) x.segment<2>(2 * i) = places_[i];
    return x;
  }
  double triangle_count() const { return double(triangles_.size()); }

  double operator()(const VectorXd& x, double epsilon, VectorXd& gradient) {
    gradient = VectorXd::Zero(x.size());
    double energy = 0;
    least_ = std::numeric_limits<double>::infinity();
    for (const Triangle& t : triangles_) {
      const Sample s(jacobian(t, x), epsilon);
      energy += s.shape + kVolumeWeight * s.volume;
      least_ = std::min(least_, s.det);
      const Matrix2d by_jacobian =
          2 / s.chi * s.jacobian +
          (-s.shape * s.rate + kVolumeWeight * (2 * s.det - s.volume * s.rate)) / s.chi *
              s.cofactor;
      for (int k = 0; k < 3; ++k)
        if (const Index i = t.nodes[k]; i < free_)
          gradient.segment<2>(2 * i) += t.to_plane.transpose() * by_jacobian * slope_of(t, k);
    }
    return energy;
  }

  // Of the second derivatives: those by the Jacobian alone and by its determinant alone.
  const HessianGuess& guess_hessian(const VectorXd& x, double epsilon) {
    inverses_.assign(std::size_t(free_), Matrix2d::Zero());
    for (const Triangle& t : triangles_) {
      const Sample s(jacobian(t, x), epsilon);
      const double rate_square = s.rate * s.rate / s.chi;
      const double by_det =
          s.shape / s.chi * (2 * rate_square - s.bend) +
          kVolumeWeight / s.chi *
              (2 - 4 * s.det * s.rate / s.chi + s.volume * (2 * rate_square - s.bend));
      for (int k = 0; k < 3; ++k)
        if (const Index i = t.nodes[k]; i < free_) {
          const Vector2d slope = slope_of(t, k), of_det = s.cofactor * slope;
          const Matrix2d hessian = 2 / s.chi * slope.squaredNorm() * Matrix2d::Identity() +
                                   std::max(by_det, 0.0) * of_det * of_det.transpose();
          inverses_[std::size_t(i)] += t.to_plane.transpose() * hessian * t.to_plane;
        }
    }
    double most = 0;
    for (const Matrix2d& hessian : inverses_) most = std::max(most, hessian.trace());
    for (Matrix2d& hessian : inverses_)
      hessian = (hessian + kFlat * most * Matrix2d::Identity()).inverse().eval();
    return *this;
  }

  double least_determinant() const { return least_; }
  VectorXd solve(const VectorXd& vector) const override {
    VectorXd result(vector.size());
    for (std::size_t i = 0; i < inverses_.size(); ++i)
      result.segment<2>(2 * Index(i)) = inverses_[i] * vector.segment<2>(2 * Index(i));
    return result;
  }

 private:
  struct Triangle {
    std::array<Index, 3> nodes;  ///< first those that move
    Matrix2d to_plane;           ///< of the parameters, isometric where the triangle starts
    Matrix2d from_base;          ///< inverse of its edges on the base, in its plane
  };

  struct Sample {
    Sample(const Matrix2d& given, double epsilon) : jacobian(given) {
      cofactor << jacobian(1, 1), -jacobian(1, 0), -jacobian(0, 1), jacobian(0, 0);
      det = jacobian.determinant();
      chi = regularised(det, epsilon);
      const double root = std::sqrt(det * det + epsilon * epsilon);
      rate = chi / root;
      bend = epsilon * epsilon / (2 * root * root * root);
      shape = jacobian.squaredNorm() / chi;
      volume = (det * det + 1) / chi;
    }

    Matrix2d jacobian, cofactor;
    double det, chi, rate, bend;  ///< chi'(det), chi''(det)
    double shape, volume;
  };

  Matrix2d jacobian(const Triangle& t, const VectorXd& x) const {
    Matrix2d edges;
    for (int k = 1; k < 3; ++k) edges.col(k - 1) = at(x, t.nodes[k]) - at(x, t.nodes[0]);
    return t.to_plane * edges * t.from_base;
  }

  Vector2d at(const VectorXd& x, Index node) const {
    return node < free_ ? Vector2d(x.segment<2>(2 * node)) : places_[std::size_t(node)];
  }

  // A node that is new stays where it is.
  Index node_of(const FaceSide& mapped, int row) {
    const auto [found, is_new] = nodes_.emplace(row, std::ssize(places_));
    if (is_new) {
      const Vector3d point = mapped.points.row(row);
      places_.push_back(project_on_face(mapped.model, mapped.face, point, places_[0]).uv);
    }
    return found->second;
  }

  // Returns its area in the parameters' sense.
  double add_triangle(const SurfaceMesh& surface, const FaceSide& mapped,
                      const std::array<int, 3>& rows) {
    const Vector3d a = surface.points.row(rows[1]) - surface.points.row(rows[0]);
    const Vector3d b = surface.points.row(rows[2]) - surface.points.row(rows[0]);
    const double length = a.norm(), height = a.cross(b).norm() / length;
    if (!(height > kFlat * std::max(length, b.norm()))) return 0;
    Matrix2d base, edges;
    base << length, a.dot(b) / length, 0, height;
    std::array<Index, 3> nodes;
    std::ranges::transform(rows, nodes.begin(), [&](int row) { return node_of(mapped, row); });
    const Vector2d origin = places_[nodes[0]];
    edges << places_[nodes[1]] - origin, places_[nodes[2]] - origin;
    const SurfacePoint s = mapped.model.evaluate(mapped.face, origin + edges.rowwise().sum() / 3);
    Matrix2d metric;
    metric << s.du.squaredNorm(), s.du.dot(s.dv), s.du.dot(s.dv), s.dv.squaredNorm();
    const Eigen::LLT<Matrix2d> factor(metric);
    if (factor.info() != Eigen::Success) return 0;  // at a pole
    triangles_.push_back({nodes, factor.matrixU(), base.inverse()});
    return (triangles_.back().to_plane * edges).determinant();
  }

  // Of the node's coordinate over the triangle.
  static Vector2d slope_of(const Triangle& t, int k) {
    return k == 0 ? Vector2d(-t.from_base.colwise().sum()) : Vector2d(t.from_base.row(k - 1));
  }

  Index free_;                    ///< nodes that move
  std::map<int, Index> nodes_;    ///< of rows
  std::vector<Vector2d> places_;  ///< parameters where the nodes start
  std::vector<Triangle> triangles_;
  std::vector<Matrix2d> inverses_;  ///< of the nodes' blocks
  double least_ = 0;
};

}  // namespace

Parameters unfold_face(const SurfaceMesh& surface, const std::vector<int>& facets,
                       const std::vector<int>& rows, const FaceSide& mapped) {
  FaceDistortion distortion(surface, facets, rows, mapped);
  VectorXd x = distortion.start(), gradient;
  double epsilon = 1;
  const auto guess = [&](const VectorXd& at) -> const HessianGuess& {
    return distortion.guess_hessian(at, epsilon);
  };
  double work = 0;
  for (int round = 0; round < kRounds && work < kMostWork; ++round) {
    const auto energy = [&](const VectorXd& at, VectorXd& slope) {
      work += distortion.triangle_count();
      return distortion(at, epsilon, slope);
    };
    const double before = energy(x, gradient);
    const double steps =
        std::min<double>(kSteps, 1 + (kMostWork - work) / distortion.triangle_count());
    minimise_lbfgs(energy, x, guess, int(steps));
    const double after = energy(x, gradient), least = distortion.least_determinant();
    if (least > 0 && epsilon <= kLeastEpsilon && after > (1 - kSettled) * before) break;
    epsilon = next_epsilon(epsilon, least, before, after);
  }
  Parameters result(std::ssize(rows), 2);
  for (Index i = 0; i < result.rows(); ++i) result.row(i) = x.segment<2>(2 * i).transpose();
  return result;
}

}  // namespace cadmorph
