#pragma once

#include <Eigen/Core>
#include <Geom2d_Curve.hxx>
#include <gp_Pnt2d.hxx>

namespace cadmorph {

/// A pcurve, run through by the parameter of its edge.
struct Pcurve {
  Handle(Geom2d_Curve) curve;
  double first, last;  // of the pcurve
  double edge_first, edge_last;
  Eigen::Vector2d shift = Eigen::Vector2d::Zero();  // whole periods of the surface
  // Towards a pole one coordinate of the curve says nothing: there it goes on as the parabola that
  // leaves the range from sound_first to sound_last of the curve's parameter.
  int pole_axis = -1;
  double sound_first = 0, sound_last = 0;

  Eigen::Vector2d operator()(double t) const {
    const double span = edge_last - edge_first;
    const bool same = first == edge_first && last == edge_last;
    const double s = same || span == 0 ? t : first + (t - edge_first) / span * (last - first);
    Eigen::Vector2d p = at(s);
    if (pole_axis >= 0 && s < sound_first) p[pole_axis] = parabola(sound_first, first, s);
    if (pole_axis >= 0 && s > sound_last) p[pole_axis] = parabola(sound_last, last, s);
    return p + shift;
  }

  Eigen::Vector2d at(double s) const {
    const gp_Pnt2d p = curve->Value(s);
    return {p.X(), p.Y()};
  }

  /// Coordinate `pole_axis` at s by the values at `from` and at one and two steps away from `end`.
  double parabola(double from, double end, double s) const {
    const double step = from - end, x = (s - from) / step;
    const double a = at(from)[pole_axis], b = at(from + step)[pole_axis],
                 c = at(from + 2 * step)[pole_axis];
    return a + x * (b - a) + 0.5 * x * (x - 1) * (c - 2 * b + a);
  }
};

}  // namespace cadmorph
