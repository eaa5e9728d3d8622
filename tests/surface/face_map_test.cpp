#include "surface/face_map.h"

#include <BRepAlgoAPI_Cut.hxx>
#include <BRepBuilderAPI_MakeFace.hxx>
#include <BRepBuilderAPI_MakePolygon.hxx>
#include <BRepPrimAPI_MakeBox.hxx>
#include <BRepPrimAPI_MakeCone.hxx>
#include <BRepPrimAPI_MakeCylinder.hxx>
#include <BRepPrimAPI_MakeSphere.hxx>
#include <BRepPrimAPI_MakeTorus.hxx>
#include <Eigen/Geometry>
#include <catch2/catch.hpp>
#include <cmath>
#include <gp_Pln.hxx>
#include <numbers>

#include "cad/projector.h"
#include "cad_variants.h"
#include "face_change.h"
#include "warped_shape.h"

using namespace cadmorph;
using namespace cadmorph::testing;
using Eigen::Vector2d;
using Eigen::Vector3d;
using std::numbers::pi;

namespace {

constexpr double kExact = 1e-9;  // of parts of some tens: rounding

/// How far the maps of all faces are from the expected one, at most.
double error_of_all(const Change& change, const PointMap& expected) {
  double most = 0;
  for (const FaceId f : change.base.faces().ids()) {
    const ChangedFace changed(change, f);
    const Parameters uv = changed.inside();
    REQUIRE(uv.rows() > 9);
    most = std::max(
        most, largest_error(changed.points_at(uv), changed.images(changed.map(uv)), expected));
  }
  return most;
}

Vector3d stay(const Vector3d& x) { return x; }

TopoDS_Shape box(double x, double y, double z) { return BRepPrimAPI_MakeBox(x, y, z).Solid(); }
TopoDS_Shape cylinder(double radius, double height) {
  return BRepPrimAPI_MakeCylinder(radius, height).Solid();
}
TopoDS_Shape cone(double low, double high, double height) {
  return BRepPrimAPI_MakeCone(low, high, height).Solid();
}
TopoDS_Shape ball(double radius) { return BRepPrimAPI_MakeSphere(radius).Solid(); }
TopoDS_Shape ring(double large, double small) {
  return BRepPrimAPI_MakeTorus(large, small).Solid();
}

TopoDS_Shape quadrilateral(const std::vector<Vector2d>& corners) {
  BRepBuilderAPI_MakePolygon polygon;
  for (const Vector2d& x : corners) polygon.Add(gp_Pnt(x.x(), x.y(), 0));
  polygon.Close();
  return BRepBuilderAPI_MakeFace(gp_Pln(), polygon.Wire()).Face();
}

/// The face whose outward normal is z at a height, of a box or a plate.
FaceId lid(const CadModel& model) {
  for (const FaceId f : model.faces().ids())
    if (model.normal(f, 0.5 * (model.faces()[f].lower + model.faces()[f].upper)).z() > 0.99)
      return f;
  return {};
}

double angle_of(const Vector3d& x) { return std::atan2(x.y(), x.x()); }
Vector3d at(double angle, double radius, double z) {
  return {radius * std::cos(angle), radius * std::sin(angle), z};
}

}  // namespace

TEST_CASE("faces that are equal keep their nodes' parameters to the last bit",
          "[surface][face_map]") {
  for (const TopoDS_Shape& shape : {box(10, 20, 30), cylinder(3, 10), cone(5, 2, 10), ball(5),
                                    ring(8, 2), to_nurbs(cone(5, 2, 10)), to_nurbs(ring(8, 2))}) {
    const Change change(shape, shape);
    for (const FaceId f : change.base.faces().ids()) {
      const ChangedFace changed(change, f);
      const Parameters uv = changed.inside();
      const FaceMapResult mapped = changed.map(uv);
      INFO(to_string(change.base.faces()[f].type));
      CHECK(mapped.uv == uv);
      CHECK_FALSE(mapped.is_projected);
      CHECK(mapped.note.empty());
    }
  }
}

TEST_CASE("faces whose dimensions change take their nodes where the closed form says",
          "[surface][face_map]") {
  CHECK(error_of_all(Change(box(10, 20, 30), box(13, 16, 33)), [](const Vector3d& x) -> Vector3d {
          return {1.3 * x.x(), 0.8 * x.y(), 1.1 * x.z()};
        }) < kExact);
  CHECK(error_of_all(Change(cylinder(3, 10), cylinder(4, 7)), [](const Vector3d& x) -> Vector3d {
          return {4 / 3. * x.x(), 4 / 3. * x.y(), 0.7 * x.z()};
        }) < kExact);
  CHECK(error_of_all(Change(cone(5, 2, 10), cone(6, 3, 12)), [](const Vector3d& x) {
          const double part = x.head<2>().norm() / (5 - 0.3 * x.z());  // of the radius
          return at(angle_of(x), part * (6 - 0.3 * x.z()), 1.2 * x.z());
        }) < kExact);
  CHECK(error_of_all(Change(ball(5), ball(6)),
                     [](const Vector3d& x) -> Vector3d { return 1.2 * x; }) < kExact);
  CHECK(error_of_all(Change(ring(8, 2), ring(10, 3)), [](const Vector3d& x) {
          return at(angle_of(x), 10 + 1.5 * (x.head<2>().norm() - 8), 1.5 * x.z());
        }) < kExact);
  // An apex, and a seam that begins elsewhere: the part does not turn with it.
  CHECK(error_of_all(Change(cone(5, 0, 10), cone(6, 0, 8)), [](const Vector3d& x) -> Vector3d {
          return {1.2 * x.x(), 1.2 * x.y(), 0.8 * x.z()};
        }) < kExact);
  const gp_Ax2 turned(gp_Pnt(), gp::DZ(), gp_Dir(std::cos(0.9), std::sin(0.9), 0));
  CHECK(error_of_all(Change(cylinder(3, 10), BRepPrimAPI_MakeCylinder(turned, 6, 10).Solid()),
                     [](const Vector3d& x) -> Vector3d {
                       return {2 * x.x(), 2 * x.y(), x.z()};
                     }) < kExact);
  // Poles and seams of a kernel's own choice.
  const auto hollow = [](const gp_Dir& axis, double radius) -> TopoDS_Shape {
    const gp_Ax2 middle(gp_Pnt(15, 15, 15), axis);
    return BRepAlgoAPI_Cut(box(30, 30, 30), BRepPrimAPI_MakeSphere(middle, radius).Solid());
  };
  CHECK(error_of_all(Change(hollow(gp::DZ(), 5), hollow(gp_Dir(3, 1, 2), 6)),
                     [](const Vector3d& x) -> Vector3d {
                       const Vector3d way = x - Vector3d(15, 15, 15);
                       return way.norm() < 7 ? x + 0.2 * way : x;
                     }) < 1e-6);
  CHECK(error_of_all(Change(ring(8, 2), BRepPrimAPI_MakeTorus(turned, 10, 3).Solid()),
                     [](const Vector3d& x) {
                       return at(angle_of(x), 10 + 1.5 * (x.head<2>().norm() - 8), 1.5 * x.z());
                     }) < 1e-6);
  // Surfaces whose u runs the other way.
  const ShuffleOptions reversed{.has_reversed_surfaces = true, .probability = 1};
  CHECK(error_of_all(Change(cylinder(3, 10), shuffle(cylinder(6, 10), reversed).shape),
                     [](const Vector3d& x) -> Vector3d {
                       return {2 * x.x(), 2 * x.y(), x.z()};
                     }) < kExact);
}

TEST_CASE("walls that go farther round spread their nodes evenly, at an apex too",
          "[surface][face_map]") {
  const auto wedge = [](double angle) { return BRepPrimAPI_MakeCylinder(4, 10, angle).Solid(); };
  const auto slice = [](double angle) { return BRepPrimAPI_MakeCone(5, 0, 10, angle).Solid(); };
  for (const auto& [from, to] : {std::pair(wedge(1.5), wedge(2)), {slice(1.5), slice(2)}}) {
    const Change wider(from, to);
    for (const FaceId f : wider.base.faces().ids()) {
      if (wider.base.faces()[f].type == SurfaceType::Plane) continue;
      const ChangedFace changed(wider, f);
      const Parameters uv = changed.inside();
      CHECK(largest_error(changed.points_at(uv), changed.images(changed.map(uv)),
                          [](const Vector3d& x) {
                            return at(angle_of(x) * 4 / 3, x.head<2>().norm(), x.z());
                          }) < kExact);
    }
  }
}

TEST_CASE("surfaces that bend take their nodes along at their parameters", "[surface][face_map]") {
  const PointMap bend = [](const Vector3d& x) -> Vector3d {
    return {x.x() + 0.1 * x.z(), 0.9 * x.y(), 1.5 * x.z() + 0.02 * x.x() * x.x()};
  };
  for (const TopoDS_Shape& shape :
       {box(10, 20, 30), cylinder(3, 10), cone(5, 0, 10), ball(5), ring(8, 2)})
    CHECK(error_of_all(Change(shape, warped(shape, bend)), bend) < kExact);
  const TopoDS_Shape free = to_nurbs(cylinder(3, 10));
  const Change change(free, with_moved_poles(free, twist_and_taper(10, 0.4)));
  for (const FaceId f : change.base.faces().ids()) {
    const ChangedFace changed(change, f);
    const Parameters uv = changed.inside();
    CHECK((changed.map(uv).uv - uv).cwiseAbs().maxCoeff() < kExact);
  }
}

TEST_CASE("nodes stay where a surface does, whatever its parameters", "[surface][face_map]") {
  constexpr double kSurface = 1e-5;  // ten times what B-Reps of that size are known to
  for (const char* name : {"cylinder", "cone_frustum", "sphere", "torus"}) {
    INFO(name);
    const TopoDS_Shape shape = with_turned_seams(name, 0);
    CHECK(error_of_all(Change(shape, with_turned_seams(name, 0.9)), stay) < kSurface);
    CHECK(error_of_all(Change(shape, to_nurbs(shape)), stay) < kSurface);
    const ShuffleOptions reversed{.is_order_shuffled = false,
                                  .has_reversed_planes = true,
                                  .has_reversed_surfaces = true,
                                  .probability = 1};
    CHECK(error_of_all(Change(shape, shuffle(shape, reversed).shape), stay) < kSurface);
  }
}

TEST_CASE("projection follows a part that moves as a whole", "[surface][face_map]") {
  for (const TopoDS_Shape& shape : {box(10, 20, 30), cylinder(3, 10), ring(8, 2)}) {
    const gp_Trsf motion = similarity(0.7, 1.5, {5, -60, 8});
    const Change change(shape, transformed(shape, motion));
    for (const FaceId f : change.base.faces().ids()) {
      const ChangedFace changed(change, f);
      const Points points = changed.points_at(changed.inside());
      const FaceMapResult mapped =
          project_face(changed.domain, change.pair, changed.motion(), points);
      CHECK(mapped.is_projected);
      CHECK(largest_error(points, changed.images(mapped),
                          [&](const Vector3d& x) { return apply(motion, x); }) < 1e-7);
    }
  }
}

TEST_CASE("wires go to wires, corners to corners, joints to joints", "[surface][face_map]") {
  // No affine map does it: each point of an edge goes to the same part of the other edge.
  const std::vector<Vector2d> from{{0, 0}, {10, 0}, {10, 10}, {0, 10}},
      to{{-1, 0}, {14, 2}, {9, 8}, {1, 12}};
  const Change change(quadrilateral(from), quadrilateral(to));
  Parameters middle(1, 2);
  middle << change.base.faces()[FaceId(0)].lower.transpose() * 0.5 +
                change.base.faces()[FaceId(0)].upper.transpose() * 0.5;
  ChangedFace changed(change, FaceId(0), middle);
  changed.moved_joints.row(0) << 7, 6, 0;
  Parameters uv(std::ssize(changed.domain.samples()), 2);
  for (Index i = 0; i < uv.rows(); ++i) uv.row(i) = changed.domain.samples()[i].uv;
  REQUIRE(uv.rows() == 4 * kFaceSamples + 1);
  const auto bilinear = [&](const Vector3d& x) -> Vector3d {
    if ((x - Vector3d(5, 5, 0)).norm() < 1e-6) return {7, 6, 0};
    const double s = x.x() / 10, t = x.y() / 10;
    const Vector2d y = (1 - t) * ((1 - s) * to[0] + s * to[1]) + t * ((1 - s) * to[3] + s * to[2]);
    return {y.x(), y.y(), 0};
  };
  for (const int steps : {1, 4}) {
    INFO(steps);
    CHECK(largest_error(changed.points_at(uv), changed.images(changed.map(uv, steps)), bilinear) <
          kExact);
  }
  const Points points = changed.points_at(uv);
  const FaceMapResult projected =
      project_face(changed.domain, change.pair, changed.motion(), points);
  CHECK(largest_error(points, changed.images(projected), bilinear) < 1e-6);
}

namespace {

/// A square plate with a hole in its middle.
TopoDS_Shape holed(double radius) { return drilled_plate(20, 20, 2, radius, {{10, 10}}); }

/// Of `rays` round the middle of that plate, each from the hole to the border in `steps`.
Parameters polar_grid(const ChangedFace& changed, double radius, int rays, int steps) {
  Parameters uv(rays * (steps + 1), 2);
  for (int r = 0; r < rays; ++r) {
    const double angle = 2 * pi * r / rays;
    const Vector2d way(std::cos(angle), std::sin(angle));
    const double border = 10 / way.cwiseAbs().maxCoeff();
    for (int s = 0; s <= steps; ++s) {
      const Vector2d x = Vector2d(10, 10) + (radius + (border - radius) * s / steps) * way;
      uv.row(r * (steps + 1) + s) =
          project_globally(changed.change.base, changed.face, Vector3d(x.x(), x.y(), 2)).uv;
    }
  }
  return uv;
}

}  // namespace

TEST_CASE("a hole that changes its size many times over folds nothing", "[surface][face_map]") {
  constexpr int kRays = 48, kSteps = 12, kRow = kSteps + 1;
  struct Case {
    double from, to;
    int steps;
    bool is_symmetric;  // what holds a field that runs on far from a small hole is not
  };
  for (const Case& c : {Case{4, 1, 1, true},
                        {4, 6, 1, true},
                        {4, 7, 1, true},
                        {1, 5, 1, false},
                        {1, 9, 8, false}}) {
    INFO(c.from << " to " << c.to << " in " << c.steps);
    const Change change(holed(c.from), holed(c.to));
    const ChangedFace changed(change, lid(change.base));
    const Parameters uv = polar_grid(changed, c.from, kRays, kSteps);
    const Points from = changed.points_at(uv), to = changed.images(changed.map(uv, c.steps));
    const auto image = [&](int ray, int step) -> Vector2d {
      return to.row(ray % kRays * kRow + step).head<2>().transpose() - Vector2d(10, 10);
    };
    for (int r = 0; r < kRays; ++r) {
      for (int s = 0; s < kSteps; ++s) {
        const Vector2d a = image(r, s), out = image(r, s + 1) - a, round = image(r + 1, s) - a;
        CHECK(out.x() * round.y() - out.y() * round.x() > 0);
        // A quarter of a turn, and the mirror image.
        if (!c.is_symmetric) continue;
        CHECK((image(r + kRays / 4, s) - Vector2d(-a.y(), a.x())).norm() < kExact);
        CHECK((image(kRays - r, s) - Vector2d(a.x(), -a.y())).norm() < kExact);
      }
      CHECK(image(r, 0).norm() == Approx(c.to).epsilon(0.03));  // between samples nearly
      if (r % 3 == 0) CHECK(image(r, 0).norm() == Approx(c.to).epsilon(kExact));  // a sample
      CHECK((to.row(r * kRow + kSteps) - from.row(r * kRow + kSteps)).norm() < 0.3);
    }
  }
}

TEST_CASE("nodes of the border keep to a hole that grows between the samples, too",
          "[surface][face_map]") {
  const Change change(holed(2), holed(3));
  ChangedFace changed(change, lid(change.base));
  std::vector<FaceDomain::Sample> nodes;
  const CadModel& base = change.base;
  for (const auto& wire : base.faces()[changed.face].wires)
    for (const CoedgeId c : wire) {
      const CadEdge& edge = base.edges()[base.coedges()[c].edge];
      if (edge.start != edge.end) continue;  // of the square
      for (int i = 0; i < 50; ++i) {
        const double t = edge.first + (i + 0.4) / 50 * (edge.last - edge.first);
        nodes.push_back({c, t, wire_parameters(base, c, t), edge.tolerance});
      }
    }
  REQUIRE(nodes.size() == 50);
  Parameters uv(50, 2);
  for (Index i = 0; i < 50; ++i) uv.row(i) = nodes[i].uv;
  const Points points = changed.points_at(uv);
  const Vector3d middle(10, 10, 2);
  const PointMap grow = [&](const Vector3d& x) -> Vector3d { return middle + 1.5 * (x - middle); };
  const double without = largest_error(points, changed.images(changed.map(uv)), grow);
  changed.border = FaceBorder(base, changed.face, nodes, points, 4 * pi / kFaceSamples);
  const double with = largest_error(points, changed.images(changed.map(uv)), grow);
  CHECK(with < 1e-5 * without);
  CHECK(without < 0.01);  // of 1: the warp alone is nearly right between its samples
}
