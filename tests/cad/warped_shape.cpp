#include "warped_shape.h"

#include <BRepAdaptor_Surface.hxx>
#include <BRepTools.hxx>
#include <BRepTools_Modifier.hxx>
#include <BRep_Tool.hxx>
#include <BSplCLib.hxx>
#include <Eigen/LU>
#include <Geom2d_Curve.hxx>
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
#include <math_Matrix.hxx>
#include <vector>

#include "mapped_geometry.h"

namespace cadmorph::testing {
namespace {

using Eigen::MatrixXd;
using Eigen::Vector3d;

constexpr int kDegree = 5;
constexpr int kSpans = 28;

Vector3d image(const PointMap& map, const gp_Pnt& p) { return map({p.X(), p.Y(), p.Z()}); }

/// Clamped splines with uniform spans on [first, last], interpolating at Greville's abscissae.
class SplineBasis {
 public:
  SplineBasis(double first, double last)
      : knots(1, kSpans + 1), multiplicities(1, kSpans + 1), count(kSpans + kDegree) {
    std::vector<double> flat(kDegree, first);
    for (int i = 0; i <= kSpans; ++i) {
      knots(i + 1) = i == kSpans ? last : first + (last - first) * i / kSpans;
      multiplicities(i + 1) = i == 0 || i == kSpans ? kDegree + 1 : 1;
      flat.push_back(knots(i + 1));
    }
    flat.insert(flat.end(), kDegree, last);
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
  int count;
  std::vector<double> at;
  MatrixXd inverse;  ///< values at the abscissae -> poles
};

Handle(Geom_BSplineSurface) warp_surface(const TopoDS_Face& face, const PointMap& map) {
  double u1, u2, v1, v2;
  BRepTools::UVBounds(face, u1, u2, v1, v2);
  const SplineBasis u(u1, u2), v(v1, v2);
  const BRepAdaptor_Surface surface(face, false);
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
  const SplineBasis t(first, last);
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
