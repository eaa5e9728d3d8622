#include "models/canister.h"

#include <BRepBuilderAPI_MakeEdge.hxx>
#include <BRepBuilderAPI_MakeFace.hxx>
#include <BRepBuilderAPI_MakeWire.hxx>
#include <BRepPrimAPI_MakeRevol.hxx>
#include <cmath>
#include <functional>
#include <gp_Ax1.hxx>
#include <gp_Ax2.hxx>
#include <gp_Elips.hxx>
#include <numbers>
#include <vector>

#include "models/hex_builder.h"
#include "models/plan_curve.h"

namespace cadmorph::models {
namespace {

using std::numbers::pi;
using Point3 = Eigen::Vector3d;

/// Millimetres; z is the axis, 0 where the lower dome begins.
struct CanisterParameters {
  double radius, wall;            ///< inner radius and thickness
  double length;                  ///< of the cylinder
  double lower_dome, upper_dome;  ///< inner heights
  double nozzle, nozzle_wall;     ///< inner radius and thickness
  double nozzle_top;              ///< height above the cylinder
};

CanisterParameters canister_parameters(double change) {
  const auto from_to = [change](double base, double full) { return std::lerp(base, full, change); };
  return {.radius = from_to(60, 66),
          .wall = from_to(3, 2.4),
          .length = from_to(140, 180),
          .lower_dome = from_to(30, 22),
          .upper_dome = from_to(30, 40),
          .nozzle = from_to(15, 20),
          .nozzle_wall = from_to(3, 3.6),
          .nozzle_top = from_to(65, 90)};
}

/// One side of the wall, inner or outer; points are (distance from the axis, height).
struct Side {
  double radius, length, lower_dome, upper_dome, nozzle, nozzle_top;

  Point2 lower(double angle) const {  // 0 at the pole, pi / 2 at the cylinder
    return {radius * std::sin(angle), -lower_dome * std::cos(angle)};
  }
  Point2 upper(double angle) const {  // 0 at the cylinder
    return {radius * std::cos(angle), length + upper_dome * std::sin(angle)};
  }
  double nozzle_angle() const { return std::acos(nozzle / radius); }
  Point2 nozzle_foot() const { return upper(nozzle_angle()); }
  Point2 nozzle_end() const { return {nozzle, length + nozzle_top}; }
};

Side inner_side(const CanisterParameters& p) {
  return {p.radius, p.length, p.lower_dome, p.upper_dome, p.nozzle, p.nozzle_top};
}

Side outer_side(const CanisterParameters& p) {
  return {p.radius + p.wall,        p.length,    p.lower_dome + p.wall, p.upper_dome + p.wall,
          p.nozzle + p.nozzle_wall, p.nozzle_top};
}

gp_Pnt in_profile(const Point2& point) { return {point[0], 0, point[1]}; }

TopoDS_Edge line(const Point2& from, const Point2& to) {
  return BRepBuilderAPI_MakeEdge(in_profile(from), in_profile(to));
}

/// Part of the ellipse about height `centre`, from one point to the other counter-clockwise in x,
/// z.
TopoDS_Edge dome(double radius, double height, double centre, const Point2& from,
                 const Point2& to) {
  const bool is_tall = height > radius;
  const gp_Ax2 frame(gp_Pnt(0, 0, centre), gp_Dir(0, -1, 0),
                     is_tall ? gp_Dir(0, 0, 1) : gp_Dir(1, 0, 0));
  const gp_Elips ellipse(frame, std::max(radius, height), std::min(radius, height));
  return BRepBuilderAPI_MakeEdge(ellipse, in_profile(from), in_profile(to));
}

/// The lower dome, cylinder, upper dome and nozzle of one side, pole first.
std::vector<TopoDS_Edge> profile(const Side& side) {
  return {dome(side.radius, side.lower_dome, 0, side.lower(0), side.lower(pi / 2)),
          line(side.lower(pi / 2), side.upper(0)),
          dome(side.radius, side.upper_dome, side.length, side.upper(0), side.nozzle_foot()),
          line(side.nozzle_foot(), side.nozzle_end())};
}

constexpr int core_cells = 22, columns = 4 * core_cells;
constexpr int wall_layers = 3;
constexpr int ring_cells = 6, lower_cells = 12, cylinder_cells = 34, upper_cells = 20,
              nozzle_cells = 10;
constexpr double core = 0.25, ring = 0.5;  // half the core's side, the ring's radius; dome's is 1

Point3 across(const Point3& inner, const Point3& outer, int layer) {
  if (layer == 0) return inner;
  if (layer == wall_layers) return outer;
  return inner + (outer - inner) * layer / wall_layers;
}

Point3 around(const Point2& profile_point, double angle) {
  return {profile_point[0] * std::cos(angle), profile_point[0] * std::sin(angle), profile_point[1]};
}

double column_angle(int column) { return -pi / 4 + 2 * pi * (column % columns) / columns; }

/// A point of the lower dome, seen as a disc of radius 1 about its pole.
Point3 on_lower_dome(const CanisterParameters& p, const Point2& disc, int layer) {
  const double distance = disc.norm(), angle = std::atan2(disc[1], disc[0]);
  return across(around(inner_side(p).lower(distance * pi / 2), angle),
                around(outer_side(p).lower(distance * pi / 2), angle), layer);
}

/// Where a column of the disc meets the core's outline.
Point2 on_core(int column) {
  const int in_side = column % core_cells;
  const double along = -1 + 2. * in_side / core_cells;
  const Eigen::Rotation2Dd turn(pi / 2 * (column / core_cells % 4));
  return turn * Point2(core, core * along);
}

/// Adds one hexahedron per cell and layer; `point(i, j, layer)` with i, j and the outward direction
/// right-handed.
void add_sheet(int cells_i, int cells_j, const std::function<Point3(int, int, int)>& point,
               HexBuilder& builder) {
  for (int i = 0; i < cells_i; ++i) {
    for (int j = 0; j < cells_j; ++j) {
      for (int l = 0; l < wall_layers; ++l) {
        builder.add({point(i, j, l), point(i + 1, j, l), point(i + 1, j + 1, l), point(i, j + 1, l),
                     point(i, j, l + 1), point(i + 1, j, l + 1), point(i + 1, j + 1, l + 1),
                     point(i, j + 1, l + 1)});
      }
    }
  }
}

void add_lower_dome(const CanisterParameters& p, HexBuilder& builder) {
  // Seen from outside, below, x and y are left-handed: the second index comes first.
  add_sheet(
      core_cells, core_cells,
      [&](int i, int j, int layer) {
        const Point2 disc(-1 + 2. * j / core_cells, -1 + 2. * i / core_cells);
        return on_lower_dome(p, core * disc, layer);
      },
      builder);
  add_sheet(
      columns, ring_cells,
      [&](int column, int i, int layer) {
        const Point2 from = on_core(column), to = polar({0, 0}, ring, column_angle(column));
        return on_lower_dome(p, from + (to - from) * i / ring_cells, layer);
      },
      builder);
}

/// From the ring up to the nozzle's end: the same point of either side at each station.
std::vector<std::function<Point2(const Side&)>> stations() {
  std::vector<std::function<Point2(const Side&)>> list;
  const auto append = [&](int cells, const std::function<Point2(const Side&, double)>& at) {
    for (int i = list.empty() ? 0 : 1; i <= cells; ++i) {
      list.push_back([at, t = double(i) / cells](const Side& side) { return at(side, t); });
    }
  };
  append(lower_cells,
         [](const Side& s, double t) { return s.lower(std::lerp(ring, 1., t) * pi / 2); });
  append(cylinder_cells, [](const Side& s, double t) { return Point2(s.radius, t * s.length); });
  append(upper_cells, [](const Side& s, double t) { return s.upper(t * s.nozzle_angle()); });
  append(nozzle_cells, [](const Side& s, double t) {
    return Point2(s.nozzle, std::lerp(s.nozzle_foot()[1], s.nozzle_end()[1], t));
  });
  return list;
}

}  // namespace

TopoDS_Shape make_canister(double change) {
  const CanisterParameters p = canister_parameters(change);
  const Side inner = inner_side(p), outer = outer_side(p);
  BRepBuilderAPI_MakeWire wire(line(inner.lower(0), outer.lower(0)));
  for (const TopoDS_Edge& edge : profile(outer)) wire.Add(edge);
  wire.Add(line(outer.nozzle_end(), inner.nozzle_end()));
  const std::vector<TopoDS_Edge> inside = profile(inner);
  for (auto edge = inside.rbegin(); edge != inside.rend(); ++edge) wire.Add(*edge);
  return BRepPrimAPI_MakeRevol(BRepBuilderAPI_MakeFace(wire.Wire()),
                               gp_Ax1(gp_Pnt(0, 0, 0), gp_Dir(0, 0, 1)))
      .Shape();
}

Mesh make_canister_hex() {
  const CanisterParameters p = canister_parameters(0);
  const Side inner = inner_side(p), outer = outer_side(p);
  HexBuilder builder;
  add_lower_dome(p, builder);
  const auto rows = stations();
  add_sheet(
      columns, static_cast<int>(rows.size()) - 1,
      [&](int column, int row, int layer) {
        const double angle = column_angle(column);
        return across(around(rows[row](inner), angle), around(rows[row](outer), angle), layer);
      },
      builder);
  return builder.mesh();
}

}  // namespace cadmorph::models
