#pragma once

#include <functional>
#include <vector>

class TopoDS_Face;
class TopoDS_Shape;

namespace cadmorph {

/// Square millimetres.
double area(const TopoDS_Shape& shape);

/// A face in the frame that its surface is in, the way its surface looks.
TopoDS_Face in_own_frame(const TopoDS_Shape& face);

/// Groups of faces that hang together by edges across which `is_one` holds, as numbers of
/// TopExp::MapShapes, ascending; those of one face left out. `is_one` gets the numbers of two faces
/// of one location, of which an edge is the border.
std::vector<std::vector<int>> touching_faces(const TopoDS_Shape& shape,
                                             const std::function<bool(int, int)>& is_one);

}  // namespace cadmorph
