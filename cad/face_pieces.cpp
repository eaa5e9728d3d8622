#include "cad/face_pieces.h"

#include <BRepGProp.hxx>
#include <GProp_GProps.hxx>
#include <TopExp.hxx>
#include <TopLoc_Location.hxx>
#include <TopTools_IndexedDataMapOfShapeListOfShape.hxx>
#include <TopTools_IndexedMapOfShape.hxx>
#include <TopTools_ListOfShape.hxx>
#include <TopoDS.hxx>
#include <TopoDS_Face.hxx>
#include <map>
#include <numeric>
#include <utility>

namespace cadmorph {

double area(const TopoDS_Shape& shape) {
  GProp_GProps properties;
  BRepGProp::SurfaceProperties(shape, properties);
  return properties.Mass();
}

TopoDS_Face in_own_frame(const TopoDS_Shape& face) {
  return TopoDS::Face(face.Located(TopLoc_Location()).Oriented(TopAbs_FORWARD));
}

std::vector<std::vector<int>> touching_faces(const TopoDS_Shape& shape,
                                             const std::function<bool(int, int)>& is_one) {
  TopTools_IndexedMapOfShape faces;
  TopExp::MapShapes(shape, TopAbs_FACE, faces);
  TopTools_IndexedDataMapOfShapeListOfShape faces_of;
  TopExp::MapShapesAndAncestors(shape, TopAbs_EDGE, TopAbs_FACE, faces_of);
  std::vector<int> group(static_cast<std::size_t>(faces.Extent()) + 1);
  std::iota(group.begin(), group.end(), 0);
  const auto root = [&](int face) {
    while (group[face] != face) face = group[face];
    return face;
  };
  for (int i = 1; i <= faces_of.Extent(); ++i) {
    const TopTools_ListOfShape& two = faces_of(i);
    if (two.Extent() != 2 || two.First().IsSame(two.Last()) ||
        two.First().Location() != two.Last().Location())
      continue;
    const int a = faces.FindIndex(two.First()), b = faces.FindIndex(two.Last());
    if (root(a) != root(b) && is_one(a, b)) group[root(b)] = root(a);
  }
  std::map<int, std::vector<int>> members;
  for (int i = 1; i <= faces.Extent(); ++i) members[root(i)].push_back(i);
  std::vector<std::vector<int>> result;
  for (auto& [first, group_faces] : members)
    if (group_faces.size() > 1) result.push_back(std::move(group_faces));
  return result;
}

}  // namespace cadmorph
