#include "surface/motion_prediction.h"

#include <BRepAlgoAPI_Cut.hxx>
#include <BRepBuilderAPI_MakeFace.hxx>
#include <BRepPrimAPI_MakeBox.hxx>
#include <BRepPrimAPI_MakeCylinder.hxx>
#include <BRepPrimAPI_MakeSphere.hxx>
#include <BRepPrimAPI_MakeWedge.hxx>
#include <Eigen/Geometry>
#include <catch2/catch.hpp>
#include <cmath>
#include <gp_Pln.hxx>
#include <random>

#include "cad_variants.h"

using namespace cadmorph;
using namespace cadmorph::testing;
using Eigen::Vector3d;
using Map = std::function<Vector3d(const Vector3d&)>;

namespace {

/// Points in and round a box from the origin, up to its size beyond.
Points places(const Vector3d& size) {
  std::mt19937 random(2);
  std::uniform_real_distribution<double> part(-1, 2);
  Points points(60, 3);
  for (Index i = 0; i < points.rows(); ++i)
    for (int a = 0; a < 3; ++a) points(i, a) = part(random) * size[a];
  return points;
}

MotionPrediction predict(const CadModel& base, const CadModel& variant) {
  return {base, variant, match_topology(base, variant)};
}

double largest_error(const MotionPrediction& prediction, const Points& points, const Map& map) {
  const Points moved = prediction(points);
  double most = 0;
  for (Index i = 0; i < points.rows(); ++i) {
    const Vector3d x = points.row(i);
    most = std::max(most, (Vector3d(moved.row(i)) - map(x)).norm());
    CHECK((prediction(x) - Vector3d(moved.row(i))).norm() < 1e-9);  // one at a time
  }
  return most;
}

TopoDS_Shape box(double x, double y, double z) { return BRepPrimAPI_MakeBox(x, y, z).Solid(); }

}  // namespace

TEST_CASE("the prediction gives back an affine change, also beyond the part",
          "[surface][prediction]") {
  const Vector3d size(10, 20, 30);
  const CadModel base = to_model(box(10, 20, 30));
  const auto grown = predict(base, to_model(box(13, 16, 33)));
  const Map grow = [](const Vector3d& x) -> Vector3d {
    return {1.3 * x.x(), 0.8 * x.y(), 1.1 * x.z()};
  };
  CHECK(largest_error(grown, places(size), grow) < 1e-8);
  const gp_GTrsf shear = general_affine();
  const auto sheared = predict(base, to_model(transformed(box(10, 20, 30), shear)));
  CHECK(largest_error(sheared, places(size), [&](const Vector3d& x) { return apply(shear, x); }) <
        1e-8);
}

TEST_CASE("the prediction of a part that moves as a whole is that motion",
          "[surface][prediction]") {
  const TopoDS_Shape part = drilled_plate(40, 20, 5, 3, {{10, 8}, {30, 12}});
  for (const double scale : {1.0, 25.4}) {
    const gp_Trsf motion = similarity(1.3, scale, {5, -60, 8});
    const auto moved = predict(to_model(part), to_model(transformed(part, motion)));
    CHECK(largest_error(moved, places({40, 20, 5}),
                        [&](const Vector3d& x) { return apply(motion, x); }) < 1e-6);
  }
  const auto still = predict(to_model(part), to_model(part));
  CHECK(largest_error(still, places({40, 20, 5}), [](const Vector3d& x) { return x; }) == 0);
}

TEST_CASE("the prediction takes corners to corners, whatever the shape becomes",
          "[surface][prediction]") {
  // The lid of a box becomes smaller and askew.
  const CadModel base = to_model(box(10, 10, 10)),
                 variant = to_model(BRepPrimAPI_MakeWedge(10, 10, 10, 1, 3, 7, 6).Shape());
  const auto match = match_topology(base, variant);
  const MotionPrediction prediction(base, variant, match);
  for (const CornerId c : match.corners.ids()) {
    const auto& from = base.vertices()[base.skeleton().corners[c]];
    const auto& to = variant.vertices()[variant.skeleton().corners[match.corners[c]]];
    CHECK((prediction(from.point) - to.point).norm() < 1e-8);
  }
  // Straight edges stay so in their middles, which are known, too.
  for (const CadEdge& e : base.edges()) {
    const Vector3d a = base.vertices()[e.start].point, b = base.vertices()[e.end].point;
    const Vector3d to = prediction(a) + prediction(b);
    CHECK((2 * prediction(Vector3d(0.5 * (a + b))) - to).norm() < 1e-8);
  }
}

TEST_CASE("beside a flat part the prediction is the same on both sides, and stays finite",
          "[surface][prediction]") {
  const auto sheet = [](double x, double y) {
    return to_model(BRepBuilderAPI_MakeFace(gp_Pln(), 0, x, 0, y).Face());
  };
  const CadModel base = sheet(10, 10), variant = sheet(14, 9);
  const auto match = match_topology(base, variant);
  const MotionPrediction prediction(base, variant, match);
  // One and a half diagonals away the part's motion as a whole holds.
  const Vector3d far = Vector3d(5, 5, 0) + 1.5 * base.diagonal() * Vector3d(1, -1, 1);
  CHECK((prediction(far) - match.alignment(far)).norm() < 1e-6);
  const Points above = places({10, 10, 2});
  Points below = above;
  below.col(2) *= -1;
  Points mirrored = prediction(below);
  mirrored.col(2) *= -1;
  CHECK((mirrored - prediction(above)).cwiseAbs().maxCoeff() < 1e-8);
  for (const double x : {0.0, 10.0})
    for (const double y : {0.0, 10.0})
      CHECK((prediction(Vector3d(x, y, 0)) - Vector3d(1.4 * x, 0.9 * y, 0)).norm() < 1e-8);
}

TEST_CASE("a hollow ball moves in one piece as its middle and size do", "[surface][prediction]") {
  const auto hollow = [](const Vector3d& at, double radius) {
    const gp_Pnt middle(at.x(), at.y(), at.z());
    return to_model(
        BRepAlgoAPI_Cut(box(30, 30, 30), BRepPrimAPI_MakeSphere(middle, radius).Solid()));
  };
  const Vector3d from(15, 15, 15), to(19, 13, 16);
  const auto prediction = predict(hollow(from, 5), hollow(to, 6));
  CHECK((prediction(from) - to).norm() < 0.02);  // centroids of faces are sampled
  for (int a = 0; a < 3; ++a)
    for (const double side : {-1.0, 1.0}) {
      const Vector3d way = side * Vector3d::Unit(a);
      CHECK((prediction(Vector3d(from + 5 * way)) - (to + 6 * way)).norm() < 0.05);
    }
}

TEST_CASE("the prediction is the same in any order of the variant's entities",
          "[surface][prediction]") {
  const TopoDS_Shape from = drilled_plate(40, 20, 5, 3, {{10, 8}, {30, 12}}),
                     to = drilled_plate(44, 19, 6, 2, {{12, 8}, {31, 10}});
  const CadModel base = to_model(from);
  const auto prediction = predict(base, to_model(to)),
             other = predict(base, to_model(shuffle(to, {.seed = 5}).shape)),
             turned = predict(to_model(shuffle(from, {.seed = 6}).shape), to_model(to));
  const Points at = places({40, 20, 5}), expected = prediction(at);
  CHECK((other(at) - expected).cwiseAbs().maxCoeff() < 1e-7);
  CHECK((turned(at) - expected).cwiseAbs().maxCoeff() < 1e-7);
}
