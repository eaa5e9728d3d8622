#include "surface/joints.h"

#include <BRepAlgoAPI_BuilderAlgo.hxx>
#include <BRepAlgoAPI_Cut.hxx>
#include <BRepBuilderAPI_MakeFace.hxx>
#include <BRepPrimAPI_MakeBox.hxx>
#include <BRepPrimAPI_MakeCylinder.hxx>
#include <BRep_Builder.hxx>
#include <TopoDS_Compound.hxx>
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <gp_Pln.hxx>

#include "cad/face_sampler.h"
#include "morph_case.h"
#include "surface/surface_mesh.h"
#include "triangulation.h"

using namespace cadmorph;
using namespace cadmorph::testing;
using Eigen::Vector3d;

namespace {

using Parts = std::vector<TopoDS_Shape>;

/// The parts beside each other, no edge where they meet.
TopoDS_Shape together(const Parts& parts) {
  TopoDS_Compound compound;
  BRep_Builder builder;
  builder.MakeCompound(compound);
  for (const TopoDS_Shape& part : parts) builder.Add(compound, part);
  return compound;
}

/// The parts with all faces split where they meet.
TopoDS_Shape imprinted(const Parts& parts) {
  TopTools_ListOfShape arguments;
  for (const TopoDS_Shape& part : parts) arguments.Append(part);
  BRepAlgoAPI_BuilderAlgo fuse;
  fuse.SetArguments(arguments);
  fuse.Build();
  REQUIRE(fuse.IsDone());
  return fuse.Shape();
}

TopoDS_Shape block(const Vector3d& low, const Vector3d& size) {
  return BRepPrimAPI_MakeBox(gp_Pnt(low[0], low[1], low[2]), size[0], size[1], size[2]).Solid();
}

Parts pin_on_plate(double x) {
  const gp_Ax2 axis(gp_Pnt(x, 20, 6), gp_Dir(0, 0, 1));
  return {block({0, 0, 0}, {60, 40, 6}), BRepPrimAPI_MakeCylinder(axis, 7, 10).Solid()};
}

/// Ribs from one side of a plate to the other.
Parts ribbed_plate(double x) {
  return {block({0, 0, 0}, {60, 40, 6}), block({x, 0, 6}, {4, 40, 8}),
          block({x + 18, 0, 6}, {4, 40, 8})};
}

/// A wall along a part of a plate's side.
Parts plate_with_wall(double x) {
  return {block({0, 0, 0}, {60, 40, 6}), block({x, 0, 6}, {22, 4, 8})};
}

/// A pin that ends on a tube's side.
Parts pin_on_tube(double z) {
  const TopoDS_Shape tube = BRepPrimAPI_MakeCylinder(10, 60).Solid();
  const gp_Ax2 axis(gp_Pnt(0, 0, z), gp_Dir(0.8, 0.6, 0));
  return {tube, BRepAlgoAPI_Cut(BRepPrimAPI_MakeCylinder(axis, 4, 20).Solid(), tube).Shape()};
}

TopoDS_Shape sheet(const gp_Ax3& at, double u, double v) {
  return BRepBuilderAPI_MakeFace(gp_Pln(at), 0, u, 0, v).Face();
}

/// A sheet that leans on a plate at x, from below it to above it, wider than it or not.
Parts crossing_sheets(double x, double from, double width) {
  const gp_Dir up(0.6, 0, 0.8), normal(0.8, 0, -0.6);
  const gp_Pnt low(x - 6, from, -8);
  const gp_Dir along(0, 1, 0);
  const gp_Ax3 leaning(low, normal, along);
  const bool is_up = leaning.YDirection().Dot(up) > 0;
  return {
      sheet(gp_Ax3(gp_Pnt(0, 0, 0), gp_Dir(0, 0, 1), gp_Dir(1, 0, 0)), 60, 40),
      BRepBuilderAPI_MakeFace(gp_Pln(leaning), 0, width, is_up ? 0 : -20, is_up ? 20 : 0).Face()};
}

/// Three sheets through each other, the third at x.
Parts three_sheets(double x) {
  return {sheet(gp_Ax3(gp_Pnt(0, 0, 0), gp_Dir(0, 0, 1), gp_Dir(1, 0, 0)), 60, 40),
          sheet(gp_Ax3(gp_Pnt(0, 20, -15), gp_Dir(0, -1, 0), gp_Dir(1, 0, 0)), 60, 30),
          sheet(gp_Ax3(gp_Pnt(x, 0, -15), gp_Dir(1, 0, 0), gp_Dir(0, 1, 0)), 40, 30)};
}

/// A rod through a sheet.
Parts rod_through_sheet(double x) {
  const gp_Ax2 axis(gp_Pnt(x, 20, -12), gp_Dir(0, 0, 1));
  return {sheet(gp_Ax3(gp_Pnt(0, 0, 0), gp_Dir(0, 0, 1), gp_Dir(1, 0, 0)), 70, 40),
          BRepPrimAPI_MakeCylinder(axis, 6, 24).Solid()};
}

/// Of the expected move: what nodes may be off by where parts meet in a point or along an edge of
/// one of them; projections on one surface after the other stop there.
constexpr double kMeeting = 5e-6;

/// Of the expected move, twice what they measured: the pieces of an imprinted face are spread each
/// by itself, a whole face as one.
struct Allowed {
  double within_faces;
  double on_lines = kMeeting;  ///< in which sheets cross
};

/// Moves the mesh of the imprinted parts by CAD in which they are imprinted, and in which not.
void check_alike(const Parts& base, const Parts& variant, double expected_move,
                 const Allowed& allowed) {
  const Mesh corners = triangulate(imprinted(base), 0.05, 0.2);  // no nodes within plane faces
  const CadModel split_cad = to_model(imprinted(base)), whole_cad = to_model(together(base));
  REQUIRE(whole_cad.coedges().size() < split_cad.coedges().size());
  const CadModel split_variant = to_model(imprinted(variant)),
                 whole_variant = to_model(together(variant));
  for (const bool has_inner_nodes : {false, true}) {
    CAPTURE(has_inner_nodes);
    const Mesh mesh = has_inner_nodes ? split_triangles(corners) : corners;
    const MorphCase split = mesh_case(split_cad, mesh), whole = mesh_case(whole_cad, mesh);
    const SurfaceMorphResult expected = morph_surface(split, split_variant);
    const SurfaceMorphResult result = morph_surface(whole, whole_variant);
    REQUIRE(largest_difference(expected.positions, surface_points(split.boundary, mesh.points)) >
            0.9 * expected_move);
    double where_parts_meet = 0, elsewhere = 0;
    for (const RowId row : result.entity.ids()) {
      const bool is_joint = std::ranges::binary_search(result.jointed, row);
      double& worst = is_joint ? where_parts_meet : elsewhere;
      worst = std::max(worst, (result.positions.row(row) - expected.positions.row(row)).norm());
    }
    CHECK(result.jointed.size() >= 2);
    CHECK(result.folded_facets.empty());
    CHECK(where_parts_meet <= (has_inner_nodes ? allowed.on_lines : kMeeting) * expected_move);
    CHECK(elsewhere <= (has_inner_nodes ? allowed.within_faces : kMeeting) * expected_move);
    if (!has_inner_nodes) CHECK(result.warnings.empty());  // chords leave the side of a tube
  }
}

}  // namespace

TEST_CASE("Parts that stand on each other move alike, imprinted or not", "[surface][joints]") {
  SECTION("a pin on a plate") {
    check_alike(pin_on_plate(22), pin_on_plate(31), 9, {.within_faces = 0.35});
  }
  SECTION("ribs across a plate") {
    check_alike(ribbed_plate(9), ribbed_plate(17), 8, {.within_faces = 0.15});
  }
  SECTION("a wall at a plate's side") {
    check_alike(plate_with_wall(9), plate_with_wall(20), 11, {.within_faces = 0.12});
  }
  SECTION("a pin on a tube") {
    check_alike(pin_on_tube(25), pin_on_tube(33), 8, {.within_faces = 0.065});
  }
  SECTION("a sheet through a plate") {
    check_alike(crossing_sheets(20, 8, 24), crossing_sheets(29, 8, 24), 9, {.within_faces = 0.065});
  }
  SECTION("a sheet through a plate and beyond") {
    check_alike(crossing_sheets(20, -3, 46), crossing_sheets(29, -3, 46), 9,
                {.within_faces = 0.28});
  }
  SECTION("three sheets") {
    check_alike(three_sheets(22), three_sheets(31), 9, {.within_faces = 0.16, .on_lines = 0.2});
  }
  SECTION("a rod by more than its diameter") {
    check_alike(rod_through_sheet(20), rod_through_sheet(45), 25, {.within_faces = 0.24});
  }
}

TEST_CASE("Parts that no longer meet are remarked on", "[surface][joints]") {
  const auto check = [](const Parts& base, const std::function<bool(const Vector3d&)>& is_joint) {
    gp_Trsf up;
    up.SetTranslation(gp_Vec(0, 0, 10));
    const Parts variant = {base[0], base[1].Moved(up)};
    const MorphCase c =
        mesh_case(to_model(together(base)), triangulate(imprinted(base), 0.05, 0.2));
    Index joints = 0;
    for (const Index n : c.boundary.nodes) joints += is_joint(c.mesh.points.row(n));
    REQUIRE(joints >= 2);
    const SurfaceMorphResult result = morph_surface(c, to_model(together(variant)));
    CHECK(result.parted.nodes == joints);
    CHECK(result.parted.distance == Approx(10));
    REQUIRE_FALSE(result.warnings.empty());
    CHECK(result.warnings.back().find("do the parts still meet") != std::string::npos);
  };
  SECTION("sheets that crossed") {
    check(crossing_sheets(20, 8, 24),
          [](const Vector3d& x) { return std::abs(x.z()) < 1e-9 && std::abs(x.x() - 20) < 1e-9; });
  }
  SECTION("a pin off its plate") {
    check(pin_on_plate(22), [](const Vector3d& x) {
      return std::abs(x.z() - 6) < 1e-9 && std::abs(std::hypot(x.x() - 22, x.y() - 20) - 7) < 1e-6;
    });
  }
}

TEST_CASE("Ordinary parts have no joints", "[surface][joints]") {
  for (const std::string& name : all_shapes()) {
    CAPTURE(name);
    const MorphCase c = shape_case(name);
    const Association association = associate(*c.base, c.mesh, c.boundary);
    const Joints joints =
        find_joints(*c.base, make_surface_mesh(c.mesh, c.boundary, 1), association);
    CHECK(joints.on_edges.empty());
    CHECK(joints.crossings.empty());
    for (const auto& of_face : joints.of_face) CHECK(of_face.empty());
  }
}

TEST_CASE("A sketch on a solid's side has no part in it", "[surface][joints]") {
  // The sketch comes first and stays where it was, as the plate grows.
  const auto plate = [](double height) { return block({0, 0, 0}, {60, 40, height}); };
  const auto with_sketch = [&](double height) {
    return to_model(
        together({sheet(gp_Ax3(gp_Pnt(10, 5, 6), gp_Dir(0, 0, 1), gp_Dir(1, 0, 0)), 30, 25),
                  plate(height)}));
  };
  const Mesh mesh = hex_grid(
      {12, 8, 2}, [](const Vector3d& x) { return Vector3d(60 * x[0], 40 * x[1], 6 * x[2]); });
  const SurfaceMorphResult result = morph_surface(mesh_case(with_sketch(6), mesh), with_sketch(8));
  CHECK(result.warnings.empty());
  CHECK(result.jointed.empty());
  const SurfaceMorphResult expected =
      morph_surface(mesh_case(to_model(plate(6)), mesh), to_model(plate(8)));
  CHECK(largest_difference(result.positions, expected.positions) < 1e-9);
}

TEST_CASE("A line within a face where another part ends on it bounds nothing",
          "[surface][joints]") {
  const Parts base = crossing_sheets(20, 8, 24);
  const CadModel cad = to_model(imprinted(base));
  const Mesh mesh = split_triangles(split_triangles(triangulate(imprinted(base), 0.05, 0.2)));
  const MorphCase c = mesh_case(to_model(imprinted(base)), mesh);
  const SurfaceMorphResult result = morph_surface(c, cad);
  CHECK(result.warnings.empty());
  CHECK(largest_difference(result.positions, c.mesh.points(c.boundary.nodes, Eigen::all)) < 1e-12);
  // Both sheets are rectangles, and so are what each cuts the other into.
  for (const FaceId face : cad.faces().ids()) CHECK(sample_domain(cad, face, 12).size() == 144);
}

TEST_CASE("Nodes on sheets that cross are told, all of them", "[surface][joints]") {
  const Parts base = three_sheets(22);
  const MorphCase c = mesh_case(to_model(together(base)), triangulate(imprinted(base), 0.05, 0.2));
  const SurfaceMorphResult result = morph_surface(c, to_model(together(three_sheets(31))));
  std::vector<RowId> expected;
  for (const RowId row : result.entity.ids()) {
    const Eigen::RowVector3d x = c.mesh.points.row(c.boundary.nodes[row]);
    const int sheets = (x[2] == 0) + (x[1] == 20) + (x[0] == 22);
    if (sheets > 1) expected.push_back(row);
  }
  REQUIRE(expected.size() > 4);
  CHECK(result.crossing == expected);
  CHECK(std::ranges::includes(result.jointed, expected));
}
