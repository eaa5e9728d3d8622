#include "surface/face_domain.h"

#include <BRepBuilderAPI_MakeEdge.hxx>
#include <BRepBuilderAPI_MakeFace.hxx>
#include <BRepBuilderAPI_MakePolygon.hxx>
#include <BRepBuilderAPI_MakeWire.hxx>
#include <TopoDS.hxx>
#include <TopoDS_Face.hxx>
#include <TopoDS_Wire.hxx>
#include <catch2/catch.hpp>
#include <cmath>
#include <gp_Circ.hxx>
#include <gp_Pln.hxx>
#include <numbers>
#include <utility>

#include "cad_variants.h"

using namespace cadmorph;
using namespace cadmorph::testing;

namespace {

constexpr double kRim = 100, kHole = 1.5, kPitch = 7;

TopoDS_Wire circle(double x, double y, double radius) {
  const gp_Circ curve(gp_Ax2(gp_Pnt(x, y, 0), gp_Dir(0, 0, 1)), radius);
  return BRepBuilderAPI_MakeWire(BRepBuilderAPI_MakeEdge(curve).Edge()).Wire();
}

// A tube sheet.
TopoDS_Face sheet() {
  BRepBuilderAPI_MakeFace face(gp_Pln(gp::XOY()), circle(0, 0, kRim));
  for (double x = -98; x < kRim; x += kPitch)
    for (double y = -98; y < kRim; y += kPitch)
      if (std::hypot(x, y) < kRim - 2 * kPitch)
        face.Add(TopoDS::Wire(circle(x, y, kHole).Reversed()));
  return face.Face();
}

}  // namespace

TEST_CASE("The rim of a face with hundreds of holes keeps its samples", "[surface][face_domain]") {
  const CadModel model = to_model(sheet());
  REQUIRE(model.faces()[FaceId(0)].wires.size() > 400);
  const FaceDomain domain(model, FaceId(0), 200);
  // The rim grows by a tenth, the holes stay.
  Parameters values = Parameters::Zero(static_cast<Index>(domain.samples().size()), 2);
  for (Index i = 0; i < values.rows(); ++i) {
    const Eigen::Vector2d& uv = domain.samples()[static_cast<std::size_t>(i)].uv;
    if (uv.norm() > 0.99 * kRim) values.row(i) = 0.1 * uv.transpose();
  }
  Parameters at(360, 2);
  for (Index i = 0; i < at.rows(); ++i) {
    const double angle = 2 * std::numbers::pi * (static_cast<double>(i) + 0.5) / 360;
    at.row(i) << kRim * std::cos(angle), kRim * std::sin(angle);
  }
  const Parameters moved = domain.interpolate(values, at);
  CHECK((moved - 0.1 * at).rowwise().norm().maxCoeff() < 0.01 * 0.1 * kRim);
}

TEST_CASE("A hole that grows in a wide face moves nothing farther than itself, in steps or at once",
          "[surface][face_domain]") {
  BRepBuilderAPI_MakeFace face(gp_Pln(gp::XOY()), circle(0, 0, kRim));
  face.Add(TopoDS::Wire(circle(0, 0, kHole).Reversed()));
  const CadModel model = to_model(face.Face());
  const FaceDomain domain(model, FaceId(0), 100);
  Parameters values = Parameters::Zero(static_cast<Index>(domain.samples().size()), 2);
  for (Index i = 0; i < values.rows(); ++i) {
    const Eigen::Vector2d& uv = domain.samples()[static_cast<std::size_t>(i)].uv;
    if (uv.norm() < 2 * kHole) values.row(i) = uv.transpose() / 2;
  }
  Parameters at(60, 2);
  for (Index i = 0; i < at.rows(); ++i) at.row(i) << kHole + 1.6 * static_cast<double>(i), 0.1;
  for (const int steps : {1, 4}) {
    INFO(steps);
    const Parameters moved =
        steps > 1 ? domain.interpolate_in_steps(values, at, steps) : domain.interpolate(values, at);
    CHECK(moved.rowwise().norm().maxCoeff() < 1.2 * kHole / 2);
    CHECK(moved(0, 0) > 0.9 * kHole / 2);
  }
}

TEST_CASE("A short edge that grows many times over carries only what is near along",
          "[surface][face_domain]") {
  // A square, the first hundredth of whose lower side is an edge of its own; nodes every millimetre
  // within.
  constexpr double kSide = 10, kShort = 0.01;
  BRepBuilderAPI_MakePolygon polygon;
  for (const auto& [x, y] :
       {std::pair(0.0, 0.0), {kShort, 0}, {kSide, 0}, {kSide, kSide}, {0, kSide}})
    polygon.Add(gp_Pnt(x, y, 0));
  polygon.Close();
  const TopoDS_Face face = BRepBuilderAPI_MakeFace(gp_Pln(gp::XOY()), polygon.Wire());
  const CadModel model = to_model(face);
  Parameters nodes(81, 2);
  for (Index i = 0; i < 81; ++i) nodes.row(i) << 1 + i % 9, 1 + i / 9;
  // The short edge becomes a hundred times as long, the rest of the side and what is beside it
  // moves along: all by a tenth or two of a millimetre a millimetre.
  const auto displacement = [&](const Eigen::Vector2d& uv) {
    const double x = uv.x();
    if (uv.y() > 1e-9) return x > kSide - 1e-9 ? 3 : 0.3 * x;
    return x <= kShort ? x / kShort : 1 + 2 * (x - kShort) / (kSide - kShort);
  };
  const auto farthest = [&](const FaceDomain& domain) {
    Parameters values = Parameters::Zero(std::ssize(domain.samples()), 2);
    for (Index i = 0; i < values.rows(); ++i) values(i, 0) = displacement(domain.samples()[i].uv);
    const Parameters moved = domain.interpolate(values, nodes);
    return (moved.col(0) - 0.3 * nodes.col(0)).cwiseAbs().maxCoeff();
  };
  const FaceDomain all(model, FaceId(0), 16), asked(model, FaceId(0), 16, Parameters(0, 2), nodes);
  CHECK(farthest(all) > 1.5);
  // The side itself moves by up to 1 more than that.
  CHECK(farthest(asked) < 0.5);
  CHECK(asked.samples().size() > 0.75 * double(all.samples().size()));
}
