#include "surface/face_unfold.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>

#include "cad/projector.h"
#include "core/foldover.h"
#include "core/lbfgs.h"

namespace cadmorph {
namespace {

using Eigen::Matrix2d;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::VectorXd;

// Minimisations, each with the next smaller regularisation, and steps of one of them. With half or
// twice of these, or of kSettled, 14 pairs come out the same. With half of kRounds the test of a
// hole that moves far fails; with half of kSteps or twice of kSettled it passes.
constexpr int kRounds = 30;
constexpr int kSteps = 150;
// Height over length of a triangle without a shape to keep: what a double keeps of it is rounding.
constexpr double kFlat = 1e-9;
// Minimisations end when they lower the energy by less than this share, none folded.
constexpr double kSettled = 1e-3;
// Triangles evaluated: ten seconds or so. Faces of real parts took a hundredth.
constexpr double kMostWork = 1e8;

// Corner triangles round a ring of rows; one for a triangle.
void add_corners(const std::vector<RowId>& ring, std::vector<std::array<RowId, 3>>& triangles) {
  const std::size_t n = ring.size();
  for (std::size_t i = 0; i < (n == 3 ? 1 : n); ++i)
    triangles.push_back({ring[i], ring[(i + 1) % n], ring[(i + n - 1) % n]});
}

// Triangles whose areas have the sign of the facet's everywhere when none is folded.
std::vector<std::array<RowId, 3>> triangles_of(const SurfaceMesh& surface,
                                               const std::vector<FacetId>& facets) {
  std::vector<std::array<RowId, 3>> triangles;
  for (const FacetId f : facets) {
    const std::vector<RowId>& rows = surface.facets[f];
    const auto corners = std::size_t(surface.corners[f]);
    add_corners({rows.begin(), rows.begin() + std::ptrdiff_t(corners)}, triangles);
    if (rows.size() < 2 * corners) continue;
    const std::vector<RowId> middles(rows.begin() + std::ptrdiff_t(corners),
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
  // Of `rows`, those at the positions `free` move.
  FaceDistortion(const SurfaceMesh& surface, const std::vector<FacetId>& facets,
                 const std::vector<RowId>& rows, const std::vector<Index>& free,
                 const FaceSide& mapped)
      : surface_(surface), rows_(rows), mapped_(mapped) {
    for (const Index i : free)
      if (surface.is_corner(rows[i])) add_place(rows[i], mapped.uv.row(i).transpose());
    free_ = std::ssize(places_);
    for (const Index i : free)
      if (const auto& ends = surface.between[rows[i]]; !surface.is_corner(rows[i]) && ends[2] < 0)
        nodes_[rows[i]] = {node_of(ends[0]).a, node_of(ends[1]).a};
    double area = 0;
    for (const auto& t : triangles_of(surface, facets)) area += add_triangle(t);
    for (Triangle& t : triangles_)
      if (area < 0) t.to_plane.row(1) *= -1;
  }

  VectorXd start() const {
    VectorXd x(2 * free_);
    for (Index i = 0; i < free_; ++i) x.segment<2>(2 * i) = places_[i];
    return x;
  }

  // Of the rows: corners, and the means of those that others lie between, at the positions `free`.
  Parameters parameters(const VectorXd& x, const std::vector<Index>& free) {
    Parameters result = mapped_.uv;
    for (const Index i : free) {
      const RowId row = rows_[i];
      const auto& around = surface_.between[row];
      const auto count = std::ranges::count_if(around, [](RowId end) { return end >= 0; });
      if (count <= 2)
        result.row(i) = at(x, node_of(row)).transpose();
      else
        result.row(i).setZero();
      for (Index k = 0; count > 2 && k < count; ++k)
        result.row(i) += at(x, node_of(around[std::size_t(k)])).transpose() / double(count);
    }
    return result;
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
        for (const Index i : {t.nodes[k].a, t.nodes[k].b})
          if (i < free_)
            gradient.segment<2>(2 * i) += t.to_plane.transpose() * by_jacobian * slope_of(t, k) / 2;
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
      for (int k = 0; k < 3; ++k) {
        const Vector2d slope = slope_of(t, k), of_det = s.cofactor * slope;
        const Matrix2d hessian = 2 / s.chi * slope.squaredNorm() * Matrix2d::Identity() +
                                 std::max(by_det, 0.0) * of_det * of_det.transpose();
        for (const Index i : {t.nodes[k].a, t.nodes[k].b})
          if (i < free_)
            inverses_[std::size_t(i)] += t.to_plane.transpose() * hessian * t.to_plane / 2;
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
  // The mean of two places: of the same one, or, for a node in the middle of an edge, of its ends.
  struct Node {
    Index a, b;
  };
  struct Triangle {
    std::array<Node, 3> nodes;
    Matrix2d to_plane;   ///< of the parameters, isometric where the triangle starts
    Matrix2d from_base;  ///< inverse of its edges on the base, in its plane
  };

  struct Sample : Regularised {
    Sample(const Matrix2d& given, double epsilon)
        : Regularised(given.determinant(), epsilon), jacobian(given), det(given.determinant()) {
      cofactor << jacobian(1, 1), -jacobian(1, 0), -jacobian(0, 1), jacobian(0, 0);
      shape = jacobian.squaredNorm() / chi;
      volume = (det * det + 1) / chi;
    }

    Matrix2d jacobian, cofactor;
    double det, shape, volume;
  };

  Matrix2d jacobian(const Triangle& t, const VectorXd& x) const {
    Matrix2d edges;
    for (int k = 1; k < 3; ++k) edges.col(k - 1) = at(x, t.nodes[k]) - at(x, t.nodes[0]);
    return t.to_plane * edges * t.from_base;
  }

  Vector2d place(const VectorXd& x, Index i) const {
    return i < free_ ? Vector2d(x.segment<2>(2 * i)) : places_[std::size_t(i)];
  }
  Vector2d at(const VectorXd& x, const Node& node) const {
    return (place(x, node.a) + place(x, node.b)) / 2;
  }

  Node add_place(RowId row, const Vector2d& uv) {
    const Index i = std::ssize(places_);
    places_.push_back(uv);
    return nodes_[row] = {i, i};
  }

  // A node that is new stays where it is.
  Node node_of(RowId row) {
    if (const auto found = nodes_.find(row); found != nodes_.end()) return found->second;
    if (const auto own = std::ranges::lower_bound(rows_, row); own != rows_.end() && *own == row)
      return add_place(row, mapped_.uv.row(own - rows_.begin()).transpose());
    const Vector2d near = places_.empty() ? Vector2d(0, 0) : places_[0];
    const Vector3d point = mapped_.points.row(row);
    return add_place(row, project_on_face(mapped_.model, mapped_.face, point, near).uv);
  }

  // Returns its area in the parameters' sense.
  double add_triangle(const std::array<RowId, 3>& rows) {
    const Vector3d a = surface_.points.row(rows[1]) - surface_.points.row(rows[0]);
    const Vector3d b = surface_.points.row(rows[2]) - surface_.points.row(rows[0]);
    const double length = a.norm(), height = a.cross(b).norm() / length;
    if (!(height > kFlat * std::max(length, b.norm()))) return 0;
    Matrix2d base, edges;
    base << length, a.dot(b) / length, 0, height;
    const std::array<Node, 3> nodes = {node_of(rows[0]), node_of(rows[1]), node_of(rows[2])};
    const auto start = [&](const Node& node) -> Vector2d {
      return (places_[node.a] + places_[node.b]) / 2;
    };
    const Vector2d origin = start(nodes[0]);
    edges << start(nodes[1]) - origin, start(nodes[2]) - origin;
    const SurfacePoint s = mapped_.model.evaluate(mapped_.face, origin + edges.rowwise().sum() / 3);
    Matrix2d metric;
    metric << s.du.squaredNorm(), s.du.dot(s.dv), s.du.dot(s.dv), s.dv.squaredNorm();
    const Eigen::LLT<Matrix2d> factor(metric);
    if (factor.info() != Eigen::Success) return 0;  // at a pole
    // A folded triangle whose nodes are all fixed would outweigh the others.
    const auto moves = [&](const Node& node) { return node.a < free_ || node.b < free_; };
    const Matrix2d to_plane = factor.matrixU();
    if (std::ranges::any_of(nodes, moves)) triangles_.push_back({nodes, to_plane, base.inverse()});
    return (to_plane * edges).determinant();
  }

  // Of the node's coordinate over the triangle.
  static Vector2d slope_of(const Triangle& t, int k) {
    return k == 0 ? Vector2d(-t.from_base.colwise().sum()) : Vector2d(t.from_base.row(k - 1));
  }

  const SurfaceMesh& surface_;
  const std::vector<RowId>& rows_;  ///< of the nodes within the face
  const FaceSide& mapped_;
  std::map<RowId, Node> nodes_;
  std::vector<Vector2d> places_;  ///< parameters where they start
  Index free_ = 0;                ///< the first of them, which move
  std::vector<Triangle> triangles_;
  std::vector<Matrix2d> inverses_;  ///< of the nodes' blocks
  double least_ = 0;
};

// The nodes within some rings of facets round the folded ones, as positions among `rows`, and all
// facets that they are on.
struct Rings {
  Rings(const SurfaceMesh& surface, const std::vector<FacetId>& all, const std::vector<RowId>& rows,
        const std::vector<FacetId>& folded, int count) {
    IdVector<RowId, char> is_near(std::size_t(surface.points.rows()), 0);
    const auto take = [&](FacetId facet) {
      for (const RowId row : surface.facets[facet]) is_near[row] = 1;
    };
    const auto find_touched = [&] {
      facets.clear();
      std::ranges::copy_if(all, std::back_inserter(facets), [&](FacetId facet) {
        return std::ranges::any_of(surface.facets[facet], [&](RowId row) { return is_near[row]; });
      });
    };
    std::ranges::for_each(folded, take);
    for (int ring = 1; ring < count; ++ring) {
      find_touched();
      std::ranges::for_each(facets, take);
    }
    find_touched();
    for (std::size_t i = 0; i < rows.size(); ++i)
      if (is_near[rows[i]]) nodes.push_back(Index(i));
  }

  std::vector<FacetId> facets;
  std::vector<Index> nodes;
};

Parameters unfold(const SurfaceMesh& surface, const std::vector<FacetId>& facets,
                  const std::vector<RowId>& rows, const std::vector<Index>& free,
                  const FaceSide& mapped) {
  FaceDistortion distortion(surface, facets, rows, free, mapped);
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
  return distortion.parameters(x, free);
}

}  // namespace

Parameters unfold_face(const SurfaceMesh& surface, const std::vector<FacetId>& facets,
                       const std::vector<RowId>& rows, const FaceSide& mapped,
                       const std::vector<FacetId>& folded, int rings) {
  const Rings around(surface, facets, rows, folded, rings);
  return unfold(surface, around.facets, rows, around.nodes, mapped);
}

Parameters unfold_face(const SurfaceMesh& surface, const std::vector<FacetId>& facets,
                       const std::vector<RowId>& rows, const FaceSide& mapped) {
  std::vector<Index> all(rows.size());
  std::iota(all.begin(), all.end(), 0);
  return unfold(surface, facets, rows, all, mapped);
}

}  // namespace cadmorph
