#include <BOPAlgo_Builder.hxx>
#include <BRepPrimAPI_MakeBox.hxx>
#include <BRep_Builder.hxx>
#include <TopoDS_Compound.hxx>
#include <catch2/catch.hpp>
#include <cmath>

#include "cad/step_reader.h"
#include "cad/topology_match.h"
#include "morph_case.h"
#include "surface_parts.h"
#include "triangulation.h"

using namespace cadmorph;
using namespace cadmorph::testing;
using Eigen::Vector3d;

namespace {

/// Two blocks of one width side by side, each with its own copy of the face between them.
TopoDS_Shape two_blocks(double first, double second) {
  TopoDS_Compound blocks;
  BRep_Builder builder;
  builder.MakeCompound(blocks);
  builder.Add(blocks, BRepPrimAPI_MakeBox(gp_Pnt(0, 0, 0), gp_Pnt(first, 20, 20)).Solid());
  builder.Add(blocks,
              BRepPrimAPI_MakeBox(gp_Pnt(first, 0, 0), gp_Pnt(first + second, 20, 20)).Solid());
  return blocks;
}

/// Both blocks with one common face.
TopoDS_Shape glued_blocks(double first, double second) {
  BOPAlgo_Builder builder;
  builder.AddArgument(BRepPrimAPI_MakeBox(gp_Pnt(0, 0, 0), gp_Pnt(first, 20, 20)).Solid());
  builder.AddArgument(
      BRepPrimAPI_MakeBox(gp_Pnt(first, 0, 0), gp_Pnt(first + second, 20, 20)).Solid());
  builder.Perform();
  return builder.Shape();
}

}  // namespace

TEST_CASE("both sides of an interface agree when either block changes", "[surface][solids]") {
  const MorphCase c = shape_case("two_blocks");
  const Morphed m = morph(c, to_model(two_blocks(36, 14)));
  const auto stretch = [](const Vector3d& x) -> Vector3d {
    return {x.x() <= 30 ? x.x() * 36 / 30 : 36 + (x.x() - 30) * 14 / 20, x.y(), x.z()};
  };
  CHECK(largest_difference(m.surface.positions, moved_by(c, stretch)) <= kKnown * c.diagonal);
  Index on_interface = 0;
  for (Index n = 0; n < c.mesh.node_count(); ++n)
    if (std::abs(c.mesh.points(n, 0) - 30) < 1e-9) {
      ++on_interface;
      CHECK(std::abs(m.points(n, 0) - 36) < kKnown * c.diagonal);
    }
  CHECK(on_interface > 20);
}

TEST_CASE("touching blocks with meshes of their own part where they touch",
          "[surface][association][solids]") {
  // Each face between them has a coincident copy, as have its edges and corners.
  const auto first = [](const Vector3d& s) -> Vector3d {
    return {30 * s.x(), 20 * s.y(), 20 * s.z()};
  };
  const auto second = [](const Vector3d& s) -> Vector3d {
    return {30 + 20 * s.x(), 20 * s.y(), 20 * s.z()};
  };
  Mesh mesh = hex_grid({5, 4, 4}, first);
  const Mesh other = hex_grid({4, 4, 4}, second);
  const Index nodes = mesh.node_count(), cells = mesh.cell_count();
  mesh.points.conservativeResize(nodes + other.node_count(), 3);
  mesh.points.bottomRows(other.node_count()) = other.points;
  for (const Index n : other.connectivity) mesh.connectivity.push_back(nodes + n);
  for (Index c = 0; c < other.cell_count(); ++c) {
    mesh.types.push_back(other.types[c]);
    mesh.offsets.push_back(mesh.offsets.back() + 8);
  }
  mesh.regions.assign(static_cast<std::size_t>(mesh.cell_count()), 0);
  for (Index c = cells; c < mesh.cell_count(); ++c) mesh.regions[c] = 1;
  for (const bool has_regions : {true, false}) {
    if (!has_regions) mesh.regions.clear();
    const MorphCase c = mesh_case(to_model(two_blocks(30, 20)), mesh);
    const SurfaceMorph surface(c.base, c.mesh, c.boundary);
    // The blocks part by 7 mm, the second grows across.
    TopoDS_Compound apart;
    BRep_Builder().MakeCompound(apart);
    BRep_Builder().Add(apart, BRepPrimAPI_MakeBox(gp_Pnt(0, 0, 0), gp_Pnt(30, 20, 20)).Solid());
    BRep_Builder().Add(apart, BRepPrimAPI_MakeBox(gp_Pnt(37, 0, 0), gp_Pnt(57, 26, 20)).Solid());
    const CadModel variant = to_model(apart);
    const auto result = surface.morph(variant, match_topology(*c.base, variant));
    double worst = 0;
    for (std::size_t i = 0; i < c.boundary.nodes.size(); ++i) {
      const Index n = c.boundary.nodes[i];
      Vector3d expected = mesh.points.row(n);
      if (n >= nodes) expected += Vector3d(7, 0.3 * expected.y(), 0);
      worst = std::max(worst, (result.positions.row(i).transpose() - expected).norm());
    }
    INFO("regions " << has_regions);
    CHECK(worst < kKnown * c.diagonal);
  }
}

TEST_CASE("an interface that is not in the CAD follows the volume", "[surface][solids]") {
  Mesh mesh = hex_grid({8, 6, 4}, [](const Vector3d& s) -> Vector3d {
    return {40 * s.x(), 30 * s.y(), 20 * s.z()};
  });
  for (Index cell = 0; cell < mesh.cell_count(); ++cell)
    mesh.regions[cell] = mesh.points(mesh.cell(cell)[0], 0) < 19 ? 1 : 2;
  const MorphCase c = mesh_case(read_step(model_file("shapes/box.step")), mesh);
  const SurfaceMorph surface(c.base, c.mesh, c.boundary);
  Index free = 0;
  for (const RowId i : surface.association().is_free.ids()) {
    const Vector3d x = c.mesh.points.row(c.boundary.nodes[i]);
    const bool is_inside =
        x.x() > 1 && x.x() < 39 && x.y() > 1 && x.y() < 29 && x.z() > 1 && x.z() < 19;
    free += is_inside;
    CHECK(static_cast<bool>(surface.association().is_free[i]) == is_inside);
  }
  CHECK(free == 5 * 3);
  const Morphed m = morph(c, to_model(BRepPrimAPI_MakeBox(50, 24, 20).Solid()));
  const Points expected = images(c.mesh.points, [](const Vector3d& x) -> Vector3d {
    return {1.25 * x.x(), 0.8 * x.y(), x.z()};
  });
  CHECK(largest_difference(m.points, expected) <= kKnown * c.diagonal);
}

TEST_CASE("a crack inside of the mesh closes on itself: its two sides move as one",
          "[surface][crack]") {
  const double height = GENERATE(10.0, 2.5);  // the latter beside nodes on the CAD
  Mesh mesh = hex_grid({8, 6, 8}, [](const Vector3d& s) -> Vector3d {
    return {40 * s.x(), 30 * s.y(), 20 * s.z()};
  });
  // A second node at the place of one inside, for the cells on one side of it.
  Index there = -1;
  for (Index n = 0; n < mesh.node_count(); ++n)
    if (Vector3d(mesh.points.row(n)).isApprox(Vector3d(20, 15, height))) there = n;
  REQUIRE(there >= 0);
  const Index twin = mesh.node_count();
  mesh.points.conservativeResize(twin + 1, 3);
  mesh.points.row(twin) = mesh.points.row(there);
  for (Index cell = 0; cell < mesh.cell_count(); ++cell) {
    Eigen::RowVector3d middle = Eigen::RowVector3d::Zero();
    for (const Index n : mesh.cell(cell)) middle += mesh.points.row(n) / 8;
    const bool is_beyond = middle.x() > 20 || middle.z() > height;
    for (Index i = mesh.offsets[cell]; is_beyond && i < mesh.offsets[cell + 1]; ++i)
      if (mesh.connectivity[i] == there) mesh.connectivity[i] = twin;
  }
  const MorphCase c = mesh_case(read_step(model_file("shapes/box.step")), mesh);
  const Morphed m = morph(c, to_model(BRepPrimAPI_MakeBox(50, 24, 20).Solid()));
  const Points expected = images(c.mesh.points, [](const Vector3d& x) -> Vector3d {
    return {1.25 * x.x(), 0.8 * x.y(), x.z()};
  });
  CHECK(largest_difference(m.points, expected) <= kKnown * c.diagonal);
  CHECK(m.points.row(there) == m.points.row(twin));
  REQUIRE(m.surface.warnings.size() == 1);
  // Those two alone, not the nodes round them, where the sides meet.
  CHECK_THAT(m.surface.warnings[0],
             Catch::Contains("crack inside: 8 facets") &&
                 Catch::EndsWith(": " + std::to_string(there) + ", " + std::to_string(twin)));
}

TEST_CASE("a hole inside of the mesh is named as that", "[surface][crack][errors]") {
  Mesh whole = hex_grid({8, 6, 4}, [](const Vector3d& s) -> Vector3d {
    return {40 * s.x(), 30 * s.y(), 20 * s.z()};
  });
  Mesh mesh;
  mesh.points = whole.points;
  mesh.offsets = {0};
  for (Index cell = 0; cell < whole.cell_count(); ++cell) {
    Vector3d middle = Vector3d::Zero();
    for (const Index n : whole.cell(cell)) middle += whole.points.row(n).transpose() / 8;
    if ((middle - Vector3d(20, 15, 10)).norm() > 6) {
      add_cell(mesh, CellType::Hexahedron, whole.cell(cell));
      mesh.regions.push_back(0);
    }
  }
  REQUIRE(whole.cell_count() - mesh.cell_count() == 8);
  const CadModel base = read_step(model_file("shapes/box.step"));
  const Boundary boundary = extract_boundary(mesh);
  CHECK_THROWS_WITH(SurfaceMorph(std::make_shared<CadModel>(base), mesh, boundary),
                    Catch::Contains("hole inside"));
}

TEST_CASE("blocks that share one face keep their interface", "[surface][solids]") {
  const MorphCase c = model_case(to_model(glued_blocks(30, 20)), "shapes/two_blocks.vtu");
  CHECK(c.base->faces().size() == 11);
  const auto stretch = [](const Vector3d& x) -> Vector3d {
    return {x.x() <= 30 ? x.x() * 36 / 30 : 36 + (x.x() - 30) * 14 / 20, x.y(), x.z()};
  };
  const auto result = morph_surface(c, to_model(glued_blocks(36, 14)));
  const Points expected = images(surface_points(c.boundary, c.mesh.points), stretch);
  CHECK(largest_difference(result.positions, expected) <= 1e-8 * c.diagonal);
}
