#pragma once

#include <functional>
#include <vector>

class TopoDS_Face;
class TopoDS_Shape;

namespace cadmorph {

/// Groups of faces that hang together by edges across which `is_one` holds, as numbers of
/// TopExp::MapShapes, ascending; those of one face left out. `is_one` gets the numbers of two faces
/// of one location, of which an edge is the border.
std::vector<std::vector<int>> touching_faces(const TopoDS_Shape& shape,
                                             const std::function<bool(int, int)>& is_one);

}  // namespace cadmorph
