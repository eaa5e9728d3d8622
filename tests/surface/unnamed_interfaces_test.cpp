#include "surface/unnamed_interfaces.h"

#include <BRepPrimAPI_MakeBox.hxx>
#include <BRepPrimAPI_MakeCylinder.hxx>
#include <BRep_Builder.hxx>
#include <TopoDS_Compound.hxx>
#include <catch2/catch.hpp>
#include <gp_Ax2.hxx>

#include "core/cell_faces.h"
#include "morph_case.h"

using namespace cadmorph;
using namespace cadmorph::testing;

namespace {

/// Two blocks that touch at x = middle; each has its own face there.
CadModel two_blocks(double middle) {
  TopoDS_Compound blocks;
  BRep_Builder builder;
  builder.MakeCompound(blocks);
  builder.Add(blocks, BRepPrimAPI_MakeBox(gp_Pnt(0, 0, 0), gp_Pnt(middle, 20, 20)).Solid());
  builder.Add(blocks, BRepPrimAPI_MakeBox(gp_Pnt(middle, 0, 0), gp_Pnt(50, 20, 20)).Solid());
  return to_model(blocks);
}

UnnamedInterfaces find(const MorphCase& c, const CadModel& base) {
  const Association association = associate(base, c.mesh, c.boundary);
  return find_unnamed_interfaces(base, c.mesh, find_cell_neighbours(c.mesh), c.boundary,
                                 association, AssociationOptions().tolerance);
}

}  // namespace

TEST_CASE("faces of cells between solids are found where the mesh names no regions",
          "[surface][interfaces]") {
  const MorphCase named = shape_case("two_blocks");
  Mesh mesh = named.mesh;
  mesh.regions.clear();
  const MorphCase unnamed = mesh_case(two_blocks(30), mesh);
  REQUIRE(unnamed.boundary.facet_count() < named.boundary.facet_count());
  const UnnamedInterfaces found = find(unnamed, two_blocks(30));
  CHECK(found.crossed.empty());
  const Boundary whole = extract_boundary(mesh, find_cell_neighbours(mesh), {}, found.faces);
  CHECK(whole.nodes == named.boundary.nodes);
  CHECK(whole.facet_count() == named.boundary.facet_count());
  CHECK(find(named, two_blocks(30)).faces.empty());
}

TEST_CASE("a face of the CAD that runs through cells is told", "[surface][interfaces]") {
  Mesh mesh = shape_case("two_blocks").mesh;
  mesh.regions.clear();
  const UnnamedInterfaces found = find(mesh_case(two_blocks(22), mesh), two_blocks(22));
  CHECK(found.faces.empty());
  CHECK(found.crossed.size() == 2);
}

TEST_CASE("bodies of the CAD that the mesh lacks cross nothing", "[surface][interfaces]") {
  Mesh mesh = shape_case("two_blocks").mesh;
  mesh.regions.clear();
  TopoDS_Compound parts;
  BRep_Builder builder;
  builder.MakeCompound(parts);
  builder.Add(parts, BRepPrimAPI_MakeBox(gp_Pnt(0, 0, 0), gp_Pnt(50, 20, 20)).Solid());
  builder.Add(parts, BRepPrimAPI_MakeBox(gp_Pnt(5, 5, 20), gp_Pnt(45, 15, 20.2)).Solid());
  builder.Add(parts,
              BRepPrimAPI_MakeCylinder(gp_Ax2(gp_Pnt(10, 10, 30), gp_Dir(0, 0, 1)), 5, 9).Solid());
  const CadModel base = to_model(parts);
  const UnnamedInterfaces found = find(mesh_case(to_model(parts), mesh), base);
  CHECK(found.faces.empty());
  CHECK(found.crossed.empty());
}
