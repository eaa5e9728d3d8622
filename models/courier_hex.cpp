#include <algorithm>
#include <functional>

#include "models/courier.h"
#include "models/courier_parameters.h"
#include "models/hex_builder.h"
#include "models/plan_mesher.h"

namespace cadmorph::models {
namespace {

using std::numbers::pi;
using Point3 = Eigen::Vector3d;

constexpr double size = 1.75;  // edge length aimed at, mm
constexpr int layers = 5;      // through floor, wall and flange
constexpr int rib_layers = 7, collar_layers = 4;
constexpr int corner_columns = 20;  // around each corner of the pan
constexpr int bend_cells = 8;       // along each bend
constexpr int boss_columns = 48, boss_fillet_cells = 6;
constexpr double margin = 1;  // mm of plane between a fillet and the quadrangles

/// Even number of cells for a length.
int even_cells(double length) {
  return 2 * std::max(1, static_cast<int>(std::lround(length / (2 * size))));
}

double length(const PlanCurve& curve) {
  if (curve.sweep == 0) return (curve.end - curve.start).norm();
  return std::abs(curve.sweep) * (curve.start - curve.centre).norm();
}

Loop sample_evenly(const std::vector<PlanCurve>& curves) {
  std::vector<int> cells;
  for (const PlanCurve& curve : curves) cells.push_back(even_cells(length(curve)));
  return sample_loop(curves, cells);
}

Loop circle(const Point2& centre, double radius) {
  return sample_circle(centre, radius, std::max(8, even_cells(2 * pi * radius)));
}

/// Sweeps a plan's quadrangles from z = `bottom` to `top`.
void sweep(const PlanMesh& plan, double bottom, double top, int count, HexBuilder& builder) {
  for (const auto& quad : plan.quads) {
    for (int layer = 0; layer < count; ++layer) {
      std::array<Point3, 8> corners;
      for (int i = 0; i < 8; ++i) {
        const double z = std::lerp(bottom, top, double(layer + i / 4) / count);
        corners[i] << plan.points[quad[i % 4]], z;
      }
      builder.add(corners);
    }
  }
}

/// One station of a sheet's cross-section: where it crosses the sheet's two sides. A point is a
/// distance (from the core, or a boss's axis) and a height.
struct Station {
  Point2 lower, upper;
};

Point2 between(const Station& station, int layer) {
  if (layer == 0) return station.lower;
  if (layer == layers) return station.upper;
  return station.lower + (station.upper - station.lower) * layer / layers;
}

/// Sweeps a cross-section along closed columns; `place(column, distance)` is a point in the plan.
/// Distances that grow along the stations make right-handed cells, falling ones `is_inward`.
void sweep_section(const std::vector<Station>& stations, int columns, bool is_inward,
                   const std::function<Point2(int, double)>& place, HexBuilder& builder) {
  const auto corner = [&](std::size_t station, int column, int layer) {
    const Point2 at = between(stations[station], layer);
    const Point2 plan = place(column % columns, at[0]);
    return Point3(plan[0], plan[1], at[1]);
  };
  for (std::size_t s = 0; s + 1 < stations.size(); ++s) {
    const std::size_t first = is_inward ? s + 1 : s, second = is_inward ? s : s + 1;
    for (int c = 0; c < columns; ++c) {
      for (int l = 0; l < layers; ++l) {
        builder.add({corner(first, c, l), corner(second, c, l), corner(second, c + 1, l),
                     corner(first, c + 1, l), corner(first, c, l + 1), corner(second, c, l + 1),
                     corner(second, c + 1, l + 1), corner(first, c + 1, l + 1)});
      }
    }
  }
}

/// Appends the stations of `cells` cells along two curves.
void append(std::vector<Station>& stations, const PlanCurve& lower, const PlanCurve& upper,
            int cells) {
  for (int i = stations.empty() ? 0 : 1; i <= cells; ++i) {
    stations.push_back({lower.at(double(i) / cells), upper.at(double(i) / cells)});
  }
}

double floor_edge(const CourierParameters& p) { return p.wall_inside() - p.foot_bend - margin; }
double flange_edge(const CourierParameters& p) { return p.wall + p.neck_bend + margin; }

/// The sheet's cross-section from the floor through both bends to the flange.
std::vector<Station> pan_section(const CourierParameters& p) {
  const double foot = p.wall_inside() - p.foot_bend, foot_top = p.foot_outer_bend();
  const double neck = p.wall + p.neck_bend, neck_bottom = p.height - p.neck_outer_bend();
  const Point2 foot_centre(foot, foot_top), neck_centre(neck, neck_bottom);
  const auto horizontal = [&](double from, double to, double z) {
    return PlanCurve{{from, z}, {to, z}};
  };
  const auto vertical = [&](double distance) {
    return PlanCurve{{distance, foot_top}, {distance, neck_bottom}};
  };
  std::vector<Station> stations;
  append(stations, horizontal(floor_edge(p), foot, 0), horizontal(floor_edge(p), foot, p.thickness),
         1);
  append(stations, plan_arc(foot_centre, p.foot_outer_bend(), -pi / 2, 0),
         plan_arc(foot_centre, p.foot_bend, -pi / 2, 0), bend_cells);
  append(stations, vertical(p.wall), vertical(p.wall_inside()), even_cells(neck_bottom - foot_top));
  append(stations, plan_arc(neck_centre, p.neck_bend, pi, pi / 2),
         plan_arc(neck_centre, p.neck_outer_bend(), pi, pi / 2), bend_cells);
  append(stations, horizontal(neck, flange_edge(p), p.height - p.thickness),
         horizontal(neck, flange_edge(p), p.height), 1);
  return stations;
}

std::vector<int> pan_columns(const CourierParameters& p) {
  const int along_x = even_cells(2 * p.corner_x), along_y = even_cells(2 * p.corner_y);
  return {corner_columns, along_x, corner_columns, along_y,
          corner_columns, along_x, corner_columns, along_y};
}

Loop pan_loop(const CourierParameters& p, double distance) {
  return sample_loop(rounded_rectangle(p.corner_x, p.corner_y, distance), pan_columns(p));
}

void add_pan(const CourierParameters& p, HexBuilder& builder) {
  std::map<double, Loop> loops;  // many nodes have the same distance
  const auto place = [&](int column, double distance) {
    const auto [entry, is_new] = loops.try_emplace(distance);
    if (is_new) entry->second = pan_loop(p, distance);
    return entry->second[column];
  };
  sweep_section(pan_section(p), static_cast<int>(pan_loop(p, p.wall).size()), false, place,
                builder);
}

double boss_edge(const CourierParameters& p) { return p.boss + p.boss_fillet + margin; }

/// From the floor around a boss up the boss: the floor's underside turns into the hole's wall where
/// the fillet is half done.
std::vector<Station> boss_section(const CourierParameters& p) {
  const double foot = p.boss + p.boss_fillet, top = p.thickness + p.boss_fillet;
  const Point2 centre(foot, top);
  const auto line = [](const Point2& a, const Point2& b) { return PlanCurve{a, b}; };
  std::vector<Station> stations;
  append(stations, line({boss_edge(p), 0}, {foot, 0}),
         line({boss_edge(p), p.thickness}, {foot, p.thickness}), 1);
  append(stations, line({foot, 0}, {p.boss_hole, 0}),
         plan_arc(centre, p.boss_fillet, -pi / 2, -3 * pi / 4), boss_fillet_cells / 2);
  append(stations, line({p.boss_hole, 0}, {p.boss_hole, top}),
         plan_arc(centre, p.boss_fillet, -3 * pi / 4, -pi), boss_fillet_cells / 2);
  append(stations, line({p.boss_hole, top}, {p.boss_hole, p.boss_top}),
         line({p.boss, top}, {p.boss, p.boss_top}), even_cells(p.boss_top - top));
  return stations;
}

Loop boss_loop(const CourierParameters& p, const Point2& centre) {
  return sample_circle(centre, boss_edge(p), boss_columns);
}

void add_bosses(const CourierParameters& p, HexBuilder& builder) {
  for (const Point2& centre : mirrored({p.boss_x, p.boss_y})) {
    const auto place = [&](int column, double distance) {
      return polar(centre, distance, 2 * pi * column / boss_columns);
    };
    sweep_section(boss_section(p), boss_columns, true, place, builder);
  }
}

void add_floor(const CourierParameters& p, HexBuilder& builder) {
  const Loop hole = circle({0, 0}, p.hub_hole), collar = circle({0, 0}, p.collar);
  const Loop ribs = sample_evenly(rib_outline(p));
  std::vector<Loop> holes = {ribs};
  for (const Point2& centre : mirrored({p.boss_x, p.boss_y})) {
    holes.push_back(boss_loop(p, centre));
  }
  for (const Point2& centre : mirrored({p.hole_x, p.hole_y})) {
    holes.push_back(circle(centre, p.hole));
  }
  const PlanMesh under_collar = mesh_plan(collar, {hole}), under_ribs = mesh_plan(ribs, {collar});
  sweep(mesh_plan(pan_loop(p, floor_edge(p)), holes), 0, p.thickness, layers, builder);
  sweep(under_ribs, 0, p.thickness, layers, builder);
  sweep(under_ribs, p.thickness, p.rib_top, rib_layers, builder);
  sweep(under_collar, 0, p.thickness, layers, builder);
  sweep(under_collar, p.thickness, p.rib_top, rib_layers, builder);
  sweep(under_collar, p.rib_top, p.collar_top, collar_layers, builder);
}

void add_flange(const CourierParameters& p, HexBuilder& builder) {
  std::vector<Loop> holes = {pan_loop(p, flange_edge(p))};
  for (const Point2& centre : bolt_centres(p)) holes.push_back(circle(centre, p.bolt));
  const Loop rim = sample_evenly(rounded_rectangle(p.corner_x, p.corner_y, p.flange));
  sweep(mesh_plan(rim, holes), p.height - p.thickness, p.height, layers, builder);
}

}  // namespace

Mesh make_courier_hex() {
  const CourierParameters p = courier_parameters(0);
  HexBuilder builder;
  add_floor(p, builder);
  add_flange(p, builder);
  add_pan(p, builder);
  add_bosses(p, builder);
  return builder.mesh();
}

}  // namespace cadmorph::models
