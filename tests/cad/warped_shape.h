#pragma once

#include <Eigen/Core>
#include <TopoDS_Shape.hxx>
#include <functional>

namespace cadmorph::testing {

/// The image of a shape of any surfaces under a smooth map: each surface becomes a B-spline of
/// degree 5 that interpolates map(S(u, v)) in its own parameters over the trimmed domain, each
/// curve likewise. Pcurves stay, so a point's place is map(x) up to the interpolation error: below
/// 1e-6 of the diagonal for analytic surfaces and maps that bend the part as a whole. No surface
/// stays periodic.
TopoDS_Shape warped(const TopoDS_Shape& shape,
                    const std::function<Eigen::Vector3d(const Eigen::Vector3d&)>& map);

}  // namespace cadmorph::testing
