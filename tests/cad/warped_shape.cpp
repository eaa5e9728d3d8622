#include "warped_shape.h"

#include <BRepAdaptor_Surface.hxx>
#include <BRepTools.hxx>
#include <BRepTools_Modifier.hxx>
#include <BRep_Tool.hxx>
#include <BSplCLib.hxx>
#include <Eigen/LU>
#include <Geom2d_Curve.hxx>
#include <GeomAdaptor_Curve.hxx>
#include <GeomAdaptor_Surface.hxx>
#include <Geom_BSplineCurve.hxx>
#include <Geom_BSplineSurface.hxx>
#include <Geom_Curve.hxx>
#include <TColStd_Array1OfInteger.hxx>
#include <TColStd_Array1OfReal.hxx>
#include <TColgp_Array1OfPnt.hxx>
#include <TColgp_Array2OfPnt.hxx>
#include <TopoDS.hxx>
#include <TopoDS_Edge.hxx>
#include <TopoDS_Face.hxx>
#include <algorithm>
#include <cmath>
#include <math_Matrix.hxx>
#include <vector>

#include "mapped_geometry.h"

namespace cadmorph::testing {
namespace {

using Eigen::MatrixXd;
using Eigen::Vector3d;

constexpr int kDegree = 5;
constexpr int kSpans = 28, kLeastSpans = 3;
constexpr double kSameBreak = 1e-6;            // of the range
constexpr GeomAbs_Shape kSmooth = GeomAbs_C3;  // less is kept as a break

Vector3d image(const PointMap& map, const gp_Pnt& p) { return map({p.X(), p.Y(), p.Z()}); }

/// Clamped splines with uniform spans between `breaks` (their ends among them), where they are
/// continuous only, interpolating at Greville's abscissae.
class SplineBasis {
 public:
  explicit SplineBasis(const TColStd_Array1OfReal& breaks) {
    const double first = breaks.First(), last = breaks.Last();
    std::vector<double> ends{first};
    for (int b = breaks.Lower() + 1; b < breaks.Upper(); ++b)
      if (std::min(breaks(b) - ends.back(), last - breaks(b)) > kSameBreak * (last - first))
        ends.push_back(breaks(b));
    ends.push_back(last);
    std::vector<double> flat;
    const auto add = [&](double knot, int multiplicity) {
      knot_list.push_back(knot);
      multiplicity_list.push_back(multiplicity);
      flat.insert(flat.end(), multiplicity, knot);
    };
    add(first, kDegree + 1);
    for (std::size_t b = 1; b < ends.size(); ++b) {
      const double from = ends[b - 1], to = ends[b];
      const int spans = std::max(
          kLeastSpans, static_cast<int>(std::lround(kSpans * (to - from) / (last - first))));
      for (int i = 1; i < spans; ++i) add(from + (to - from) * i / spans, 1);
      add(to, b + 1 == ends.size() ? kDegree + 1 : kDegree);
    }
    knots.Resize(1, static_cast<int>(knot_list.size()), false);
    multiplicities.Resize(1, knots.Length(), false);
    for (int i = 0; i < knots.Length(); ++i) {
      knots(i + 1) = knot_list[static_cast<std::size_t>(i)];
      multiplicities(i + 1) = multiplicity_list[static_cast<std::size_t>(i)];
    }
    count = static_cast<int>(flat.size()) - kDegree - 1;
    TColStd_Array1OfReal all(1, static_cast<int>(flat.size()));
    for (int i = 0; i < all.Length(); ++i) all(i + 1) = flat[static_cast<std::size_t>(i)];
    MatrixXd collocation = MatrixXd::Zero(count, count);
    math_Matrix values(1, 1, 1, kDegree + 1);
    for (int i = 0; i < count; ++i) {
      double sum = 0;
      for (int k = 1; k <= kDegree; ++k) sum += flat[static_cast<std::size_t>(i + k)];
      at.push_back(i == 0 ? first : i == count - 1 ? last : sum / kDegree);
      int begin = 0;
      BSplCLib::EvalBsplineBasis(0, kDegree + 1, all, at.back(), begin, values);
      for (int k = 0; k <= kDegree; ++k) collocation(i, begin - 1 + k) = values(1, k + 1);
    }
    inverse = collocation.inverse();
  }

  TColStd_Array1OfReal knots;
  TColStd_Array1OfInteger multiplicities;
  int count = 0;
  std::vector<double> at;
  MatrixXd inverse;  ///< values at the abscissae -> poles

 private:
  std::vector<double> knot_list;
  std::vector<int> multiplicity_list;
};

/// OCCT finds the breaks of a periodic spline only when it is opened.
Handle(Geom_Curve) opened(const Handle(Geom_Curve) & curve) {
  const auto spline = Handle(Geom_BSplineCurve)::DownCast(curve->Copy());
  if (spline.IsNull() || !spline->IsPeriodic()) return curve;
  spline->SetNotPeriodic();
  return {spline};
}

Handle(Geom_Surface) opened(const Handle(Geom_Surface) & surface) {
  const auto spline = Handle(Geom_BSplineSurface)::DownCast(surface->Copy());
  if (spline.IsNull()) return surface;
  spline->SetUNotPeriodic();
  spline->SetVNotPeriodic();
  return {spline};
}

/// Where a curve's derivatives jump, and its ends.
TColStd_Array1OfReal curve_breaks(const Handle(Geom_Curve) & curve, double first, double last) {
  const GeomAdaptor_Curve adaptor(opened(curve), first, last);
  TColStd_Array1OfReal breaks(1, adaptor.NbIntervals(kSmooth) + 1);
  adaptor.Intervals(breaks, kSmooth);
  return breaks;
}

Handle(Geom_BSplineSurface) warp_surface(const TopoDS_Face& face, const PointMap& map) {
  double u1, u2, v1, v2;
  BRepTools::UVBounds(face, u1, u2, v1, v2);
  const BRepAdaptor_Surface surface(face, false);
  const GeomAdaptor_Surface trimmed(opened(BRep_Tool::Surface(face)), u1, u2, v1, v2);
  TColStd_Array1OfReal u_breaks(1, trimmed.NbUIntervals(kSmooth) + 1),
      v_breaks(1, trimmed.NbVIntervals(kSmooth) + 1);
  trimmed.UIntervals(u_breaks, kSmooth);
  trimmed.VIntervals(v_breaks, kSmooth);
  const SplineBasis u(u_breaks), v(v_breaks);
  MatrixXd values[3];
  for (auto& x : values) x.resize(u.count, v.count);
  for (int i = 0; i < u.count; ++i)
    for (int j = 0; j < v.count; ++j) {
      const Vector3d x = image(map, surface.Value(u.at[i], v.at[j]));
      for (int k = 0; k < 3; ++k) values[k](i, j) = x[k];
    }
  for (auto& x : values) x = u.inverse * x * v.inverse.transpose();
  TColgp_Array2OfPnt poles(1, u.count, 1, v.count);
  for (int i = 0; i < u.count; ++i)
    for (int j = 0; j < v.count; ++j)
      poles(i + 1, j + 1) = gp_Pnt(values[0](i, j), values[1](i, j), values[2](i, j));
  return new Geom_BSplineSurface(poles, u.knots, v.knots, u.multiplicities, v.multiplicities,
                                 kDegree, kDegree);
}

Handle(Geom_BSplineCurve)
    warp_curve(const Handle(Geom_Curve) & curve, double first, double last, const PointMap& map) {
  const SplineBasis t(curve_breaks(curve, first, last));
  MatrixXd values(t.count, 3);
  for (int i = 0; i < t.count; ++i) values.row(i) = image(map, curve->Value(t.at[i]));
  values = t.inverse * values;
  TColgp_Array1OfPnt poles(1, t.count);
  for (int i = 0; i < t.count; ++i) poles(i + 1) = gp_Pnt(values(i, 0), values(i, 1), values(i, 2));
  return new Geom_BSplineCurve(poles, t.knots, t.multiplicities, kDegree);
}

class Warp : public MappedGeometry {
 public:
  explicit Warp(PointMap map) : MappedGeometry(std::move(map)) {}

  Standard_Boolean NewSurface(const TopoDS_Face& face, Handle(Geom_Surface) & surface,
                              TopLoc_Location& location, Standard_Real& tolerance,
                              Standard_Boolean& reverses_wires,
                              Standard_Boolean& reverses_face) override {
    surface = warp_surface(face, map_);
    location.Identity();
    tolerance = BRep_Tool::Tolerance(face);
    reverses_wires = reverses_face = false;
    return true;
  }

  Standard_Boolean NewCurve(const TopoDS_Edge& edge, Handle(Geom_Curve) & curve,
                            TopLoc_Location& location, Standard_Real& tolerance) override {
    double first, last;
    const Handle(Geom_Curve) old = BRep_Tool::Curve(edge, first, last);
    curve = nullptr;
    if (!old.IsNull()) curve = warp_curve(old, first, last, map_);
    location.Identity();
    tolerance = BRep_Tool::Tolerance(edge);
    return true;
  }

  Standard_Boolean NewCurve2d(const TopoDS_Edge& edge, const TopoDS_Face& face, const TopoDS_Edge&,
                              const TopoDS_Face&, Handle(Geom2d_Curve) & curve,
                              Standard_Real& tolerance) override {
    double first, last;
    tolerance = BRep_Tool::Tolerance(edge);
    curve = BRep_Tool::CurveOnSurface(edge, face, first, last);
    if (curve.IsNull()) return false;
    curve = Handle(Geom2d_Curve)::DownCast(curve->Copy());
    return true;
  }
};

}  // namespace

TopoDS_Shape warped(const TopoDS_Shape& shape, const PointMap& map) {
  BRepTools_Modifier modifier(shape, new Warp(map));
  return modifier.ModifiedShape(shape);
}

}  // namespace cadmorph::testing
