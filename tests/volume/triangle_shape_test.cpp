#include "volume/triangle_shape.h"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>

namespace cadmorph {
namespace {

using Eigen::VectorXd;

// Four triangles over a hill.
struct Hill {
  Points points{{0, 0, 0}, {1, 0, 0.1}, {1.2, 1, 0.3}, {0, 1.1, 0.2}, {2, 0.2, 0.1}, {2.1, 1, 0}};
  std::vector<std::array<Index, 3>> triangles{{0, 1, 3}, {1, 2, 3}, {1, 4, 2}, {4, 5, 2}};
  SlidingNodes sliding;

  Hill() {
    sliding.nodes = {1, 2};
    sliding.slides = RowMatrix::Zero(2, 2);
    sliding.at = [this](Index i, const Eigen::Vector2d& s) {
      SlidePlace place{points.row(sliding.nodes[std::size_t(i)]).transpose(), {}};
      place.point += Eigen::Vector3d(s[0], s[1], s.squaredNorm());
      place.tangents << 1, 0, 0, 1, 2 * s[0], 2 * s[1];
      return place;
    };
  }
};

}  // namespace

TEST_CASE("Triangles of any size and place have their shapes, stretched ones less",
          "[volume][best]") {
  const Hill hill;
  const FreeNodes free(6, {1, 2}, &hill.sliding);
  TriangleShape shapes(hill.triangles, hill.points, free);
  const double all = 16 * 4;  // of four with r = 1
  for (const int doublings : {2, 5}) {
    const double p = double(1 << doublings);
    CHECK(shapes.evaluate(hill.points, doublings) == Approx(all));
    const Eigen::Matrix3d turn =
        Eigen::AngleAxisd(1.1, Eigen::Vector3d(1, 2, -1).normalized()).toRotationMatrix();
    CHECK(shapes.evaluate(3 * hill.points * turn, doublings) == Approx(all));
    // In a plane a stretch has r = (s + 1 / s) / 2.
    Points plane = hill.points;
    plane.col(2).setZero();
    Points stretched = plane;
    stretched.col(0) *= 3;
    CHECK(TriangleShape(hill.triangles, plane, free).evaluate(stretched, doublings) ==
          Approx(all * std::pow((3 + 1.0 / 3) / 2, p)));
  }
  // Triangles without a node that moves don't count.
  CHECK(TriangleShape(hill.triangles, hill.points, FreeNodes(6, {0}, nullptr))
            .evaluate(hill.points, 2) == Approx(16));
  CHECK(TriangleShape({}, hill.points, free).is_empty());
}

TEST_CASE("The slopes of triangles' shapes are those of finite differences", "[volume][best]") {
  const Hill hill;
  FreeNodes free(6, {1, 2}, &hill.sliding);
  TriangleShape shapes(hill.triangles, hill.points, free);
  Points positions = hill.points;
  const VectorXd x = Eigen::Vector4d(0.2, -0.1, -0.15, 0.25);
  const int doublings = GENERATE(2, 3);
  const auto value = [&](const VectorXd& at) {
    free.move(at, positions);
    return std::log(shapes.evaluate(positions, doublings)) / (1 << doublings);
  };
  const double sum = std::exp(value(x) * (1 << doublings));
  VectorXd slope = VectorXd::Zero(4);
  shapes.add_slopes(free, 1 / sum, slope);
  std::vector<NodeBlocks::Block> blocks(2);
  for (NodeBlocks::Block& block : blocks) {
    block.hessian.setZero();
    block.reach = 10;
  }
  shapes.add_blocks(free, sum, blocks);
  CHECK(slope.norm() > 0.1);
  const double h = 1e-6;
  for (Index i = 0; i < 4; ++i) {
    const VectorXd step = h * VectorXd::Unit(4, i);
    CHECK(slope[i] == Approx((value(x + step) - value(x - step)) / (2 * h)).epsilon(1e-6));
  }
  // What a node may go at once is below the heights of its triangles, about 1.
  for (const NodeBlocks::Block& block : blocks) {
    CHECK(block.hessian.selfadjointView<Eigen::Lower>().eigenvalues().minCoeff() > 0);
    CHECK(block.reach < 1);
    CHECK(block.reach > 0.2);
  }
}

}  // namespace cadmorph
