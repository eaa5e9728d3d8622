#include "volume/moving_nodes.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <vector>

#include "../core/sample_meshes.h"

namespace cadmorph {
namespace {

using namespace testing;
using Eigen::RowVector3d;
using Eigen::Vector2d;

constexpr int kCells = 4;

// A cube of hexahedra, extruded along z: the nodes of its bottom and top slide within these planes,
// by less than 0.5, those straight above each other alike, and the rows between them are swept.
struct ExtrudedCube {
  ExtrudedCube() {
    for (const double z : {0.0, 1.0})
      for (Index n = 0; n < mesh.node_count(); ++n)
        if (mesh.points(n, 2) == z) sliding.nodes.push_back(n);
    std::ranges::sort(sliding.nodes);
    sliding.slides = RowMatrix::Zero(std::ssize(sliding.nodes), 2);
    sliding.at = [this](Index i, const Vector2d& slide) {
      SlidePlace place;
      place.point = mesh.points.row(sliding.nodes[i]).transpose();
      place.point.head<2>() += slide;
      place.tangents.setIdentity();
      return place;
    };
    sliding.is_within = [](Index, const Vector2d& slide) { return slide.norm() < 0.5; };
    for (Index i = 0; i < std::ssize(sliding.nodes); ++i) {
      const Index bottom = sliding.nodes[i];
      if (mesh.points(bottom, 2) != 0) continue;
      NodeRow row(kCells + 1);
      for (Index n = 0; n < mesh.node_count(); ++n)
        if (mesh.points.row(n).head(2) == mesh.points.row(bottom).head(2))
          row[std::size_t(kCells * mesh.points(n, 2) + 0.5)] = n;
      how.swept_rows.push_back(row);
      images.groups.push_back({i, sliding.find(row.back())});
    }
    images.alike = [this](const RowMatrix& slides) {
      RowMatrix result = slides;
      for (const auto& group : images.groups)
        result.row(group[0]) = result.row(group[1]) =
            (slides.row(group[0]) + slides.row(group[1])) / 2;
      return result;
    };
    how.sliding = [this] { return &sliding; };
    how.images = [this] { return images; };
  }
  ExtrudedCube(const ExtrudedCube&) = delete;

  MovingNodes moving() const {
    std::vector<char> is_fixed(mesh.node_count(), 0);
    for (const Index n : sliding.nodes) is_fixed[n] = 1;
    return {mesh, mesh.points, std::move(is_fixed), how};
  }
  const NodeRow& row() const { return how.swept_rows[how.swept_rows.size() / 2]; }

  const Mesh mesh = cube(CellType::Hexahedron, kCells);
  SlidingNodes sliding;
  SlidingImages images;
  BestMeshOptions how;
};

TEST_CASE("A row of a sweep moves as one, straight, with both its ends") {
  const ExtrudedCube extruded;
  MovingNodes moving = extruded.moving();
  REQUIRE(moving.let_slide(true, true));
  const NodeRow& row = extruded.row();
  const Index top = extruded.sliding.find(row.back());
  std::vector<Index> found;
  moving.for_column(row[2], [&](Index n) { found.push_back(n); });
  CHECK(std::ranges::is_permutation(found, row));

  // The top asks for twice of what comes, an inner node for anything.
  NodePlaces places{extruded.mesh.points, extruded.sliding.slides};
  const NodePlaces home = places;
  const RowVector3d shift(0.1, -0.2, 0);
  places.slides.row(top) = 2 * shift.head<2>();
  places.positions.row(row.back()) += 2 * shift;
  places.positions.row(row[1]) += RowVector3d(0.03, 0.05, -0.07);
  Patch patch;
  patch.nodes = row;
  std::ranges::sort(patch.nodes);
  moving.align_columns(patch, places);
  for (const Index n : row)
    CHECK((places.positions.row(n) - home.positions.row(n) - shift).norm() < 1e-14);
  CHECK((places.slides.row(top) - shift.head<2>()).norm() < 1e-14);

  // Half of it back, then all.
  CHECK(moving.take_back(row[3], home, 0.5, places));
  for (const Index n : row)
    CHECK((places.positions.row(n) - home.positions.row(n) - shift / 2).norm() < 1e-14);
  CHECK(moving.take_back(row[0], home, 0, places));
  CHECK(places.positions == home.positions);
  CHECK(places.slides == home.slides);
  CHECK_FALSE(moving.take_back(row[0], home, 0, places));
}

TEST_CASE("A column of which one node stays stays as a whole") {
  ExtrudedCube extruded;
  const NodeRow& row = extruded.row();
  const auto check_fixed = [&](const MovingNodes& moving, const NodeRow& one, bool is_fixed) {
    CHECK(std::ranges::all_of(one, [&](Index n) { return moving.is_fixed(n) == is_fixed; }));
  };
  extruded.how.held = {row.front()};
  extruded.how.resting = {extruded.how.swept_rows[0].back()};
  MovingNodes moving = extruded.moving();
  REQUIRE(moving.let_slide(true, true));
  check_fixed(moving, row, true);
  check_fixed(moving, extruded.how.swept_rows[0], true);
  check_fixed(moving, extruded.how.swept_rows[1], false);
  // Those at rest are let go in poor cells, those held never.
  std::vector<Index> cells(extruded.mesh.cell_count());
  for (Index c = 0; c < std::ssize(cells); ++c) cells[c] = c;
  CHECK(moving.release_resting(cells));
  check_fixed(moving, row, true);
  check_fixed(moving, extruded.how.swept_rows[0], false);
  CHECK_FALSE(moving.release_resting(cells));
}

TEST_CASE("Without sweeps the nodes between images are free") {
  const ExtrudedCube extruded;
  MovingNodes moving = extruded.moving();
  CHECK(moving.column(extruded.row()[0]) == -1);
  REQUIRE(moving.let_slide(true, false));
  CHECK(moving.column(extruded.row().front()) == moving.column(extruded.row().back()));
  CHECK(moving.column(extruded.row().front()) >= 0);
  CHECK(moving.column(extruded.row()[1]) == -1);
  moving.end_sliding();
  CHECK(moving.sliding() == nullptr);
  CHECK(moving.column(extruded.row().front()) == -1);
}

TEST_CASE("Rows are held until they are released, what is fixed stays so") {
  const ExtrudedCube extruded;
  const NodeRow& row = extruded.row();
  MovingNodes moving = extruded.moving();
  moving.fix_for_good(row[1]);
  moving.hold(row);
  CHECK(std::ranges::all_of(row, [&](Index n) { return moving.is_fixed(n); }));
  CHECK(moving.release_rows());
  CHECK_FALSE(moving.release_rows());
  CHECK(moving.is_fixed(row[0]));  // of the surface
  CHECK(moving.is_fixed(row[1]));
  CHECK_FALSE(moving.is_fixed(row[2]));
}

TEST_CASE("Nodes that slide beyond their face are fixed") {
  const ExtrudedCube extruded;
  MovingNodes moving = extruded.moving();
  REQUIRE(moving.let_slide(true, false));
  RowMatrix slides = extruded.sliding.slides;
  slides.row(2) << 0.4, 0.2;
  CHECK_FALSE(moving.fix_those_beyond(extruded.sliding.slides, slides));
  slides.row(3) << 0.4, 0.4;
  CHECK(moving.fix_those_beyond(extruded.sliding.slides, slides));
  CHECK_FALSE(moving.is_fixed(extruded.sliding.nodes[2]));
  CHECK(moving.is_fixed(extruded.sliding.nodes[3]));
}

}  // namespace
}  // namespace cadmorph
