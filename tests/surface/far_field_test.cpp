#include <BRepAlgoAPI_Common.hxx>
#include <BRepAlgoAPI_Cut.hxx>
#include <BRepPrimAPI_MakeBox.hxx>
#include <BRepPrimAPI_MakeSphere.hxx>
#include <catch2/catch.hpp>
#include <cmath>
#include <gp_Ax2.hxx>
#include <numbers>

#include "core/errors.h"
#include "morph_case.h"
#include "surface_parts.h"
#include "triangulation.h"

using namespace cadmorph;
using namespace cadmorph::testing;
using Eigen::Vector3d;
using std::numbers::pi;

TEST_CASE("a far field stays while its body grows and shifts", "[surface][far-field]") {
  const MorphCase c = shape_case("sphere_far_field");
  const Vector3d centre(2, -1, 1.5);
  for (const auto policy : {UnmatchedPolicy::Auto, UnmatchedPolicy::Fix, UnmatchedPolicy::Slide}) {
    SurfaceMorphOptions options;
    options.unmatched = policy;
    const auto result = morph_surface(c, to_model(sphere_at(centre, 13)), options);
    const Points expected = moved_by(c, [&](const Vector3d& x) -> Vector3d {
      if (x.norm() > 11) return x;
      return centre + 13 * x.normalized();
    });
    CHECK(largest_difference(result.positions, expected) <= 1e-9 * c.diagonal);
  }
}

TEST_CASE("an unmatched boundary is refused on request", "[surface][far-field][errors]") {
  const MorphCase c = shape_case("sphere_far_field");
  SurfaceMorphOptions options;
  options.unmatched = UnmatchedPolicy::Error;
  CHECK_THROWS_AS(SurfaceMorph(c.base, c.mesh, c.boundary, options), AssociationError);
}

TEST_CASE("the far field's nodes are told from the body's", "[surface][far-field]") {
  const MorphCase c = shape_case("sphere_far_field");
  const SurfaceMorph surface(c.base, c.mesh, c.boundary);
  const Association& a = surface.association();
  Index far = 0;
  for (const RowId i : a.dimension.ids()) {
    const bool is_far = c.mesh.points.row(c.boundary.nodes[i]).norm() > 11;
    far += is_far;
    CHECK((a.dimension[i] == CadDimension::None) == is_far);
  }
  CHECK(a.unmatched_nodes == far);
}

TEST_CASE("a sphere round a body that turns stays where it is", "[surface][far-field]") {
  const TopoDS_Shape box = BRepPrimAPI_MakeBox(gp_Pnt(-5, -2, -1), gp_Pnt(5, 2, 1)).Solid();
  const gp_Trsf turn = turn_about_z(0.35);
  const TopoDS_Shape turned = transformed(box, turn);
  const TopoDS_Shape field = BRepAlgoAPI_Cut(sphere_at({0, 0, 0}, 30), box).Shape();
  const MorphCase c = mesh_case(to_model(field), triangulate(field, 0.2));
  const auto result =
      morph_surface(c, to_model(BRepAlgoAPI_Cut(sphere_at({0, 0, 0}, 30), turned).Shape()));
  const Points old = surface_points(c.boundary, c.mesh.points);
  Index far = 0, near = 0;
  for (Index n = 0; n < old.rows(); ++n)
    if (old.row(n).norm() > 15) {
      ++far;
      CHECK((result.positions.row(n) - old.row(n)).norm() <= 1e-12 * c.diagonal);
    } else {
      ++near;
      CHECK((Vector3d(result.positions.row(n)) - apply(turn, old.row(n))).norm() <=
            kKnown * c.diagonal);
    }
  CHECK(far > 700);
  CHECK(near >= 8);  // the corners of the box
}

TEST_CASE("half a sphere round a body on its symmetry plane that turns stays where it is",
          "[surface][far-field]") {
  const TopoDS_Shape box = BRepPrimAPI_MakeBox(gp_Pnt(-5, -2, -1), gp_Pnt(5, 2, 1)).Solid();
  const TopoDS_Shape half =
      BRepAlgoAPI_Common(sphere_at({0, 0, 0}, 30),
                         BRepPrimAPI_MakeBox(gp_Pnt(-40, -40, 0), gp_Pnt(40, 40, 40)).Solid())
          .Shape();
  const gp_Trsf turn = turn_about_z(0.35);
  const TopoDS_Shape field = BRepAlgoAPI_Cut(half, box).Shape();
  const MorphCase c = mesh_case(to_model(field), triangulate(field, 0.2));
  const auto result =
      morph_surface(c, to_model(BRepAlgoAPI_Cut(half, transformed(box, turn)).Shape()));
  CHECK(result.folded_facets.empty());
  const Points old = surface_points(c.boundary, c.mesh.points);
  Index far = 0, near = 0;
  for (Index n = 0; n < old.rows(); ++n) {
    const Vector3d x = old.row(n), y = result.positions.row(n);
    const bool is_on_plane = std::abs(x.z()) < 1e-9;
    if (std::abs(x.norm() - 30) < 1e-6) {
      ++far;
      CHECK((y - x).norm() <= 1e-12 * c.diagonal);
    } else if (is_on_plane) {
      CHECK(std::abs(y.z()) <= 1e-12 * c.diagonal);
    } else {
      ++near;
      CHECK((y - apply(turn, x)).norm() <= kKnown * c.diagonal);
    }
  }
  CHECK(far > 100);
  CHECK(near > 0);
}

TEST_CASE("a far field rests, written as B-splines beside a body that changes", "[surface][seam]") {
  // An eighth of a ball about a block.
  const auto flow = [](double height) {
    const TopoDS_Shape far = BRepPrimAPI_MakeSphere(gp_Ax2(), 60, 0, pi / 2, pi / 2).Shape();
    return BRepAlgoAPI_Cut(far, BRepPrimAPI_MakeBox(3, 4, height).Shape()).Shape();
  };
  const TopoDS_Shape before = flow(5);
  const MorphCase c = mesh_case(to_model(before), triangulate(before, 0.5, 0.3));
  for (const double height : {5.1, 12.0}) {
    const CadModel variant = to_model(to_nurbs(flow(height)));
    const SurfaceMorphResult result = morph_surface(c, variant);
    Index nodes = 0;
    double most = 0;
    for (std::size_t i = 0; i < c.boundary.nodes.size(); ++i) {
      const Eigen::RowVector3d from = c.mesh.points.row(c.boundary.nodes[i]);
      if (from.norm() < 60 - 1e-6) continue;
      ++nodes;
      most = std::max(most, (result.positions.row(i) - from).norm());
    }
    CAPTURE(height, nodes);
    CHECK(nodes > 50);
    CHECK(most < 1e-7 * c.diagonal);
  }
}
