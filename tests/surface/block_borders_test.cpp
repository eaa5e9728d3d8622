#include "surface/block_borders.h"

#include <BRepPrimAPI_MakeBox.hxx>
#include <catch2/catch.hpp>
#include <set>

#include "morph_case.h"

using namespace cadmorph;
using namespace cadmorph::testing;

namespace {

JoinedBlocks join(const MorphCase& c) {
  return join_blocks(c.mesh, c.boundary, associate(*c.base, c.mesh, c.boundary));
}

/// Blocks of hexahedra, or of quadrilaterals, in a box without a face (an edge) between them.
MorphCase blocks_of(const Mesh& mesh) {
  return mesh_case(to_model(BRepPrimAPI_MakeBox(50, 20, 20).Solid()), mesh);
}

}  // namespace

TEST_CASE("blocks of a mesh are one where the CAD has no face between them",
          "[surface][interfaces]") {
  Mesh mesh = shape_case("two_blocks").mesh;
  mesh.zone_of_block = {{1, 0}, {2, 0}};
  const MorphCase c = blocks_of(mesh);
  const JoinedBlocks joined = join(c);
  REQUIRE(std::ssize(joined.regions) == mesh.cell_count());
  CHECK(std::set<int>(joined.regions.begin(), joined.regions.end()).size() == 1);
  mesh.regions.clear();
  const MorphCase whole = blocks_of(mesh);
  CHECK(joined.boundary.nodes == whole.boundary.nodes);
  CHECK(joined.boundary.connectivity == whole.boundary.connectivity);
  CHECK(joined.boundary.offsets == whole.boundary.offsets);
  CHECK(joined.boundary.types == whole.boundary.types);
  CHECK(joined.boundary.cell == whole.boundary.cell);
}

TEST_CASE("blocks that the CAD or the file's names part stay", "[surface][interfaces]") {
  MorphCase parted = shape_case("two_blocks");
  parted.mesh.zone_of_block = {{1, 0}, {2, 0}};
  CHECK(join(parted).regions.empty());
  Mesh named = parted.mesh;
  named.zone_of_block = {{1, 0}, {2, 1}};
  CHECK(join(blocks_of(named)).regions.empty());
  named.zone_of_block.clear();
  CHECK(join(blocks_of(named)).regions.empty());
}

TEST_CASE("blocks of a shell are one where the CAD has no edge between them",
          "[surface][interfaces]") {
  const Boundary skin = extract_boundary(shape_case("two_blocks").mesh);
  Mesh shell;
  shell.points = shape_case("two_blocks").mesh.points;
  for (Index f = 0; f < skin.facet_count(); ++f) {
    if (skin.neighbour[f] >= 0) continue;
    add_cell(shell, skin.types[f], skin.facet(f));
    shell.regions.push_back(shell.points(skin.facet(f).front(), 0) < 25 ? 1 : 2);
  }
  shell.zone_of_block = {{1, 0}, {2, 0}};
  const JoinedBlocks joined = join(blocks_of(shell));
  CHECK(std::set<int>(joined.regions.begin(), joined.regions.end()).size() == 1);
  CHECK(joined.boundary.facet_count() == shell.cell_count());
  // At the box's edge they are parted.
  for (Index cell = 0; cell < shell.cell_count(); ++cell) {
    bool is_on_side = true;
    for (const Index node : shell.cell(cell)) is_on_side &= shell.points(node, 0) < 1e-9;
    shell.regions[cell] = is_on_side ? 1 : 2;
  }
  CHECK(join(blocks_of(shell)).regions.empty());
}
