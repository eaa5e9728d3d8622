#include <BRepAlgoAPI_Cut.hxx>
#include <BRepBuilderAPI_MakeEdge.hxx>
#include <BRepBuilderAPI_MakeFace.hxx>
#include <BRepBuilderAPI_MakeWire.hxx>
#include <BRepPrimAPI_MakeCylinder.hxx>
#include <BRepPrimAPI_MakePrism.hxx>
#include <Geom_BSplineCurve.hxx>
#include <TColStd_Array1OfInteger.hxx>
#include <TColStd_Array1OfReal.hxx>
#include <TColgp_Array1OfPnt.hxx>
#include <TopoDS.hxx>
#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>
#include <random>

#include "morph_case.h"

using namespace cadmorph;
using namespace cadmorph::testing;
using Eigen::Vector3d;
using std::numbers::pi;

namespace {

constexpr double kChord = 20, kHeight = 20;  // millimetres
constexpr int kAround = 63, kRings = 4, kLayers = 10;

// Closed, its poles on an ellipse: more of them on one side than on the other, so that points that
// face each other across the blade lie at unlike parameters.
Handle(Geom_BSplineCurve) profile(double half_thickness) {
  constexpr int kUpper = 30, kLower = 17, kPoles = kUpper + kLower + 1, kDegree = 3;
  TColgp_Array1OfPnt poles(1, kPoles);
  for (int i = 0; i < kPoles; ++i) {
    const double angle = i <= kUpper ? pi * i / kUpper : pi + pi * (i - kUpper) / kLower;
    poles(i + 1) = gp_Pnt(kChord * std::cos(angle), half_thickness * std::sin(angle), 0);
  }
  poles(kPoles) = poles(1);
  constexpr int kSpans = kPoles - kDegree;
  TColStd_Array1OfReal knots(1, kSpans + 1);
  TColStd_Array1OfInteger multiplicities(1, kSpans + 1);
  for (int i = 0; i <= kSpans; ++i) {
    knots(i + 1) = i;
    multiplicities(i + 1) = i == 0 || i == kSpans ? kDegree + 1 : 1;
  }
  return new Geom_BSplineCurve(poles, knots, multiplicities, kDegree);
}

CadModel blade(const Handle(Geom_BSplineCurve) & section) {
  BRepBuilderAPI_MakeWire wire(BRepBuilderAPI_MakeEdge(section).Edge());
  return to_model(
      BRepPrimAPI_MakePrism(BRepBuilderAPI_MakeFace(wire.Wire()), gp_Vec(0, 0, kHeight)).Shape());
}

struct Rings {
  std::vector<double> parameters, heights;

  int node(int layer, int ring, int around) const {
    return (layer * kRings + ring) * kAround + around % kAround;
  }
  // The nodes on the blade, and those of rings about it.
  Points points(const Geom_BSplineCurve& section) const {
    Points result(static_cast<Index>(heights.size()) * kRings * kAround, 3);
    for (int layer = 0; layer <= kLayers; ++layer)
      for (int ring = 0; ring < kRings; ++ring)
        for (int i = 0; i < kAround; ++i) {
          const gp_Pnt at = section.Value(parameters[i]);
          const double angle = std::atan2(at.Y() * kChord, at.X());
          result.row(node(layer, ring, i)) << at.X() + 12 * ring * std::cos(angle),
              at.Y() + 12 * ring * std::sin(angle), heights[layer];
        }
    return result;
  }
};

// Hexahedra between the rings.
Mesh hexahedra(const Rings& rings, Points points) {
  Mesh mesh;
  mesh.points = std::move(points);
  mesh.offsets = {0};
  for (int layer = 0; layer < kLayers; ++layer)
    for (int ring = 0; ring + 1 < kRings; ++ring)
      for (int i = 0; i < kAround; ++i) {
        for (const int l : {layer, layer + 1})
          for (const auto& [r, a] :
               {std::pair(ring, i), {ring + 1, i}, {ring + 1, i + 1}, {ring, i + 1}})
            mesh.connectivity.push_back(rings.node(l, r, a));
        mesh.types.push_back(CellType::Hexahedron);
        mesh.offsets.push_back(static_cast<Index>(mesh.connectivity.size()));
      }
  return mesh;
}

}  // namespace

TEST_CASE("nodes of a blade of one face stay on their side, far thinner than the mesh is coarse",
          "[surface][association]") {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> shift(0, 0.35);
  const double half_thickness = GENERATE(0.05, 0.1, 0.3);
  const auto base = profile(half_thickness), variant = profile(2 * half_thickness);
  Rings rings;
  for (int i = 0; i < kAround; ++i)
    rings.parameters.push_back((i + shift(random)) / kAround * base->LastParameter());
  for (int layer = 0; layer <= kLayers; ++layer) {
    const bool is_end = layer % kLayers == 0;
    rings.heights.push_back(kHeight / kLayers * (layer + (is_end ? 0 : shift(random))));
  }
  const MorphCase c = mesh_case(blade(base), hexahedra(rings, rings.points(*base)));
  const SurfaceMorphResult result = morph_surface(c, blade(variant));
  const Points expected = surface_points(c.boundary, rings.points(*variant));
  double off = 0;
  int on_blade = 0;
  for (std::size_t n = 0; n < c.boundary.nodes.size(); ++n)
    if (c.boundary.nodes[n] / kAround % kRings == 0) {
      ++on_blade;
      off = std::max(
          off, (result.positions.row(static_cast<Index>(n)) - expected.row(static_cast<Index>(n)))
                   .norm());
    }
  CHECK(on_blade == kAround * (kLayers + 1));
  CHECK(off < 1e-9 * c.diagonal);
}

TEST_CASE("nodes of a round wall stay on their side where chords reach through it",
          "[surface][association]") {
  const auto tube = [](double radius, double wall) {
    const TopoDS_Shape outside = BRepPrimAPI_MakeCylinder(radius, kHeight).Shape();
    return to_model(
        BRepAlgoAPI_Cut(outside, BRepPrimAPI_MakeCylinder(radius - wall, kHeight).Shape()).Shape());
  };
  Rings rings;
  const auto points = [&](double radius, double wall) {
    Points result((kLayers + 1) * kRings * kAround, 3);
    for (int layer = 0; layer <= kLayers; ++layer)
      for (int ring = 0; ring < kRings; ++ring)
        for (int i = 0; i < kAround; ++i) {
          const double angle = 2 * pi * i / kAround, r = radius - wall + wall * ring / (kRings - 1);
          result.row(rings.node(layer, ring, i)) << r * std::cos(angle), r * std::sin(angle),
              kHeight * layer / kLayers;
        }
    return result;
  };
  const double radius = 20, wall = GENERATE(0.01, 0.02, 0.05, 0.1);
  rings.heights.resize(kLayers + 1);
  const MorphCase c = mesh_case(tube(radius, wall), hexahedra(rings, points(radius, wall)));
  const SurfaceMorphResult result = morph_surface(c, tube(1.2 * radius, 1.5 * wall));
  const Points expected = surface_points(c.boundary, points(1.2 * radius, 1.5 * wall));
  double off = 0;
  for (std::size_t n = 0; n < c.boundary.nodes.size(); ++n) {
    const Index ring = c.boundary.nodes[n] / kAround % kRings;
    if (ring == 0 || ring + 1 == kRings)
      off = std::max(
          off, (result.positions.row(static_cast<Index>(n)) - expected.row(static_cast<Index>(n)))
                   .norm());
  }
  CHECK(off < 1e-9 * c.diagonal);
}
