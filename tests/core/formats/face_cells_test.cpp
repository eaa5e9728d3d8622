#include "core/formats/face_cells.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <map>

#include "core/validity.h"
#include "tests/core/sample_meshes.h"

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

/// Of a mesh of elements, as OpenFOAM has them.
FaceList faces_of(const Mesh& mesh) {
  FaceList faces;
  std::map<std::vector<Index>, Index> known;
  for (Index c = 0; c < mesh.cell_count(); ++c)
    for (const Facet& facet : cell_facets(mesh, c)) {
      std::vector<Index> sorted(facet.nodes.begin(), facet.nodes.end());
      std::ranges::sort(sorted);
      const auto [face, is_new] = known.try_emplace(sorted, faces.count());
      if (!is_new) {
        faces.neighbour[face->second] = c;
        continue;
      }
      faces.add_face(facet.nodes);
      faces.owner.push_back(c);
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

TEST_CASE("Cells turned inside out are inverted, whether a file has their nodes or their faces",
          "[core][formats]") {
  for (const CellType type :
       {CellType::Tetra, CellType::Pyramid, CellType::Wedge, CellType::Hexahedron}) {
    CAPTURE(int(type));
    Mesh elements = testing::cube(type, 3);
    elements.is_of_finite_volumes = true;
    const Eigen::RowVector3d inner(1.0 / 3, 1.0 / 3, 1.0 / 3);
    Index pushed = 0;
    while ((elements.points.row(pushed) - inner).norm() > 1e-9) ++pushed;
    elements.points.row(pushed) << 1.4, 0.4, 0.3;
    Mesh volumes;
    volumes.points = elements.points;
    add_solid_cells(volumes, faces_of(elements), elements.cell_count(), "pushed");
    volumes.is_of_finite_volumes = true;
    const auto invalid = [](const Mesh& mesh) {
      return check_validity(mesh, mesh.points, detect_orientation(mesh)).invalid_cells;
    };
    CHECK(invalid(volumes) == invalid(elements));
    CHECK(invalid(volumes).size() > 1);
    CHECK(measure_quality(volumes, volumes.points, detect_orientation(volumes)).inverted > 0);
  }
}

}  // namespace cadmorph::test
