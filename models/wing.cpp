#include "models/wing.h"

#include <BRepBuilderAPI_MakeEdge.hxx>
#include <BRepBuilderAPI_MakeWire.hxx>
#include <BRepOffsetAPI_ThruSections.hxx>
#include <GeomAPI_Interpolate.hxx>
#include <Geom_BSplineCurve.hxx>
#include <TColStd_HArray1OfReal.hxx>
#include <TColgp_HArray1OfPnt.hxx>
#include <TopoDS_Wire.hxx>
#include <cmath>
#include <gp_Ax1.hxx>
#include <map>
#include <numbers>

namespace cadmorph::models {
namespace {

using std::numbers::pi;

/// Lengths in millimetres: x from the root's leading edge downstream, y along the span, z up.
struct WingParameters {
  double root_chord, tip_chord, span;
  double sweep, dihedral;    ///< how far the tip's leading edge lies downstream and up
  double tip_twist_deg;      ///< nose down
  double thickness, camber;  ///< parts of the chord
};

WingParameters wing_parameters(double change) {
  const auto from_to = [change](double base, double full) { return std::lerp(base, full, change); };
  return {.root_chord = 1000,
          .tip_chord = from_to(600, 480),
          .span = from_to(1500, 1800),
          .sweep = from_to(300, 550),
          .dihedral = from_to(0, 120),
          .tip_twist_deg = from_to(0, 6),
          .thickness = from_to(0.12, 0.14),
          .camber = from_to(0, 0.02)};
}

/// Point of a profile of chord 1: a NACA four-digit section (camber at 40 %), its trailing edge
/// widened to about 1 %. `along` is -1 at the upper trailing edge, 0 at the nose, 1 at the lower:
/// the square root of x, in which the nose is smooth and the trailing edges are not stationary.
gp_Pnt profile_point(const WingParameters& wing, double along) {
  constexpr double camber_at = 0.4;
  const double x = along * along;
  const double thick = x * (-0.1260 + x * (-0.3516 + x * (0.2843 - 0.1015 * x)));
  const double half = 5 * wing.thickness * (0.2969 * std::abs(along) + thick) + 0.004 * x;
  const double fore = (2 * camber_at - x) * x / (camber_at * camber_at);
  const double aft =
      (1 - 2 * camber_at + (2 * camber_at - x) * x) / ((1 - camber_at) * (1 - camber_at));
  const double mean = wing.camber * (x < camber_at ? fore : aft);
  return {x, 0, mean + (along < 0 ? half : -half)};
}

/// The section at a part `at` of the span: a spline and the straight trailing edge.
TopoDS_Wire section(const WingParameters& wing, double at) {
  constexpr int count = 61;
  const double chord = std::lerp(wing.root_chord, wing.tip_chord, at);
  const double twist = at * wing.tip_twist_deg * pi / 180;
  Handle(TColgp_HArray1OfPnt) points = new TColgp_HArray1OfPnt(1, count);
  Handle(TColStd_HArray1OfReal) parameters = new TColStd_HArray1OfReal(1, count);
  for (int i = 1; i <= count; ++i) {
    const double along = -1 + 2. * (i - 1) / (count - 1);
    gp_Pnt point = profile_point(wing, along);
    point.Scale(gp_Pnt(0, 0, 0), chord);
    point.Rotate(gp_Ax1(gp_Pnt(chord / 4, 0, 0), gp_Dir(0, 1, 0)), -twist);
    point.Translate(gp_Vec(at * wing.sweep, at * wing.span, at * wing.dihedral));
    points->SetValue(i, point);
    parameters->SetValue(i, along);
  }
  GeomAPI_Interpolate spline(points, parameters, false, 1e-9);
  spline.Perform();
  return BRepBuilderAPI_MakeWire(BRepBuilderAPI_MakeEdge(spline.Curve()),
                                 BRepBuilderAPI_MakeEdge(points->Value(count), points->Value(1)));
}

const std::map<std::string, double WingParameters::*> changes = {
    {"sweep", &WingParameters::sweep},
    {"dihedral", &WingParameters::dihedral},
    {"twist", &WingParameters::tip_twist_deg},
    {"thickness", &WingParameters::thickness},
    {"camber", &WingParameters::camber}};

TopoDS_Shape loft(const WingParameters& wing) {
  BRepOffsetAPI_ThruSections sections(true, true);
  sections.CheckCompatibility(false);
  sections.AddWire(section(wing, 0));
  sections.AddWire(section(wing, 1));
  return sections.Shape();
}

}  // namespace

TopoDS_Shape make_wing(double change) { return loft(wing_parameters(change)); }

std::vector<std::string> wing_changes() {
  std::vector<std::string> names;
  for (const auto& [name, parameter] : changes) names.push_back(name);
  return names;
}

TopoDS_Shape make_wing_changed(const std::string& what) {
  const auto parameter = changes.at(what);
  WingParameters wing = wing_parameters(0);
  wing.*parameter = wing_parameters(1).*parameter;
  return loft(wing);
}

}  // namespace cadmorph::models
