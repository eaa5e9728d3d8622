#pragma once

class TopoDS_Shape;

namespace cadmorph {

/// The same shape with the parameters of surfaces of revolution begun in a gap where all faces of
/// the surface that touch at its seam leave one: a cylinder that a slot opened has two faces, cut
/// where its parameters begin, whose edge OCCT does not always take away. Two surfaces are one
/// where their points are within `tolerance`, millimetres. Shares no edges with `shape` where
/// something changed; faces and edges keep their order.
TopoDS_Shape with_seams_in_gaps(const TopoDS_Shape& shape, double tolerance);

}  // namespace cadmorph
