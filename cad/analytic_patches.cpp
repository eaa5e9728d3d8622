#include "cad/analytic_patches.h"

#include <BRepBuilderAPI_Copy.hxx>
#include <BRepTools_ReShape.hxx>
#include <BRep_Builder.hxx>
#include <BRep_Tool.hxx>
#include <ElSLib.hxx>
#include <Geom2d_BSplineCurve.hxx>
#include <GeomAdaptor_Curve.hxx>
#include <GeomAdaptor_Surface.hxx>
#include <Geom_BoundedSurface.hxx>
#include <Geom_ConicalSurface.hxx>
#include <Geom_CylindricalSurface.hxx>
#include <Geom_ElementarySurface.hxx>
#include <Geom_Plane.hxx>
#include <Geom_SphericalSurface.hxx>
#include <TColStd_Array1OfInteger.hxx>
#include <TColStd_Array1OfReal.hxx>
#include <TColgp_Array1OfPnt2d.hxx>
#include <TopExp.hxx>
#include <TopExp_Explorer.hxx>
#include <TopTools_IndexedMapOfShape.hxx>
#include <TopoDS.hxx>
#include <TopoDS_Edge.hxx>
#include <TopoDS_Face.hxx>
#include <TopoDS_Iterator.hxx>
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <gp_Lin.hxx>
#include <gp_Pln.hxx>
#include <numbers>
#include <optional>
#include <utility>
#include <vector>

#include "cad/face_pieces.h"

namespace cadmorph {
namespace {

using Surface = Handle(Geom_ElementarySurface);

constexpr double kHalfTurn = std::numbers::pi, kTurn = 2 * kHalfTurn;
constexpr double kSmallestArc = 0.01;  // radians: of less, rounding leaves the axis unsure
// Of half a turn, or of a patch, by which an edge at its end may be off: a hundred times what files
// keep.
constexpr double kAtEnd = 1e-5;
// Of a span between two knots: cubics laid along circles meet them at the ends and in the middle,
// not a third from there.
constexpr int kChecksASpan = 3;
constexpr int kAngles = 32;  // of a patch; between two, far less than half a turn, however it runs
// Of the tolerance, how far a pcurve that is made anew may be off: it adds little to what the edge
// is off. And how often a span of its edge is halved for that at most: quarters of rational circles
// need four times.
constexpr double kPcurve = 0.1;
constexpr int kMostHalvings = 8;
// Of a face's area: as exactly as OCCT integrates over a rational patch. A wrong side is far more.
constexpr double kSameArea = 0.02;
// Of the radius: nearer to the axis, the 1e-7 that files keep leave an angle unsure by 1e-3
// radians.
constexpr double kNearAxis = 1e-4;

gp_Pnt point_at(const Geom_Surface& surface, int round, double along, double other) {
  return round == 0 ? surface.Value(along, other) : surface.Value(other, along);
}

// Bounds of a parameter, and its values where the surface is to be looked at.
struct Range {
  double first = 0, last = 0;
  std::vector<double> checks;

  Range(const Handle(Geom_Surface) & surface, int direction) {
    double bounds[4];
    surface->Bounds(bounds[0], bounds[1], bounds[2], bounds[3]);
    first = bounds[2 * direction];
    last = bounds[2 * direction + 1];
    const GeomAdaptor_Surface adaptor(surface);
    const int spans =
        direction == 0 ? adaptor.NbUIntervals(GeomAbs_CN) : adaptor.NbVIntervals(GeomAbs_CN);
    TColStd_Array1OfReal knots(1, spans + 1);
    direction == 0 ? adaptor.UIntervals(knots, GeomAbs_CN) : adaptor.VIntervals(knots, GeomAbs_CN);
    for (int i = 1; i <= spans; ++i)
      for (int k = 0; k < kChecksASpan; ++k)
        checks.push_back(knots(i) + (knots(i + 1) - knots(i)) * k / kChecksASpan);
    checks.push_back(last);
  }

  double at(double part) const { return first + part * (last - first); }
};

// The axis of the circle through three points; nothing for those on a line.
std::optional<gp_Lin> axis_through(const std::array<gp_Pnt, 3>& points) {
  const gp_Vec a(points[0], points[1]), b(points[0], points[2]);
  const gp_Vec normal = a.Crossed(b);
  const double twice_area = normal.Magnitude();
  // The angle at the first point is half of the arc's, from the second to the third.
  if (twice_area <= kSmallestArc * a.Magnitude() * b.Magnitude() / 8) return std::nullopt;
  const gp_Vec to_centre =
      (b.SquareMagnitude() * normal.Crossed(a) - a.SquareMagnitude() * normal.Crossed(b)) /
      (2 * twice_area * twice_area);
  return gp_Lin(points[0].Translated(to_centre), gp_Dir(normal));
}

// The point of a surface that goes round an axis in the half-plane of a meridian.
struct ProfilePoint {
  double radius, height;
};

ProfilePoint in_profile(const gp_Lin& axis, const gp_Pnt& point) {
  return {axis.Distance(point), gp_Vec(axis.Location(), point).Dot(gp_Vec(axis.Direction()))};
}

// The cylinder, cone or sphere about the axis (which points upward) through three points, from low
// to high; its angles begin at `begin`. Null where there is none.
Surface surface_through(const gp_Lin& axis, const std::array<ProfilePoint, 3>& profile,
                        const gp_Dir& begin, double tolerance) {
  const auto& [low, middle, high] = profile;
  const double rise = high.height - low.height, widening = high.radius - low.radius;
  if (rise <= tolerance) return {};
  const auto frame_at = [&](double height) {
    const gp_Dir up = axis.Direction();
    return gp_Ax3(axis.Location().Translated(height * gp_Vec(up)), up, begin);
  };
  const double part = (middle.height - low.height) / rise;
  if (std::abs(low.radius + part * widening - middle.radius) <= tolerance) {
    if (std::abs(widening) <= tolerance)
      return new Geom_CylindricalSurface(frame_at(low.height), middle.radius);
    const auto& [radius, height] = std::max(low.radius, high.radius) == low.radius ? low : high;
    return new Geom_ConicalSurface(frame_at(height), std::atan2(widening, rise), radius);
  }
  const double centre = (low.height + high.height) / 2 +
                        (high.radius * high.radius - low.radius * low.radius) / (2 * rise);
  return new Geom_SphericalSurface(frame_at(centre), std::hypot(low.radius, low.height - centre));
}

// A piece of a surface of revolution: one parameter goes round, the other along a meridian. Or of
// a plane, where these names mean nothing.
struct Patch {
  Handle(Geom_Surface) source;
  Surface surface;
  int round = 0;      // which parameter goes round
  double widest = 0;  // the other one, where the patch is farthest from the axis
  Range ring, meridian;

  gp_Pnt point(double along, double other) const { return point_at(*source, round, along, other); }
};

// The parameters of the nearest point of a plane, cylinder, cone or sphere.
gp_Pnt2d parameters(const Surface& surface, const gp_Pnt& point) {
  double u = 0, v = 0;
  if (const auto cylinder = Handle(Geom_CylindricalSurface)::DownCast(surface); !cylinder.IsNull())
    ElSLib::Parameters(cylinder->Cylinder(), point, u, v);
  else if (const auto cone = Handle(Geom_ConicalSurface)::DownCast(surface); !cone.IsNull())
    ElSLib::Parameters(cone->Cone(), point, u, v);
  else if (const auto plane = Handle(Geom_Plane)::DownCast(surface); !plane.IsNull())
    ElSLib::Parameters(plane->Pln(), point, u, v);
  else if (const auto ball = Handle(Geom_SphericalSurface)::DownCast(surface); !ball.IsNull())
    ElSLib::Parameters(ball->Sphere(), point, u, v);
  return {u, v};
}

double distance(const Surface& surface, const gp_Pnt& point) {
  const gp_Pnt2d at = parameters(surface, point);
  return surface->Value(at.X(), at.Y()).Distance(point);
}

// The angle of a point on a surface, within half a turn of `near`.
double angle_of(const Surface& surface, const gp_Pnt& point, double near) {
  const double angle = parameters(surface, point).X();
  return angle + kTurn * std::round((near - angle) / kTurn);
}

// Angles of a patch on the surface that it lies on, alone or with others: without jumps, wherever
// these begin.
class Angles {
 public:
  Angles(const Patch& patch, const Surface& surface) : patch_(patch), surface_(surface) {
    double last = 0;
    for (int i = 0; i <= kAngles; ++i)
      angles_.push_back(last = angle_of(surface, ring_point(patch.ring.at(part(i))), last));
    const double middle = (angles_.front() + angles_.back()) / 2;
    for (double& angle : angles_) angle -= kTurn * std::floor(middle / kTurn);
  }

  double first() const { return angles_.front(); }
  double last() const { return angles_.back(); }

  double at(double along) const { return angle_of(surface_, ring_point(along), roughly(along)); }

  // That of a point of the patch, there or nearby.
  double of(const gp_Pnt& point, double along) const {
    return angle_of(surface_, point, roughly(along));
  }

  bool is_rising_or_falling() const {
    const auto is_not_above = [](double a, double b) { return b <= a; };
    const auto is_not_below = [](double a, double b) { return b >= a; };
    return std::ranges::adjacent_find(angles_, is_not_above) == angles_.end() ||
           std::ranges::adjacent_find(angles_, is_not_below) == angles_.end();
  }

 private:
  static double part(int i) { return static_cast<double>(i) / kAngles; }

  gp_Pnt ring_point(double along) const { return patch_.point(along, patch_.widest); }

  double roughly(double along) const {
    const Range& ring = patch_.ring;
    const double place =
        std::clamp((along - ring.first) / (ring.last - ring.first), 0.0, 1.0) * kAngles;
    const auto i = std::min(static_cast<std::size_t>(place), std::size_t(kAngles - 1));
    return angles_[i] + (place - static_cast<double>(i)) * (angles_[i + 1] - angles_[i]);
  }

  const Patch& patch_;
  Surface surface_;
  std::vector<double> angles_;
};

// Whether the patch lies on its surface, and its lines go round and along meridians.
bool is_sound(const Patch& patch, double tolerance) {
  const Angles angles(patch, patch.surface);
  const double arc = std::abs(angles.last() - angles.first());
  if (!angles.is_rising_or_falling() || arc < kSmallestArc || arc > kTurn + kAtEnd) return false;
  const gp_Lin axis(patch.surface->Axis());
  for (const double along : patch.ring.checks) {
    const double angle = angles.at(along);
    for (const double other : patch.meridian.checks) {
      const gp_Pnt point = patch.point(along, other);
      if (distance(patch.surface, point) > tolerance) return false;
      const double turn = angles.of(point, along) - angle, radius = axis.Distance(point);
      if (radius > tolerance && std::abs(turn) * radius > tolerance) return false;
    }
  }
  return true;
}

// The surface as a patch that goes round by the parameter `round`, if it is one.
std::optional<Patch> round_patch(const Handle(Geom_Surface) & surface, int round,
                                 double tolerance) {
  if (surface.IsNull() || !surface->IsKind(STANDARD_TYPE(Geom_BoundedSurface))) return std::nullopt;
  const auto circle_at = [&](double other, const Range& ring) -> std::optional<gp_Lin> {
    const auto point = [&](double part) { return point_at(*surface, round, ring.at(part), other); };
    return axis_through({point(0), point(0.37), point(0.71)});
  };
  Range ring(surface, round), meridian(surface, 1 - round);
  const std::array<double, 3> others{meridian.first, meridian.at(0.5), meridian.last};
  const auto first_axis = circle_at(others[1], ring);
  if (!first_axis) return std::nullopt;
  const auto radius = [&](double other) {
    return first_axis->Distance(point_at(*surface, round, ring.first, other));
  };
  const double widest = *std::ranges::max_element(others, {}, radius);
  auto axis = circle_at(widest, ring);
  if (!axis) return std::nullopt;
  std::array<ProfilePoint, 3> profile;
  const auto measure = [&] {
    std::ranges::transform(others, profile.begin(), [&](double other) {
      return in_profile(*axis, point_at(*surface, round, ring.first, other));
    });
  };
  measure();
  if (profile.front().height > profile.back().height) {
    axis->Reverse();
    measure();
  }
  const gp_Pnt begin = point_at(*surface, round, ring.first, widest);
  const gp_Vec outward = gp_Vec(axis->Location(), begin);
  const auto found = surface_through(*axis, profile, gp_Dir(outward), tolerance);
  if (found.IsNull()) return std::nullopt;
  Patch patch{surface, found, round, widest, std::move(ring), std::move(meridian)};
  if (!is_sound(patch, tolerance)) return std::nullopt;
  return patch;
}

std::optional<Patch> round_patch(const Handle(Geom_Surface) & surface, double tolerance) {
  auto patch = round_patch(surface, 0, tolerance);
  return patch ? patch : round_patch(surface, 1, tolerance);
}

// The surface as a patch of a plane, if it is one.
std::optional<Patch> flat_patch(const Handle(Geom_Surface) & surface, double tolerance) {
  if (surface.IsNull() || !surface->IsKind(STANDARD_TYPE(Geom_BoundedSurface))) return std::nullopt;
  Range u(surface, 0), v(surface, 1);
  gp_Pnt middle;
  gp_Vec du, dv;
  surface->D1(u.at(0.5), v.at(0.5), middle, du, dv);
  const gp_Vec normal = du.Crossed(dv);
  if (normal.Magnitude() <= kSmallestArc * du.Magnitude() * dv.Magnitude()) return std::nullopt;
  const gp_Pln plane(gp_Ax3(middle, gp_Dir(normal), gp_Dir(du)));
  for (const double at_u : u.checks)
    for (const double at_v : v.checks)
      if (plane.Distance(surface->Value(at_u, at_v)) > tolerance) return std::nullopt;
  const double widest = v.at(0.5);
  return Patch{surface, new Geom_Plane(plane), 0, widest, std::move(u), std::move(v)};
}

// A face, and the round surface that it has, or that its patch is found to be a piece of.
struct AnalyticFace {
  explicit AnalyticFace(const TopoDS_Shape& shape)
      : face(in_own_frame(shape)), surface(Surface::DownCast(BRep_Tool::Surface(face))) {}

  void find_round_patch(double tolerance) {
    if (surface.IsNull()) use(round_patch(BRep_Tool::Surface(face), tolerance));
  }

  void find_patch(double tolerance) {
    find_round_patch(tolerance);
    if (surface.IsNull()) use(flat_patch(BRep_Tool::Surface(face), tolerance));
  }

  void use(std::optional<Patch> found) {
    patch = std::move(found);
    if (patch) surface = patch->surface;
  }

  TopoDS_Face face;
  std::optional<Patch> patch;
  Surface surface;  // null where it is neither
};

bool lies_on(const Patch& patch, const Surface& surface, double tolerance) {
  if (surface->DynamicType() != patch.surface->DynamicType()) return false;
  for (const double part : {0.0, 0.5, 1.0})
    for (const double other : {0.0, 0.5, 1.0})
      if (distance(surface, patch.point(patch.ring.at(part), patch.meridian.at(other))) > tolerance)
        return false;
  return true;
}

bool are_one(const AnalyticFace& a, const AnalyticFace& b, double tolerance) {
  if (a.surface.IsNull() || b.surface.IsNull() || !(a.patch || b.patch)) return false;
  return (!a.patch || lies_on(*a.patch, b.surface, tolerance)) &&
         (!b.patch || lies_on(*b.patch, a.surface, tolerance));
}

using Path = std::function<gp_Pnt2d(double)>;

// A curve of cubic pieces along a path on a surface.
class PathCurve {
 public:
  PathCurve(Path path, const Surface& surface, double tolerance)
      : path_(std::move(path)), surface_(surface), tolerance_(tolerance) {}

  void add(double first, double last) {
    if (poles_.empty()) {
      knots_.push_back(first);
      poles_.push_back(path_(first).XY());
    }
    add_pieces(first, last, kMostHalvings);
  }

  Handle(Geom2d_Curve) curve() const {
    const int pieces = static_cast<int>(knots_.size()) - 1;
    TColgp_Array1OfPnt2d poles(1, 3 * pieces + 1);
    TColStd_Array1OfReal knots(1, pieces + 1);
    TColStd_Array1OfInteger multiplicities(1, pieces + 1);
    multiplicities.Init(3);
    multiplicities.ChangeFirst() = multiplicities.ChangeLast() = 4;
    for (int i = 0; i < poles.Size(); ++i) poles(i + 1) = gp_Pnt2d(poles_[i]);
    for (int i = 0; i < knots.Size(); ++i) knots(i + 1) = knots_[i];
    return new Geom2d_BSplineCurve(poles, knots, multiplicities, 3);
  }

 private:
  // Through four points of the path each, halved where that is too far off.
  void add_pieces(double first, double last, int halvings) {
    const double third = (last - first) / 3;
    const std::array<gp_XY, 4> at{poles_.back(), path_(first + third).XY(),
                                  path_(last - third).XY(), path_(last).XY()};
    const std::array<gp_XY, 3> next{(-5 * at[0] + 18 * at[1] - 9 * at[2] + 2 * at[3]) / 6,
                                    (2 * at[0] - 9 * at[1] + 18 * at[2] - 5 * at[3]) / 6, at[3]};
    const auto is_off = [&](double part) {
      const double rest = 1 - part;
      const gp_XY place = rest * rest * rest * at[0] + 3 * rest * rest * part * next[0] +
                          3 * rest * part * part * next[1] + part * part * part * next[2];
      return point(place).Distance(point(path_(first + part * (last - first)).XY())) > tolerance_;
    };
    if (halvings > 0 && (is_off(1.0 / 6) || is_off(0.5) || is_off(5.0 / 6))) {
      const double middle = (first + last) / 2;
      add_pieces(first, middle, halvings - 1);
      add_pieces(middle, last, halvings - 1);
      return;
    }
    poles_.insert(poles_.end(), next.begin(), next.end());
    knots_.push_back(last);
  }

  gp_Pnt point(const gp_XY& at) const { return surface_->Value(at.X(), at.Y()); }

  Path path_;
  Surface surface_;
  double tolerance_;
  std::vector<double> knots_;
  std::vector<gp_XY> poles_;
};

// Ends of the spans of a curve, between which it is smooth.
std::vector<double> spans_of(const Handle(Geom_Curve) & curve, double first, double last) {
  const GeomAdaptor_Curve adaptor(curve, first, last);
  TColStd_Array1OfReal knots(1, adaptor.NbIntervals(GeomAbs_CN) + 1);
  adaptor.Intervals(knots, GeomAbs_CN);
  return {knots.begin(), knots.end()};
}

// A face's way onto the surface that it lies on with others.
class Mover {
 public:
  Mover(const Patch& patch, const TopoDS_Face& face, const Surface& surface, double tolerance)
      : patch_(patch), face_(face), surface_(surface), tolerance_(tolerance) {
    if (!surface->IsKind(STANDARD_TYPE(Geom_Plane))) angles_.emplace(patch, surface);
  }

  // Null where the edge has no pcurve.
  Handle(Geom2d_Curve) pcurve(const TopoDS_Edge& edge) const {
    double first = 0, last = 0;
    const Handle(Geom2d_Curve) old = BRep_Tool::CurveOnSurface(edge, face_, first, last);
    if (old.IsNull()) return {};
    double curve_first = 0, curve_last = 0;
    const Handle(Geom_Curve) curve = BRep_Tool::Curve(edge, curve_first, curve_last);
    const bool is_point = curve.IsNull() || BRep_Tool::Degenerated(edge);
    const Path path = [&](double t) {
      return is_point ? moved(old->Value(t)) : moved(old->Value(t), curve->Value(t));
    };
    const std::vector<double> ends =
        is_point ? std::vector{first, last} : spans_of(curve, first, last);
    PathCurve result(path, surface_, kPcurve * tolerance_);
    for (std::size_t i = 1; i < ends.size(); ++i) result.add(ends[i - 1], ends[i]);
    return result.curve();
  }

  // Whether the new surface looks the other way.
  bool is_turned_over() const {
    const double along = patch_.ring.at(0.5), other = patch_.widest;
    gp_Pnt point;
    gp_Vec du, dv, new_du, new_dv;
    patch_.round == 0 ? patch_.source->D1(along, other, point, du, dv)
                      : patch_.source->D1(other, along, point, du, dv);
    const gp_Pnt2d at = parameters(surface_, point);
    surface_->D1(at.X(), at.Y(), point, new_du, new_dv);
    return du.Crossed(dv).Dot(new_du.Crossed(new_dv)) < 0;
  }

 private:
  gp_Pnt2d moved(const gp_Pnt2d& old) const {
    const gp_Pnt point = patch_.source->Value(old.X(), old.Y());
    if (!angles_) return parameters(surface_, point);
    const double height = parameters(surface_, point).Y();
    return {angles_->at(old.Coord(patch_.round + 1)), height};
  }

  gp_Pnt2d moved(const gp_Pnt2d& old, const gp_Pnt& point) const {
    if (!angles_) return parameters(surface_, point);
    const double along = old.Coord(patch_.round + 1);
    const gp_Lin axis(surface_->Axis());
    const bool is_near_axis =
        axis.Distance(point) < kNearAxis * axis.Distance(patch_.point(along, patch_.widest));
    const double height = parameters(surface_, point).Y();
    return {is_near_axis ? angles_->at(along) : angles_->of(point, along), height};
  }

  const Patch& patch_;
  TopoDS_Face face_;
  Surface surface_;
  double tolerance_;
  std::optional<Angles> angles_;  // not of a plane
};

// The face on a copy of the surface, by the same wires: an edge between two faces of one surface
// has one pcurve, but may end a turn in one of them and begin it in the other. Null where an edge
// has no pcurve, or the face comes out as another one.
TopoDS_Face moved_onto(const AnalyticFace& piece, const Surface& shared, double tolerance) {
  const Surface surface = Surface::DownCast(shared->Copy());
  const Mover mover(*piece.patch, piece.face, surface, tolerance);
  const bool is_turned_over = mover.is_turned_over();
  BRep_Builder builder;
  TopoDS_Face result;
  builder.MakeFace(result, surface, BRep_Tool::Tolerance(piece.face));
  const TopLoc_Location none;
  for (TopExp_Explorer each(piece.face, TopAbs_EDGE); each.More(); each.Next()) {
    const TopoDS_Edge forward = TopoDS::Edge(each.Current().Oriented(TopAbs_FORWARD));
    const TopoDS_Edge backward = TopoDS::Edge(forward.Reversed());
    const double off = BRep_Tool::Tolerance(forward);
    // Of a seam, the curve of its forward use comes first; face and uses are turned over together.
    const Handle(Geom2d_Curve) curve = mover.pcurve(is_turned_over ? backward : forward);
    if (curve.IsNull()) return {};
    if (BRep_Tool::IsClosed(forward, piece.face))
      builder.UpdateEdge(forward, curve, mover.pcurve(is_turned_over ? forward : backward), surface,
                         none, off);
    else
      builder.UpdateEdge(forward, curve, surface, none, off);
    double first = 0, last = 0;
    BRep_Tool::Range(forward, piece.face, first, last);
    builder.Range(forward, surface, none, first, last);
  }
  for (TopoDS_Iterator wire(piece.face); wire.More(); wire.Next())
    builder.Add(result, is_turned_over ? wire.Value().Reversed() : wire.Value());
  if (is_turned_over) result.Reverse();
  const double before = area(piece.face);
  return std::abs(area(result) - before) < kSameArea * before ? result : TopoDS_Face();
}

// The shape with faces on the surfaces given, by their numbers less one; null leaves a face as is.
TopoDS_Shape with_surfaces(const TopoDS_Shape& shape, std::vector<AnalyticFace>& pieces,
                           const std::vector<Surface>& surfaces, double tolerance) {
  if (std::ranges::all_of(surfaces, &Surface::IsNull)) return shape;
  constexpr bool copies_geometry = false;
  const TopoDS_Shape copy = BRepBuilderAPI_Copy(shape, copies_geometry).Shape();
  TopTools_IndexedMapOfShape copies;
  TopExp::MapShapes(copy, TopAbs_FACE, copies);
  const Handle(BRepTools_ReShape) changes = new BRepTools_ReShape;
  for (std::size_t i = 0; i < pieces.size(); ++i) {
    if (surfaces[i].IsNull() || !pieces[i].patch) continue;
    pieces[i].face = in_own_frame(copies(static_cast<int>(i) + 1));
    const TopoDS_Face moved = moved_onto(pieces[i], surfaces[i], tolerance);
    if (!moved.IsNull()) changes->Replace(pieces[i].face, moved);
  }
  return changes->Apply(copy);
}

}  // namespace

bool is_at_end_of_patch(const TopoDS_Edge& edge, const TopoDS_Face& face, double tolerance) {
  TopLoc_Location place;
  const Handle(Geom_Surface) surface = BRep_Tool::Surface(face, place);
  if (surface.IsNull() || !surface->IsKind(STANDARD_TYPE(Geom_BoundedSurface))) return false;
  double first = 0, last = 0;
  const Handle(Geom2d_Curve) curve = BRep_Tool::CurveOnSurface(edge, face, first, last);
  if (curve.IsNull()) return false;
  double low[2], high[2];
  surface->Bounds(low[0], high[0], low[1], high[1]);
  for (const int round : {0, 1}) {
    const double along = curve->Value(first).Coord(round + 1);
    const auto is_beside = [&](double t) {
      return std::abs(curve->Value(t).Coord(round + 1) - along) >
             kAtEnd * (high[round] - low[round]);
    };
    if (is_beside((first + last) / 2) || is_beside(last)) continue;
    const auto patch = round_patch(surface, round, tolerance);
    if (!patch) continue;
    const Angles angles(*patch, patch->surface);
    const auto is_near = [](double a, double b) { return std::abs(a - b) < kAtEnd * kHalfTurn; };
    const double angle = angles.at(along) - angles.first();
    return is_near(std::abs(angle), kHalfTurn) || is_near(angle, 0) ||
           is_near(angle, angles.last() - angles.first());
  }
  return false;
}

TopoDS_Shape with_shared_analytic_surfaces(const TopoDS_Shape& shape, double tolerance) {
  TopTools_IndexedMapOfShape faces;
  TopExp::MapShapes(shape, TopAbs_FACE, faces);
  std::vector<AnalyticFace> pieces;
  for (int i = 1; i <= faces.Extent(); ++i)
    pieces.emplace_back(faces(i)).find_round_patch(tolerance);
  std::vector<Surface> surfaces(pieces.size());
  const auto are_one_surface = [&](int a, int b) {
    return are_one(pieces[a - 1], pieces[b - 1], tolerance);
  };
  for (const std::vector<int>& group : touching_faces(shape, are_one_surface)) {
    const auto own = std::ranges::find_if(group, [&](int face) { return !pieces[face - 1].patch; });
    const Surface& surface = pieces[(own == group.end() ? group.front() : *own) - 1].surface;
    for (const int face : group) {
      const AnalyticFace& piece = pieces[face - 1];
      if (piece.patch && lies_on(*piece.patch, surface, tolerance)) surfaces[face - 1] = surface;
    }
  }
  return with_surfaces(shape, pieces, surfaces, tolerance);
}

TopoDS_Shape with_analytic_surfaces(const TopoDS_Shape& shape, const std::vector<bool>& is_wanted,
                                    double tolerance) {
  TopTools_IndexedMapOfShape faces;
  TopExp::MapShapes(shape, TopAbs_FACE, faces);
  std::vector<AnalyticFace> pieces;
  std::vector<Surface> surfaces;
  for (int i = 1; i <= faces.Extent(); ++i) {
    pieces.emplace_back(faces(i));
    if (is_wanted[i - 1]) pieces.back().find_patch(tolerance);
    surfaces.push_back(pieces.back().patch ? pieces.back().surface : Surface());
  }
  return with_surfaces(shape, pieces, surfaces, tolerance);
}

}  // namespace cadmorph
