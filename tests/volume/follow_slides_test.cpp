#include "volume/follow_slides.h"

#include <catch2/catch.hpp>

#include "../core/sample_meshes.h"
#include "volume_meshes.h"

namespace cadmorph {
namespace {

using namespace testing;

constexpr double kThickness = 0.1;

// A square wall of two layers whose upper side moves by `way` in its own plane; the lower side's
// inner nodes may slide.
struct Wall {
  Mesh mesh = cube(CellType::Hexahedron, 20);
  Points moved;
  std::vector<char> is_fixed;
  SlidingNodes lower;

  explicit Wall(const Eigen::RowVector3d& way) {
    mesh.points.col(2) *= kThickness;
    moved = mesh.points;
    is_fixed.assign(mesh.node_count(), 0);
    for (const Index n : cube_surface(cube(CellType::Hexahedron, 20))) is_fixed[n] = 1;
    for (Index n = 0; n < mesh.node_count(); ++n) {
      const Eigen::RowVector3d x = mesh.points.row(n);
      const bool is_rim = x.head<2>().minCoeff() < 1e-9 || x.head<2>().maxCoeff() > 1 - 1e-9;
      if (!is_rim && x.z() > kThickness - 1e-9) moved.row(n) += way;
      if (is_rim || x.z() > 1e-9) continue;
      lower.nodes.push_back(n);
      is_fixed[n] = 0;
    }
    lower.slides = RowMatrix::Zero(std::ssize(lower.nodes), 2);
    lower.at = [this](Index i, const Eigen::Vector2d& slide) {
      SlidePlace place{moved.row(lower.nodes[i]).transpose(), {}};
      place.point.head<2>() += slide;
      place.tangents << 1, 0, 0, 1, 0, 0;
      return place;
    };
    lower.is_within = [this](Index i, const Eigen::Vector2d& slide) {
      const Eigen::Vector2d x = moved.row(lower.nodes[i]).head<2>().transpose() + slide;
      return x.minCoeff() > 0 && x.maxCoeff() < 1;
    };
  }

  std::vector<Index> middle() const {
    std::vector<Index> cells;
    for (Index c = 0; c < mesh.cell_count(); ++c)
      if ((mesh.points.row(mesh.cell(c)[0]).head<2>().array() - 0.5).abs().maxCoeff() < 0.06)
        cells.push_back(c);
    return cells;
  }
  FollowingNodes find(const std::vector<Index>& cells) const {
    return follow_neighbours(mesh, mesh.points, moved, is_fixed, lower, {cells, 12});
  }
  RowMatrix follow(const std::vector<Index>& cells) const { return find(cells).slides; }
};

}  // namespace

TEST_CASE("Nodes that slide follow what moves across a thin wall", "[volume][follow]") {
  const Wall wall({0.2, -0.1, 0});
  const RowMatrix slides = wall.follow(wall.middle());
  Index inner = 0;
  for (Index i = 0; i < slides.rows(); ++i) {
    const auto x = wall.mesh.points.row(wall.lower.nodes[i]).head<2>();
    if ((x.array() - 0.5).abs().maxCoeff() > 0.15) continue;
    ++inner;
    CHECK(slides(i, 0) == Approx(0.2).epsilon(0.2));
    CHECK(slides(i, 1) == Approx(-0.1).epsilon(0.2));
  }
  CHECK(inner == 25);
}

TEST_CASE("Where nodes follow, the estimate keeps the wall's cells upright", "[volume][follow]") {
  const Eigen::RowVector3d way(0.2, -0.1, 0);
  const Wall wall(way);
  const Points at = wall.find(wall.middle()).positions;
  Index inner = 0;
  for (Index n = 0; n < at.rows(); ++n) {
    const auto x = wall.mesh.points.row(n);
    if ((x.head<2>().array() - 0.5).abs().maxCoeff() > 0.15) continue;
    CHECK((at.row(n) - x - way).norm() < 0.2 * way.norm());
    inner += !wall.is_fixed[n];
  }
  CHECK(inner > 0);
}

TEST_CASE("What moves out of the surface has nothing slide in it", "[volume][follow]") {
  const Wall wall({0, 0, 0.05});
  CHECK(wall.follow(wall.middle()).cwiseAbs().maxCoeff() < 1e-6);
}

TEST_CASE("Nodes that would leave their surface and those of no cell that suffers stay",
          "[volume][follow]") {
  const Wall wall({0.2, 0, 0});
  CHECK(wall.follow({}).isZero(0));
  const Wall far({2, 0, 0});
  const RowMatrix slides = far.follow(far.middle());
  CHECK_FALSE(slides.isZero(0));
  for (Index i = 0; i < slides.rows(); ++i)
    CHECK(far.lower.is_within(i, slides.row(i).transpose()));
}

}  // namespace cadmorph
