#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>
#include <vector>

namespace cadmorph::models {

using Point2 = Eigen::Vector2d;

/// A straight line or circular arc in a plane.
struct PlanCurve {
  Point2 start, end;
  Point2 centre = {0, 0};  ///< of an arc
  double sweep = 0;        ///< signed angle of an arc; 0: a straight line

  /// The point at `t` in [0, 1]; exactly `start` and `end` at its ends.
  Point2 at(double t) const {
    if (t <= 0) return start;
    if (t >= 1) return end;
    if (sweep == 0) return start + t * (end - start);
    return centre + Eigen::Rotation2Dd(sweep * t) * (start - centre);
  }
};

inline Point2 polar(const Point2& centre, double radius, double angle) {
  return centre + radius * Point2(std::cos(angle), std::sin(angle));
}

/// Arc from angle `from` to angle `to`.
inline PlanCurve plan_arc(const Point2& centre, double radius, double from, double to) {
  return {polar(centre, radius, from), polar(centre, radius, to), centre, to - from};
}

/// Outline, counter-clockwise, of all points closer than `distance` to the rectangle with corners
/// (+-corner_x, +-corner_y): the first corner's arc, a line, the next
/// corner's arc, ...
inline std::vector<PlanCurve> rounded_rectangle(double corner_x, double corner_y, double distance) {
  const Point2 corners[] = {
      {corner_x, corner_y}, {-corner_x, corner_y}, {-corner_x, -corner_y}, {corner_x, -corner_y}};
  const Point2 normals[] = {{1, 0}, {0, 1}, {-1, 0}, {0, -1}};
  std::vector<PlanCurve> outline;
  for (int i = 0; i < 4; ++i) {
    const Point2 arc_start = corners[i] + distance * normals[i];
    const Point2 arc_end = corners[i] + distance * normals[(i + 1) % 4];
    outline.push_back({arc_start, arc_end, corners[i], std::numbers::pi / 2});
    outline.push_back({arc_end, corners[(i + 1) % 4] + distance * normals[(i + 1) % 4]});
  }
  return outline;
}

}  // namespace cadmorph::models
