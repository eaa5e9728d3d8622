#include <BRepBuilderAPI_MakeEdge.hxx>
#include <BRepBuilderAPI_MakeFace.hxx>
#include <BRepBuilderAPI_MakeWire.hxx>
#include <GeomAPI_Interpolate.hxx>
#include <Geom_BSplineCurve.hxx>
#include <TColgp_HArray1OfPnt.hxx>
#include <TopoDS.hxx>
#include <TopoDS_Face.hxx>
#include <TopoDS_Wire.hxx>
#include <catch2/catch.hpp>
#include <cmath>
#include <gp_Circ.hxx>
#include <numbers>

#include "core/layer_heights.h"
#include "core/quality.h"
#include "morph_case.h"

using namespace cadmorph;
using namespace cadmorph::testing;
using Eigen::Vector2d;
using std::numbers::pi;

namespace {

constexpr double kHalfChord = 10, kFar = 100;
constexpr int kAround = 150, kLayers = 60;

// An ellipse's spline, turned.
Handle(Geom_BSplineCurve) body(double half_thickness, double degrees) {
  constexpr int kPoints = 41;
  const double turn = degrees * pi / 180;
  Handle(TColgp_HArray1OfPnt) points = new TColgp_HArray1OfPnt(1, kPoints - 1);
  for (int i = 0; i + 1 < kPoints; ++i) {
    const double angle = 2 * pi * i / (kPoints - 1);
    const Vector2d at(kHalfChord * std::cos(angle), half_thickness * std::sin(angle));
    const Vector2d turned = Eigen::Rotation2Dd(turn) * at;
    points->SetValue(i + 1, gp_Pnt(turned.x(), turned.y(), 0));
  }
  GeomAPI_Interpolate spline(points, true, 1e-9);
  spline.Perform();
  return spline.Curve();
}

CadModel air_around(const Handle(Geom_BSplineCurve) & section) {
  const gp_Circ rim(gp_Ax2(gp_Pnt(0, 0, 0), gp_Dir(0, 0, 1)), kFar);
  BRepBuilderAPI_MakeWire outer(BRepBuilderAPI_MakeEdge(rim).Edge()),
      inner(BRepBuilderAPI_MakeEdge(section).Edge());
  BRepBuilderAPI_MakeFace face(outer.Wire(), true);
  face.Add(TopoDS::Wire(inner.Wire().Reversed()));
  return to_model(face.Face());
}

// Quads from the body to the rim, close together at its ends; the first ones 1e-6 high.
Mesh layers_around(const Geom_BSplineCurve& section) {
  Mesh mesh;
  mesh.points.resize(kAround * (kLayers + 1), 3);
  const double growth = std::pow(kFar / 1e-6 / 4, 1.0 / kLayers);
  for (int i = 0; i < kAround; ++i) {
    const double s = double(i) / kAround, t = s - 0.9 * std::sin(4 * pi * s) / (4 * pi);
    const gp_Pnt at = section.Value(t * section.LastParameter());
    const Vector2d from(at.X(), at.Y());
    const Vector2d to = kFar * Vector2d(from.x(), 5 * from.y()).normalized();
    for (int k = 0; k <= kLayers; ++k) {
      const double part = (std::pow(growth, k) - 1) / (std::pow(growth, kLayers) - 1);
      mesh.points.row(i * (kLayers + 1) + k) << ((1 - part) * from + part * to).transpose(), 0;
    }
  }
  for (int i = 0; i < kAround; ++i)
    for (int k = 0; k < kLayers; ++k) {
      const Index a = i * (kLayers + 1) + k, b = (i + 1) % kAround * (kLayers + 1) + k;
      add_cell(mesh, CellType::Quad, std::vector<Index>{a, a + 1, b + 1, b});
    }
  return mesh;
}

LayerFigures layers_of_valid_morph(const MorphCase& c, const CadModel& variant) {
  const Points after = morph(c, variant).points;
  CHECK(measure_quality(c.mesh, after, detect_orientation(c.mesh)).inverted == 0);
  return measure_layers(c.mesh, find_cell_neighbours(c.mesh),
                        std::vector<char>(c.mesh.node_count(), 1), c.mesh.points, after);
}

}  // namespace

TEST_CASE("Layers far thinner than the nodes of a body are apart keep their heights when it turns",
          "[surface]") {
  const auto base = body(1, 0);
  const MorphCase c = mesh_case(air_around(base), layers_around(*base));
  const double degrees = GENERATE(3, 10);
  const LayerFigures layers = layers_of_valid_morph(c, air_around(body(1, degrees)));
  CHECK(layers.cells == kAround);
  CHECK(layers.share_kept >= 0.99);
  CHECK(layers.least > 0.95);
  CHECK(layers.most < 1.05);
}

TEST_CASE("Layers far thinner than the nodes of a body are apart follow its thickness",
          "[surface]") {
  const auto base = body(1, 0);
  const MorphCase c = mesh_case(air_around(base), layers_around(*base));
  const LayerFigures layers = layers_of_valid_morph(c, air_around(body(1.3, 0)));
  CHECK(layers.least > 0.75);
  CHECK(layers.most < 1.35);
}
