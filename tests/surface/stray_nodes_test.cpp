#include <BRepFilletAPI_MakeFillet.hxx>
#include <BRepPrimAPI_MakeBox.hxx>
#include <BRep_Builder.hxx>
#include <TopExp_Explorer.hxx>
#include <TopoDS.hxx>
#include <TopoDS_Compound.hxx>
#include <catch2/catch.hpp>
#include <optional>

#include "cad/topology_match.h"
#include "core/errors.h"
#include "morph_case.h"
#include "triangulation.h"

using namespace cadmorph;
using namespace cadmorph::testing;
using Eigen::Vector3d;

namespace {

constexpr double kSize = 40, kRadius = 10;

// A box about the origin with all edges rounded.
TopoDS_Shape rounded_box(double radius = kRadius) {
  const double half = kSize / 2;
  const TopoDS_Shape box =
      BRepPrimAPI_MakeBox(gp_Pnt(-half, -half, -half), gp_Pnt(half, half, half)).Shape();
  BRepFilletAPI_MakeFillet fillet(box);
  for (TopExp_Explorer edge(box, TopAbs_EDGE); edge.More(); edge.Next())
    fillet.Add(radius, TopoDS::Edge(edge.Current()));
  return fillet.Shape();
}

// Nodes exactly on the rounded box, few of them on the edges where its faces meet smoothly.
Vector3d in_rounded_box(const Vector3d& s) {
  const double half = kSize / 2, core = half - kRadius;
  const Vector3d x = kSize * (s - Vector3d::Constant(0.5));
  const double out = x.cwiseAbs().maxCoeff();
  if (out < 1e-9) return Vector3d::Zero();
  const Vector3d on_cube = x * (half / out);
  const Vector3d inner = on_cube.cwiseMax(-core).cwiseMin(core);
  return out / half * (inner + kRadius * (on_cube - inner).normalized());
}

MorphCase rounded_case(int cells) {
  return mesh_case(to_model(rounded_box()), hex_grid({cells, cells, cells}, in_rounded_box));
}

}  // namespace

TEST_CASE("a mesh that does not follow edges where faces meet smoothly stays on its faces",
          "[surface][association]") {
  for (const int cells : {7, 9, 12}) {
    const MorphCase c = rounded_case(cells);
    const SurfaceMorph surface(c.base, c.mesh, c.boundary);
    const Association& a = surface.association();
    CHECK(a.max_distance < 1e-6 * kSize);
    CHECK(a.unmatched_nodes == 0);
    CHECK(a.stray_nodes == 0);
    const auto still = surface.morph(*c.base, match_topology(*c.base, *c.base));
    CHECK(still.positions == surface_points(c.boundary, c.mesh.points));
    CHECK(still.beyond_wires.maxCoeff() < 1e-6 * kSize);
    CHECK(still.folded_facets.empty());
    gp_Trsf shift;
    shift.SetTranslation(gp_Vec(3, -20, 7));
    const CadModel moved = to_model(transformed(rounded_box(), shift));
    const auto result = surface.morph(moved, match_topology(*c.base, moved));
    const Points expected =
        surface_points(c.boundary, c.mesh.points).rowwise() + Eigen::RowVector3d(3, -20, 7);
    CHECK(largest_difference(result.positions, expected) < 1e-7 * kSize);
  }
}

TEST_CASE("few nodes off the CAD go with what is next to them, as far off as they are",
          "[surface][association][strays]") {
  MorphCase c = rounded_case(16);
  const double cell = kSize / 16;
  std::vector<Index> off;
  for (std::size_t i = 0; i < c.boundary.nodes.size(); i += 61) off.push_back(c.boundary.nodes[i]);
  const Points before = c.mesh.points;
  for (const Index node : off) c.mesh.points.row(node) *= 1 + 0.6 * cell / before.row(node).norm();
  const SurfaceMorph surface(c.base, c.mesh, c.boundary);
  const Association& a = surface.association();
  CHECK(a.stray_nodes == std::ssize(off));
  CHECK(a.unmatched_nodes == 0);
  CHECK(a.max_distance > 0.3 * cell);
  CHECK(a.max_distance < 0.61 * cell);
  const auto still = surface.morph(*c.base, match_topology(*c.base, *c.base));
  CHECK(still.positions == surface_points(c.boundary, c.mesh.points));
  CHECK(std::ranges::any_of(still.warnings, [](const std::string& text) {
    return text.find("farther off the CAD than the tolerance") != std::string::npos;
  }));
  // A part of another size: what lay on it does so, and the others are about as far off.
  gp_Trsf scale;
  scale.SetScaleFactor(1.25);
  const CadModel larger = to_model(transformed(rounded_box(), scale));
  const auto result = surface.morph(larger, match_topology(*c.base, larger));
  const Points expected = 1.25 * surface_points(c.boundary, c.mesh.points);
  CHECK(largest_difference(result.positions, expected) < 1e-6 * kSize);
  SurfaceMorphOptions strict;
  strict.unmatched = UnmatchedPolicy::Error;
  CHECK_THROWS_AS(SurfaceMorph(c.base, c.mesh, c.boundary, strict), AssociationError);
}

TEST_CASE("a few nodes far off the CAD, amid others on it, go with the volume",
          "[surface][association][strays]") {
  // As where a mesher bridged a gap narrower than its cells: 4 mesh edges off.
  MorphCase c = rounded_case(16);
  const double cell = kSize / 16;
  const Points before = c.mesh.points;
  const auto push_out = [&](std::size_t count) {
    c.mesh.points = before;
    std::vector<RowId> rows;
    for (std::size_t i = 0; i < count; ++i) {
      rows.push_back(RowId(Index(i) * 300));
      const Index node = c.boundary.nodes[rows.back()];
      c.mesh.points.row(node) *= 1 + 4 * cell / before.row(node).norm();
    }
    return rows;
  };
  REQUIRE(c.boundary.nodes.size() > 1500);
  const std::vector<RowId> off = push_out(3);
  const SurfaceMorph surface(c.base, c.mesh, c.boundary);
  const Association& a = surface.association();
  CHECK(a.stranded == off);
  CHECK(a.unmatched_nodes == 0);
  for (const RowId row : off) CHECK(a.is_free[row]);
  const auto still = surface.morph(*c.base, match_topology(*c.base, *c.base));
  CHECK(still.positions == surface_points(c.boundary, c.mesh.points));
  CHECK(std::ranges::any_of(still.warnings, [](const std::string& text) {
    return text.find("3 surface nodes lie on no CAD face, amid others") != std::string::npos;
  }));
  SurfaceMorphOptions strict;
  strict.unmatched = UnmatchedPolicy::Error;
  CHECK_THROWS_AS(SurfaceMorph(c.base, c.mesh, c.boundary, strict), AssociationError);

  // A part that the CAD does not have: nodes side by side.
  c.mesh.points = before;
  Index pushed = 0;
  for (const Index node : c.boundary.nodes)
    if (before(node, 2) > kSize / 2 - 1e-6 && before.row(node).head<2>().norm() < 2.2 * cell) {
      c.mesh.points(node, 2) += 2 * cell;
      ++pushed;
    }
  REQUIRE(pushed > 12);
  CHECK_THROWS_AS(SurfaceMorph(c.base, c.mesh, c.boundary), AssociationError);
}

TEST_CASE("a face of the mesh that is another one than the CAD's is refused",
          "[surface][association][strays]") {
  MorphCase c = rounded_case(16);
  const double cell = kSize / 16;
  for (const Index node : c.boundary.nodes)
    if (c.mesh.points(node, 2) > kSize / 2 - 1e-6) c.mesh.points(node, 2) += 0.4 * cell;
  CHECK_THROWS_AS(SurfaceMorph(c.base, c.mesh, c.boundary), AssociationError);
}

TEST_CASE("a sheet whose rim is another one than the CAD's is refused",
          "[surface][association][strays]") {
  constexpr int kCells = 40;
  const TopoDS_Shape box = BRepPrimAPI_MakeBox(gp_Pnt(0, 0, -1), gp_Pnt(40, 40, 0)).Shape();
  std::optional<CadModel> plate;
  for (TopExp_Explorer face(box, TopAbs_FACE); face.More(); face.Next())
    if (CadModel one = to_model(face.Current()); one.lower().z() > -0.5) plate.emplace(one);
  REQUIRE(plate);
  Mesh mesh;
  mesh.points.resize((kCells + 1) * (kCells + 1), 3);
  const auto node = [](int i, int j) { return Index{j} * (kCells + 1) + i; };
  for (int j = 0; j <= kCells; ++j)
    for (int i = 0; i <= kCells; ++i) mesh.points.row(node(i, j)) << i, j, 0;
  for (int j = 0; j < kCells; ++j)
    for (int i = 0; i < kCells; ++i)
      add_cell(mesh, CellType::Quad,
               std::array{node(i, j), node(i + 1, j), node(i + 1, j + 1), node(i, j + 1)});
  const auto moved = [&](int first, int last) {
    Mesh result = mesh;
    for (int j = first; j <= last; ++j) result.points(node(kCells, j), 0) += 0.7;
    return mesh_case(*plate, result);
  };
  const MorphCase few = moved(10, 12);
  CHECK(SurfaceMorph(few.base, few.mesh, few.boundary).association().stray_nodes == 3);
  const MorphCase all = moved(0, kCells);
  CHECK_THROWS_AS(SurfaceMorph(all.base, all.mesh, all.boundary), AssociationError);
}

TEST_CASE("the open ends of a narrow gap are no strays of its walls",
          "[surface][association][strays]") {
  // Two sheets; the mesh between them is two cells high.
  TopoDS_Compound walls;
  BRep_Builder builder;
  builder.MakeCompound(walls);
  const TopoDS_Shape box = BRepPrimAPI_MakeBox(20, 20, 1).Shape();
  for (TopExp_Explorer face(box, TopAbs_FACE); face.More(); face.Next()) {
    const CadModel one = to_model(face.Current());
    if (one.upper().z() - one.lower().z() < 0.5) builder.Add(walls, face.Current());
  }
  const MorphCase c =
      mesh_case(to_model(walls), hex_grid({20, 20, 2}, [](const Vector3d& s) -> Vector3d {
                  return {20 * s.x(), 20 * s.y(), s.z()};
                }));
  CHECK_THROWS_AS(SurfaceMorph(c.base, c.mesh, c.boundary), AssociationError);
  SurfaceMorphOptions fixed;
  fixed.unmatched = UnmatchedPolicy::Fix;
  const SurfaceMorph surface(c.base, c.mesh, c.boundary, fixed);
  CHECK(surface.association().stray_nodes == 0);
  CHECK(surface.association().unmatched_nodes == 80);
}
