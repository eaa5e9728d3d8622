#include "volume/triangle_shape.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>

#include "core/parallel.h"

namespace cadmorph {
namespace {

using Eigen::Matrix2d;
using Eigen::Matrix3d;
using Eigen::Vector3d;
using Edges = Eigen::Matrix<double, 3, 2>;

// Triangles whose edges span less than this share of their lengths' product have no shape to keep:
// far above rounding, far below any that has one.
constexpr double kFlat = 1e-9;
// Of a height: the farthest that a node goes at once. A node and the edge opposite that come
// towards each other just meet then.
constexpr double kReach = 0.5;
// At the power 4, which raises the mean, a triangle counts as a cell of half its shape; less at
// larger ones, which raise the smallest. With 2^p for 2^4 triangles came out better by another
// fiftieth, the smallest scaled Jacobian worse by 6 % (docs/raising.md).
constexpr double kWeight = 16;
constexpr Index kGrain = 256;

Edges edges_of(const std::array<Index, 3>& nodes, const Points& points) {
  Edges result;
  for (int k = 0; k < 2; ++k)
    result.col(k) = points.row(nodes[std::size_t(k) + 1]) - points.row(nodes[0]);
  return result;
}

}  // namespace

TriangleShape::TriangleShape(std::span<const std::array<Index, 3>> triangles,
                             const Points& reference, const FreeNodes& free) {
  for (const std::array<Index, 3>& nodes : triangles) {
    if (std::ranges::none_of(nodes, [&](Index n) { return free.contains(n); })) continue;
    const Edges had = edges_of(nodes, reference);
    const double area = had.col(0).cross(had.col(1)).norm();
    if (!(area > kFlat * had.colwise().norm().prod())) continue;
    triangles_.push_back({nodes, Matrix2d((had.transpose() * had).inverse()), area});
  }
}

double TriangleShape::evaluate(const Points& positions, int doublings) {
  power_ = double(1 << doublings);
  parallel_for(std::ssize(triangles_), kGrain, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) {
      Triangle& triangle = triangles_[i];
      const Edges j = edges_of(triangle.nodes, positions);
      const Vector3d across = j.col(0).cross(j.col(1));
      const double square = across.squaredNorm(), spanned = std::sqrt(square);
      const Edges by_metric = j * triangle.metric;
      const double trace = j.cwiseProduct(by_metric).sum();
      triangle.summand = kWeight * std::pow(trace * triangle.area / (2 * spanned), power_);
      // How the edges' coordinates vary in space, and the logarithm of the area with the edges.
      Edges by_edges;
      by_edges << j.col(1).cross(across) / square, across.cross(j.col(0)) / square;
      triangle.squares << by_edges.rowwise().sum().squaredNorm(), by_edges.col(0).squaredNorm(),
          by_edges.col(1).squaredNorm();
      by_edges = 2 / trace * by_metric - by_edges;
      triangle.slopes << -by_edges.rowwise().sum(), by_edges;
    }
  });
  double sum = 0;
  for (const Triangle& triangle : triangles_) sum += triangle.summand;
  return sum;
}

void TriangleShape::add_slopes(const FreeNodes& free, double factor,
                               Eigen::VectorXd& gradient) const {
  for (const Triangle& triangle : triangles_)
    for (int k = 0; k < 3; ++k)
      if (const Index node = triangle.nodes[std::size_t(k)]; free.contains(node))
        free.add_slope(free.place_of(node), factor * triangle.summand * triangle.slopes.col(k),
                       gradient);
}

void TriangleShape::add_blocks(const FreeNodes& free, double sum,
                               std::vector<NodeBlocks::Block>& blocks) const {
  for (const Triangle& triangle : triangles_) {
    const double share = triangle.summand / sum;
    for (int k = 0; k < 3; ++k) {
      const Index node = triangle.nodes[std::size_t(k)];
      if (!free.contains(node)) continue;
      NodeBlocks::Block& block = blocks[std::size_t(free.place_of(node))];
      // 2 / height^2: twice the second derivative of log r where r is 1.
      block.hessian +=
          share * (power_ * triangle.slopes.col(k) * triangle.slopes.col(k).transpose() +
                   2 * triangle.squares[k] * Matrix3d::Identity());
      block.reach = std::min(block.reach, kReach / std::sqrt(triangle.squares[k]));
    }
  }
}

}  // namespace cadmorph
