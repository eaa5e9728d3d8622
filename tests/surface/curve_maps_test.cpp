#include "surface/curve_maps.h"

#include <BRepAlgoAPI_Fuse.hxx>
#include <BRepPrimAPI_MakeBox.hxx>
#include <BRepPrimAPI_MakeCylinder.hxx>
#include <BRepPrimAPI_MakeSphere.hxx>
#include <TopTools_ListOfShape.hxx>
#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "known_pairs.h"

using namespace cadmorph;
using namespace cadmorph::testing;
using Eigen::Vector3d;

namespace {

constexpr double kAngle = 1e-8;  // radians: chords of 128 pieces a curve, polished
constexpr int kPlaces = 7;       // on each edge

/// The largest change of angle about the z axis of places on the closed curves about it.
double largest_turn(const char* part, const char* change, int& curves, const char* written = "") {
  const MadePair pair = make({part, change, written, written});
  const CadModel &base = pair.base.model, &variant = pair.variant.model;
  const TopologyMatch match = match_topology(base, variant);
  const MotionPrediction prediction(base, variant, match);
  const auto maps = map_curves({base, variant, match, prediction});
  double most = 0;
  curves = 0;
  for (std::size_t c = 0; c < maps.size(); ++c) {
    if (!maps[CurveId(c)].is_closed()) continue;
    ++curves;
    for (const CurveLink& link : base.skeleton().curves[CurveId(c)].links) {
      const CadEdge& edge = base.edges()[link.edge];
      for (int i = 0; i < kPlaces; ++i) {
        const double t = edge.first + (i + 0.3) / kPlaces * (edge.last - edge.first);
        const CurveLocation to = maps[CurveId(c)]({link.edge, t});
        const Vector3d x = base.evaluate_edge(link.edge, t).point;
        const Vector3d y = variant.evaluate_edge(to.edge, to.t).point;
        most = std::max(most, std::abs(std::atan2(x.x() * y.y() - x.y() * y.x(),
                                                  x.head<2>().dot(y.head<2>()))));
      }
    }
  }
  return most;
}

// A vessel with four nozzles, two of them along its seam, one of which leans; OCCT turns the
// frames of cylinders over as their axes pass 45 degrees.
CadModel vessel(double lean, double aside) {
  TopoDS_Shape shape = BRepPrimAPI_MakeSphere(20).Solid();
  for (const gp_Dir& axis :
       {gp::DZ(), gp_Dir(std::sin(lean), 0, std::cos(lean)),
        gp_Dir(0, std::sin(aside), std::cos(aside)),
        gp_Dir(-0.9 * std::sin(aside), -0.3 * std::sin(aside), std::cos(aside))}) {
    for (const auto& [radius, length] : {std::pair(4.0, 32.0), std::pair(6.0, 0.0)}) {
      const gp_Pnt from = gp_Pnt().Translated((length > 0 ? 0 : 30) * gp_Vec(axis));
      const double height = length > 0 ? length : 2;
      shape = BRepAlgoAPI_Fuse(shape,
                               BRepPrimAPI_MakeCylinder(gp_Ax2(from, axis), radius, height).Solid())
                  .Shape();
    }
  }
  return to_model(shape);
}

}  // namespace

TEST_CASE("rims of a nozzle that leans stay, all of them, where its seams jump",
          "[surface][seam]") {
  const double before = 0.9, after = 0.737;
  const CadModel base = vessel(before, 2.2), variant = vessel(after, 1.9);
  const TopologyMatch match = match_topology(base, variant);
  const MotionPrediction prediction(base, variant, match);
  const auto maps = map_curves({base, variant, match, prediction});
  const auto angle = [](const Vector3d& x, double lean) {  // about the nozzle's axis
    return std::atan2(x.y(), x.x() * std::cos(lean) - x.z() * std::sin(lean));
  };
  int rims = 0;
  for (const CurveId c : maps.ids()) {
    const CadCurve& curve = base.skeleton().curves[c];
    const CadEdge& edge = base.edges()[curve.links.front().edge];
    REQUIRE(maps[c].is_closed());
    const Vector3d middle = maps[c].place().centre;
    if (std::abs(std::atan2(middle.x(), middle.z()) - before) > 0.01) continue;
    ++rims;
    for (int i = 0; i < kPlaces; ++i) {
      const double t = edge.first + (i + 0.3) / kPlaces * (edge.last - edge.first);
      const CurveLocation to = maps[c]({curve.links.front().edge, t});
      const double from = angle(base.evaluate_edge(curve.links.front().edge, t).point, before);
      const double turn = angle(variant.evaluate_edge(to.edge, to.t).point, after) - from;
      CHECK(std::abs(std::remainder(turn, 2 * std::numbers::pi)) < 0.3);
    }
  }
  CHECK(rims == 5);
}

TEST_CASE("rims about one axis keep their angles wherever their seams are", "[surface][seam]") {
  // Analytic truth: only sizes along and across the axis change.
  const std::vector<std::pair<const char*, std::string>> parts{{"cone", "radius 1.2"},
                                                               {"frustum", "wide 1.2"},
                                                               {"cylinder", "radius 1.2"},
                                                               {"nozzle", "wide 1.2"},
                                                               {"shaft", "r2 1.2"}};
  for (const auto& [part, size] : parts)
    for (const char* seam : {"", " seam +0.9", " seam -2.5", " seam +3.1415927"}) {
      const std::string change = size + seam;
      INFO(part << ": " << change);
      int curves = 0;
      CHECK(largest_turn(part, change.c_str(), curves) < kAngle);
      CHECK(curves > 0);
    }
}

TEST_CASE("rims of free forms turn with seams by little alone", "[surface][seam]") {
  // The section of a sweep may start anywhere: by 0.9 radians it did, by 0.2 the part may be
  // twisted.
  for (const auto& [part, size] :
       {std::pair("frustum", "wide 1.2"), std::pair("nozzle", "wide 1.2")})
    for (const auto& [seam, turn] : {std::pair(" seam +0.9", 0.0), std::pair(" seam -2.5", 0.0),
                                     std::pair(" seam +0.2", 0.2)}) {
      const std::string change = std::string(size) + seam;
      INFO(part << ": " << change);
      int curves = 0;
      // Their places are found by tables of chords.
      CHECK(largest_turn(part, change.c_str(), curves, "nurbs") == Approx(turn).margin(1e-3));
      CHECK(curves > 1);
    }
}

TEST_CASE("rims turn with the key of a shaft wherever their seams are", "[surface][seam]") {
  for (const char* change : {"spin 0.4", "spin 0.4 seam +0.9", "spin 0.4 seam -2.5"}) {
    INFO(change);
    int curves = 0;
    CHECK(largest_turn("keyed_shaft", change, curves) == Approx(0.4).margin(kAngle));
    CHECK(curves > 2);
  }
}

TEST_CASE("edges of a girder stay where a stiffener moves between its flanges", "[surface]") {
  // Sixteen of forty corners move, so that the parts fit best 0.06 off: along the edges of the
  // flanges, which lie in themselves then, but with other ends.
  const auto girder = [](double at) {
    const auto box = [](double x, double y, double z, double dx, double dy, double dz) {
      return BRepPrimAPI_MakeBox(gp_Pnt(x, y, z), dx, dy, dz).Shape();
    };
    constexpr double kLength = 6, kHigh = 1.2, kFlange = 0.05, kWeb = 0.03, kBetween = 1.1;
    TopTools_ListOfShape first, others;
    first.Append(box(0, -0.2, 0, kLength, 0.4, kFlange));
    others.Append(box(0, -0.2, kHigh - kFlange, kLength, 0.4, kFlange));
    others.Append(box(0, -kWeb / 2, kFlange, kLength, kWeb, kBetween));
    for (const double y : {kWeb / 2, -0.1})
      others.Append(box(at, y, kFlange, 0.04, 0.1 - kWeb / 2, kBetween));
    BRepAlgoAPI_Fuse fuse;
    fuse.SetArguments(first);
    fuse.SetTools(others);
    fuse.Build();
    return to_model(fuse.Shape());
  };
  const CadModel base = girder(2.98), variant = girder(3.13);
  const TopologyMatch match = match_topology(base, variant);
  const MotionPrediction prediction(base, variant, match);
  const auto maps = map_curves({base, variant, match, prediction});
  int still = 0;
  for (std::size_t c = 0; c < maps.size(); ++c)
    for (const CurveLink& link : base.skeleton().curves[CurveId(c)].links) {
      const CadEdge& edge = base.edges()[link.edge];
      const auto at = [&](double part) { return edge.first + part * (edge.last - edge.first); };
      const Vector3d from = base.evaluate_edge(link.edge, at(0)).point,
                     to = base.evaluate_edge(link.edge, at(1)).point;
      if ((to - from).norm() < 5.9) continue;
      ++still;
      for (int i = 0; i < kPlaces; ++i) {
        const double t = at((i + 0.3) / kPlaces);
        const CurveLocation there = maps[CurveId(c)]({link.edge, t});
        CHECK((variant.evaluate_edge(there.edge, there.t).point -
               base.evaluate_edge(link.edge, t).point)
                  .norm() < 1e-9);
      }
    }
  CHECK(still == 8);
}
