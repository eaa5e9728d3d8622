#include "surface/unnamed_interfaces.h"

#include <BRepPrimAPI_MakeBox.hxx>
#include <BRepPrimAPI_MakeCylinder.hxx>
#include <BRep_Builder.hxx>
#include <TopoDS_Compound.hxx>
#include <catch2/catch.hpp>
#include <cmath>
#include <gp_Ax2.hxx>

#include "core/cell_faces.h"
#include "morph_case.h"
#include "surface/surface_morph.h"

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

TEST_CASE("an interface that is held is none that the mesh lacks, nor a crack",
          "[surface][interfaces]") {
  MorphCase c = shape_case("two_blocks");
  c.mesh.groups = {{"between", "marker", {}}};
  std::vector<Index>& between = c.mesh.groups[0].nodes;
  for (Index n = 0; n < c.mesh.node_count(); ++n)
    if (std::abs(c.mesh.points(n, 0) - 30) < 1e-9) between.push_back(n);
  REQUIRE_FALSE(between.empty());
  const bool is_doubled = GENERATE(false, true);
  if (is_doubled) {
    const Index first = c.mesh.node_count();
    c.mesh.points.conservativeResize(first + std::ssize(between), 3);
    std::vector<Index> twin_of(c.mesh.node_count(), -1);
    for (std::size_t i = 0; i < between.size(); ++i) {
      twin_of[between[i]] = first + Index(i);
      c.mesh.points.row(first + Index(i)) = c.mesh.points.row(between[i]);
    }
    for (Index cell = 0; cell < c.mesh.cell_count(); ++cell)
      for (Index i = c.mesh.offsets[cell];
           c.mesh.regions[cell] == 2 && i < c.mesh.offsets[cell + 1]; ++i)
        if (Index& node = c.mesh.connectivity[i]; node < first && twin_of[node] >= 0)
          node = twin_of[node];
    for (Index n = first; n < c.mesh.node_count(); ++n) between.push_back(n);
  }
  c = mesh_case(two_blocks(30), c.mesh);
  SurfaceMorphOptions options;
  options.groups.held = {"between"};
  const SurfaceMorph morph(c.base, c.mesh, c.boundary, options);
  const UnnamedInterfaces found = find_unnamed_interfaces(
      *c.base, c.mesh, find_cell_neighbours(c.mesh), c.boundary, morph.association(), 0.1);
  CHECK(found.crossed.empty());
  CHECK_FALSE(morph.association().held_faces.empty());
  const SurfaceMorphResult moved =
      morph.morph(two_blocks(31), match_topology(*c.base, two_blocks(31)));
  for (const std::string& warning : moved.warnings) {
    INFO(warning);
    CHECK(warning.find("crack") == std::string::npos);
  }
}
