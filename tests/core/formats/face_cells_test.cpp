#include "core/formats/face_cells.h"

#include <catch2/catch.hpp>

namespace cadmorph::test {
namespace {

/// The faces of a hexahedron of nodes 0 to 7 in VTK's order, normals outwards.
FaceList hexahedron_faces() {
  FaceList faces;
  for (const std::vector<Index>& face : std::vector<std::vector<Index>>{
           {0, 4, 7, 3}, {1, 2, 6, 5}, {0, 1, 5, 4}, {3, 7, 6, 2}, {0, 3, 2, 1}, {4, 5, 6, 7}}) {
    faces.add_face(face);
    faces.owner.push_back(0);
    faces.neighbour.push_back(-1);
  }
  return faces;
}

Points cube() {
  Points points(8, 3);
  points << 0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0, 0, 0, 1, 1, 0, 1, 1, 1, 1, 0, 1, 1;
  return points;
}

}  // namespace

TEST_CASE("Six faces are a hexahedron where its map is valid, else a polyhedron",
          "[core][formats]") {
  Mesh mesh;
  mesh.points = cube();
  add_solid_cells(mesh, hexahedron_faces(), 1, "cube");
  CHECK(mesh.types == std::vector{CellType::Hexahedron});
  CHECK(mesh.polyhedron_faces.empty());
  // A corner pushed in beyond its neighbours' plane: the Jacobian there is negative.
  Mesh dented;
  dented.points = cube();
  dented.points.row(6) << 0.6, 0.6, 0.6;
  add_solid_cells(dented, hexahedron_faces(), 1, "dented cube");
  CHECK(dented.types == std::vector{CellType::Polyhedron});
  CHECK(dented.polyhedron_faces.size() == 6 * 5);
}

}  // namespace cadmorph::test
