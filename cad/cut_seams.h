#pragma once

class TopoDS_Shape;

namespace cadmorph {

/// The same shape with one surface for faces that touch and lie on one of revolution, its
/// parameters begun where these leave a gap, if they do: a cylinder that a slot opened has two
/// faces, cut where its parameters began, and OCCT does not always take the edge between them away.
/// Two surfaces are one where their points are within `tolerance`, millimetres. Shares no edges
/// with `shape` where something changed; faces and edges keep their order.
TopoDS_Shape with_seams_in_gaps(const TopoDS_Shape& shape, double tolerance);

}  // namespace cadmorph
