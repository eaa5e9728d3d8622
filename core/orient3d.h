#pragma once

#include <Eigen/Geometry>

namespace cadmorph {

/// Sign of det[b - a, c - a, d - a], six times the volume of a tetrahedron: +1, 0 or -1, exact for
/// all inputs free of overflow and underflow. A floating-point filter first, then exact expansion
/// arithmetic (Shewchuk: Adaptive precision floating-point arithmetic, 1997).
int orient3d(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c,
             const Eigen::Vector3d& d);

}  // namespace cadmorph
