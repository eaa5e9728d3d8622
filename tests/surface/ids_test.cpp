#include "surface/ids.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <concepts>

#include "../core/sample_meshes.h"
#include "surface/association.h"
#include "surface/surface_mesh.h"

using namespace cadmorph;
using namespace cadmorph::testing;

namespace {

template <class Vector, class Key>
concept FoundBy = requires(Vector vector, Key key) {
  vector[key];
};

}  // namespace

TEST_CASE("Rows are no numbers of mesh nodes, of facets or of places in a list", "[surface][ids]") {
  using Dimensions = decltype(Association::dimension);
  STATIC_REQUIRE(FoundBy<Dimensions, RowId>);
  STATIC_REQUIRE_FALSE(FoundBy<Dimensions, Index>);  // a mesh node
  STATIC_REQUIRE_FALSE(FoundBy<Dimensions, FacetId>);
  STATIC_REQUIRE_FALSE(FoundBy<Dimensions, std::size_t>);  // a place in FaceNodes::rows
  STATIC_REQUIRE(FoundBy<decltype(SurfaceMesh::facets), FacetId>);
  STATIC_REQUIRE_FALSE(FoundBy<decltype(SurfaceMesh::facets), RowId>);
  STATIC_REQUIRE(std::invocable<decltype(&SurfaceMesh::is_corner), SurfaceMesh, RowId>);
  STATIC_REQUIRE_FALSE(std::invocable<decltype(&SurfaceMesh::is_corner), SurfaceMesh, Index>);
  STATIC_REQUIRE_FALSE(std::invocable<decltype(&Association::face), Association, FacetId>);
  STATIC_REQUIRE_FALSE(std::constructible_from<RowId, FacetId>);
}

TEST_CASE("Mesh nodes and facets lead to their rows and back", "[surface][ids]") {
  const Mesh mesh = cube(CellType::Hexahedron, 3);
  const Boundary boundary = extract_boundary(mesh);
  const SurfaceMesh surface = make_surface_mesh(mesh, boundary, 1);
  REQUIRE(surface.between.size() == 4 * 4 * 4 - 2 * 2 * 2);
  for (const RowId row : surface.between.ids()) {
    CHECK(row_of(boundary, boundary.nodes[row]) == row);
    for (const FacetId f : surface.facets.ids())
      CHECK(std::ranges::count(surface.facets_at(row), f) ==
            std::ranges::count(surface.facets[f], row));
  }
}
