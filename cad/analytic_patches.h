#pragma once

#include <vector>

class TopoDS_Edge;
class TopoDS_Face;
class TopoDS_Shape;

namespace cadmorph {

/// Whether the edge runs where a B-spline (or Bezier, or trimmed) patch begins or ends round an
/// axis, or half a turn from its beginning: where a program that turns all surfaces into such ones
/// had the seam of a cylinder, a cone or a sphere. A patch is one of these if it is nowhere farther
/// from it than `tolerance`, millimetres.
bool is_at_end_of_patch(const TopoDS_Edge& edge, const TopoDS_Face& face, double tolerance);

/// The same shape with faces that touch and lie on one cylinder, cone or sphere on that surface, in
/// place of patches of their own: OCCT merges no others. Shares no edges with `shape` where
/// something changed; faces and edges keep their order, and edges their 3D curves.
TopoDS_Shape with_shared_analytic_surfaces(const TopoDS_Shape& shape, double tolerance);

/// The same with the wanted faces (in the order of TopExp::MapShapes) on planes, cylinders, cones
/// and spheres where their patches are pieces of such, each on its own.
TopoDS_Shape with_analytic_surfaces(const TopoDS_Shape& shape, const std::vector<bool>& is_wanted,
                                    double tolerance);

}  // namespace cadmorph
