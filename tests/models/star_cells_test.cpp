#include "models/star_cells.h"

#include <Eigen/Dense>
#include <algorithm>
#include <catch2/catch.hpp>

#include "core/boundary.h"
#include "core/mesh_file.h"
#include "core/validity.h"

using namespace cadmorph;
using namespace cadmorph::models;

namespace {

// By the divergence theorem over the triangles of all cells.
double volume(const Mesh& mesh) {
  double sum = 0;
  for (Index c = 0; c < mesh.cell_count(); ++c)
    for (const Facet& facet : cell_facets(mesh, c)) {
      Eigen::Matrix3d corners;
      REQUIRE(facet.nodes.size() == 3);
      for (int i = 0; i < 3; ++i) corners.row(i) = mesh.points.row(facet.nodes[i]);
      sum += corners.determinant() / 6;
    }
  return sum;
}

}  // namespace

TEST_CASE("Joined stars fill the same space with valid polyhedra", "[models]") {
  const MeshFile file(std::string(CADMORPH_SOURCE_DIR) + "/models/shapes/sphere_in_box.vtu");
  const Mesh& tets = file.mesh();
  const Mesh joined = join_stars(tets);
  const auto polyhedra = std::ranges::count(joined.types, CellType::Polyhedron);
  CHECK(polyhedra > 20);
  CHECK(joined.node_count() == tets.node_count() - polyhedra);
  CHECK_NOTHROW(check_mesh(joined));
  CHECK(volume(joined) == Approx(volume(tets)).epsilon(1e-12));
  CHECK(check_validity(joined, joined.points, detect_orientation(joined)).invalid == 0);
  // Every face is shared or on the boundary, which is as before.
  CHECK(extract_boundary(joined).nodes.size() == extract_boundary(tets).nodes.size());
}
