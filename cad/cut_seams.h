#pragma once

#include <functional>

class TopoDS_Shape;

namespace cadmorph {

/// The same shape with one surface for faces that touch and lie on one of revolution, its
/// parameters begun where these leave a gap, if they do: a cylinder that a slot opened has two
/// faces, cut where its parameters began, and OCCT does not always take the edge between them away.
/// Two surfaces are one where their points are within `tolerance`, millimetres. Shares no edges
/// with `shape` where something changed; faces and edges keep their order.
TopoDS_Shape with_seams_in_gaps(const TopoDS_Shape& shape, double tolerance);

/// The same shape with one face in place of those that touch and make up a whole sphere or torus,
/// unless an edge between them `is_kept`: OCCT merges none without wires. `tell(face, whole)`: of
/// each face that went into a whole one. Other faces and edges stay the same ones.
TopoDS_Shape with_whole_surfaces(
    const TopoDS_Shape& shape, double tolerance,
    const std::function<bool(const TopoDS_Shape& edge)>& is_kept,
    const std::function<void(const TopoDS_Shape& face, const TopoDS_Shape& whole)>& tell);

}  // namespace cadmorph
