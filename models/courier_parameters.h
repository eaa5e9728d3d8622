#pragma once

#include <array>
#include <cmath>

#include "models/plan_curve.h"

namespace cadmorph::models {

/// The courier's dimensions in millimetres. The origin is the middle of the floor's underside, z is
/// up. Outlines of wall and flange are rounded rectangles about the same four corner axes, at
/// (+-corner_x, +-corner_y); a distance "from the core" is one from the rectangle through them.
struct CourierParameters {
  double corner_x, corner_y;
  double height;                ///< of the flange's upper side
  double thickness;             ///< of floor, wall and flange
  double wall;                  ///< distance of the wall's outside from the core
  double flange;                ///< distance of the flange's rim from the core
  double foot_bend;             ///< inner radius of the bend from floor to wall
  double neck_bend;             ///< inner radius of the bend from wall to flange
  double bolt;                  ///< radius of the flange's eight holes
  double hole_x, hole_y, hole;  ///< four holes in the floor
  double boss_x, boss_y, boss, boss_hole, boss_top, boss_fillet;
  double hub, hub_hole, collar, collar_top;  ///< radii, and the height of the collar's top
  double rib_top, rib_half_width, rib_fillet;
  double rib_reach_x, rib_reach_y;  ///< distance of the ribs' ends from the hub's axis
  double rib_turn_deg;              ///< of hub and ribs about the hub's axis

  double foot_outer_bend() const { return foot_bend + thickness; }
  double neck_outer_bend() const { return neck_bend + thickness; }
  double wall_inside() const { return wall - thickness; }
  double bolt_distance() const { return (wall + neck_bend + flange) / 2; }
};

/// Parameters at `change`: 0 the base, 1 the last step.
inline CourierParameters courier_parameters(double change) {
  const auto from_to = [change](double base, double full) { return std::lerp(base, full, change); };
  return {.corner_x = from_to(56, 66),
          .corner_y = from_to(31, 28),
          .height = from_to(40, 54),
          .thickness = from_to(5, 6),
          .wall = from_to(24, 26),
          .flange = from_to(48, 53),
          .foot_bend = from_to(5, 6),
          .neck_bend = from_to(4, 5),
          .bolt = from_to(4.5, 6),
          .hole_x = from_to(24, 27),
          .hole_y = from_to(27, 27),
          .hole = from_to(5, 6.5),
          .boss_x = from_to(46, 56),
          .boss_y = from_to(25, 23),
          .boss = from_to(8, 9.5),
          .boss_hole = from_to(4, 5),
          .boss_top = from_to(24, 34),
          .boss_fillet = from_to(4, 5),
          .hub = from_to(16, 18),
          .hub_hole = from_to(9, 11),
          .collar = from_to(12.5, 14.5),
          .collar_top = from_to(22, 31),
          .rib_top = from_to(16, 23),
          .rib_half_width = from_to(2.5, 3.5),
          .rib_fillet = from_to(4, 5),
          .rib_reach_x = from_to(40, 44),
          .rib_reach_y = from_to(31, 33),
          .rib_turn_deg = from_to(0, 8)};
}

/// Outline of hub and ribs, counter-clockwise from the start of the first rib's fillet. Six curves
/// a rib: fillet, side, rounded end, side, fillet, arc of the hub up to the next rib.
std::vector<PlanCurve> rib_outline(const CourierParameters& parameters);

/// The four mirror images of a point, in the four quadrants counter-clockwise.
std::array<Point2, 4> mirrored(const Point2& first);

/// Axes of the flange's holes: four at the corners, then right, upper, left, lower.
std::vector<Point2> bolt_centres(const CourierParameters& parameters);

}  // namespace cadmorph::models
