#include "surface/image_slides.h"

#include <Eigen/Geometry>
#include <catch2/catch.hpp>

using namespace cadmorph;
using Eigen::Vector2d;
using Eigen::Vector3d;

namespace {

// Nodes 10, 11 of a plane and their images 20, 21 on another one, a sixth of a turn round z. Each
// slides along its own plane, 21 along one that leans.
struct Sides {
  Eigen::Matrix3d turn =
      Eigen::AngleAxisd(1.0471975511965976, Vector3d::UnitZ()).toRotationMatrix();
  Boundary boundary;
  SlidingNodes sliding;
  std::vector<ImagePair> images;

  Sides() {
    boundary.nodes = {10, 11, 20, 21};
    ImagePair pair;
    pair.from = {RowId(0), RowId(1)};
    pair.to = {RowId(2), RowId(3)};
    pair.inner = 2;
    pair.before.linear = pair.after.linear = turn;
    images.push_back(pair);
    sliding.nodes = boundary.nodes;
    sliding.slides = RowMatrix::Zero(4, 2);
    sliding.at = [this](Index i, const Vector2d& slide) {
      SlidePlace place;
      place.tangents << 1, 0, 0, 0, 0, 1;
      if (i >= 2) place.tangents = turn * place.tangents;
      // Its own coordinates begin elsewhere and run another way round.
      if (i >= 2) place.tangents.col(0).swap(place.tangents.col(1));
      if (i == 3)
        place.tangents =
            Eigen::AngleAxisd(0.1, Vector3d::UnitX()).toRotationMatrix() * place.tangents;
      place.point = Vector3d(double(i), 2, 3) + place.tangents * slide;
      return place;
    };
  }

  Vector3d way(Index i, const RowMatrix& slides) const {
    return sliding.at(i, slides.row(i)).point - sliding.at(i, Vector2d::Zero()).point;
  }
};

}  // namespace

TEST_CASE("Nodes that are images slide by the mean of what both ask for", "[surface][images]") {
  const Sides sides;
  const ImageSlides images(sides.images, sides.boundary, sides.sliding);
  RowMatrix slides(4, 2);
  slides << 0.4, 0.1, 0, 0, 0.3, 0.2, 0, 0;
  const Vector3d mean = (sides.way(0, slides) + sides.turn.transpose() * sides.way(2, slides)) / 2;
  images.average(slides);
  CHECK((sides.way(0, slides) - mean).norm() < 1e-15);
  CHECK((sides.way(2, slides) - sides.turn * mean).norm() < 1e-15);
  images.hold_unlike(sides.sliding.slides, 1e-12, slides);
  CHECK(slides.row(0).norm() > 0.1);
  CHECK(slides.row(2).norm() > 0.1);
}

TEST_CASE("Nodes whose ways are no images of each other stay", "[surface][images]") {
  Sides sides;
  RowMatrix slides(4, 2);
  slides << 0.4, 0.1, 0.4, 0.1, 0.1, 0.4, 0.1, 0.4;
  const ImageSlides images(sides.images, sides.boundary, sides.sliding);
  images.hold_unlike(sides.sliding.slides, 1e-12, slides);
  CHECK(slides.row(0) == Eigen::RowVector2d(0.4, 0.1));
  CHECK(slides.row(2) == Eigen::RowVector2d(0.1, 0.4));
  CHECK(slides.row(1).isZero(0));
  CHECK(slides.row(3).isZero(0));
}

TEST_CASE("A node stays whose image can't slide", "[surface][images]") {
  Sides sides;
  sides.sliding.nodes.pop_back();
  sides.sliding.slides = RowMatrix::Zero(3, 2);
  RowMatrix slides = RowMatrix::Constant(3, 2, 0.1);
  const ImageSlides images(sides.images, sides.boundary, sides.sliding);
  images.hold_unlike(sides.sliding.slides, 1e-12, slides);
  CHECK(slides.row(0).norm() > 0.1);
  CHECK(slides.row(1).isZero(0));
}

TEST_CASE("Planes of a swept mesh slide as one, unless a node of one can't", "[surface][images]") {
  // One above the other; all images of the first, as find_image_pairs has them.
  Boundary boundary;
  boundary.nodes = {10, 20, 30, 40};
  SlidingNodes sliding;
  sliding.nodes = boundary.nodes;
  sliding.slides = RowMatrix::Zero(4, 2);
  sliding.at = [](Index i, const Vector2d& slide) {
    SlidePlace place;
    place.tangents << 1, 0, 0, 1, 0, 0;
    place.point = Vector3d(0, 0, double(i)) + place.tangents * slide;
    return place;
  };
  std::vector<ImagePair> pairs;
  for (const Index to : {1, 2, 3}) {
    ImagePair& pair = pairs.emplace_back();
    pair.from = {RowId(0)};
    pair.to = {RowId(to)};
    pair.inner = 1;
  }
  RowMatrix slides(4, 2);
  slides << 0.4, 0, 0, 0.2, 0, 0, 0.4, 0.2;
  const ImageSlides images(pairs, boundary, sliding);
  CHECK(images.groups() == std::vector<std::vector<Index>>{{0, 1, 2, 3}});
  CHECK(images.bound().empty());
  images.average(slides);
  for (Index i = 0; i < 4; ++i)
    CHECK((slides.row(i) - Eigen::RowVector2d(0.2, 0.1)).norm() < 1e-15);

  sliding.nodes.pop_back();
  sliding.slides = RowMatrix::Zero(3, 2);
  const ImageSlides held(pairs, boundary, sliding);
  CHECK(held.groups().empty());
  CHECK(held.bound() == std::vector<Index>{0, 1, 2});
}
