#include "surface/mesh_unit.h"

#include <BRepPrimAPI_MakeCylinder.hxx>
#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>

#include "cad/topology_match.h"
#include "core/errors.h"
#include "morph_case.h"
#include "surface_parts.h"
#include "triangulation.h"

using namespace cadmorph;
using namespace cadmorph::testing;
using Eigen::Vector3d;
using std::numbers::pi;

namespace {

constexpr double kRadius = 5, kHeight = 20;

CadModel cylinder_at(const gp_Pnt& origin) {
  return to_model(
      BRepPrimAPI_MakeCylinder(gp_Ax2(origin, gp_Dir(0, 0, 1)), kRadius, kHeight).Solid());
}

/// A mesh round the cylinder whose diagonal is `times` the cylinder's.
Mesh far_field(const gp_Pnt& origin, double times) {
  const double diagonal = times * std::sqrt(8 * kRadius * kRadius + kHeight * kHeight);
  const double far = std::sqrt((diagonal * diagonal - kHeight * kHeight) / 8);
  return hex_grid(
      {8, 40, 6},
      [&](const Vector3d& s) -> Vector3d {
        const double r = kRadius + (far - kRadius) * std::pow(s.x(), 4), a = 2 * pi * s.y();
        return {origin.X() + r * std::cos(a), origin.Y() + r * std::sin(a),
                origin.Z() + kHeight * s.z()};
      },
      true);
}

}  // namespace

TEST_CASE("a far field's size does not decide the unit", "[surface][unit][far-field]") {
  // In metres, those of 1000, 100, 39.37 and 3.281 times are as large as the CAD in mm, cm, inch
  // and foot; with the origin on the CAD, the shrunken body lies on it too.
  for (const gp_Pnt& origin : {gp_Pnt(0, 0, 0), gp_Pnt(-kRadius, 0, 0), gp_Pnt(70, 20, 30)}) {
    const CadModel base = cylinder_at(origin);
    for (const double times : {1000.0, 100.0, 39.37, 30.0, 3.281})
      for (const double mm : {1.0, 1000.0, 10.0, 25.4, 304.8}) {
        CAPTURE(origin.X(), times, mm);
        Mesh mesh = far_field(origin, times);
        mesh.points /= mm;
        CHECK(detect_mesh_unit(base, mesh, extract_boundary(mesh)) == mm);
      }
  }
}

TEST_CASE("the unit of a mesh off the CAD goes by its size", "[surface][unit]") {
  const CadModel base = cylinder_at({0, 0, 0});
  for (const double mm : {1.0, 1000.0, 10.0, 25.4, 304.8}) {
    CAPTURE(mm);
    Mesh mesh = far_field({0, 0, 0}, 1.5);
    mesh.points /= 1.5 * mm;
    CHECK(detect_mesh_unit(base, mesh, extract_boundary(mesh)) == mm);
  }
}

TEST_CASE("the unit of the mesh is found and kept", "[surface][unit]") {
  const gp_Trsf map = similarity(0.4, 1.2, gp_Vec(3, 4, 5));
  for (const std::string name : {"bracket", "cylinder", "plate_12_holes"})
    for (const double mm : {1.0, 1000.0, 10.0, 25.4, 304.8}) {
      DYNAMIC_SECTION(name << " in units of " << mm << " mm") {
        MorphCase c = shape_case(name);
        const Points millimetres = c.mesh.points;
        c.mesh.points /= mm;
        const SurfaceMorph surface(c.base, c.mesh, c.boundary);
        CHECK(surface.association().mesh_unit_mm == mm);
        const CadModel variant =
            to_model(transformed(read_shape(model_file("shapes/" + name + ".step")), map));
        const auto result = surface.morph(variant, match_topology(*c.base, variant));
        const Points expected = images(surface_points(c.boundary, millimetres),
                                       [&](const Vector3d& x) { return apply(map, x); });
        CHECK(largest_difference(mm * result.positions, expected) <= kKnown * variant.diagonal());
      }
    }
}

TEST_CASE("a given unit is taken, and a wrong one is refused", "[surface][unit][errors]") {
  MorphCase c = shape_case("bracket");
  SurfaceMorphOptions options;
  options.association.mesh_unit_mm = 1000;
  CHECK_THROWS_AS(SurfaceMorph(c.base, c.mesh, c.boundary, options), AssociationError);
  c.mesh.points /= 1000;
  CHECK(SurfaceMorph(c.base, c.mesh, c.boundary, options).association().mesh_unit_mm == 1000);
}

TEST_CASE("a mesh in an unknown unit is refused with the unit to try", "[surface][unit][errors]") {
  MorphCase c = shape_case("bracket");
  c.mesh.points *= 1000;  // micrometres
  CHECK_THROWS_WITH(SurfaceMorph(c.base, c.mesh, c.boundary),
                    Catch::Matchers::Contains("the mesh's unit 0.001 "));
  SurfaceMorphOptions options;
  options.association.mesh_unit_mm = 0.001;
  CHECK(SurfaceMorph(c.base, c.mesh, c.boundary, options).association().unmatched_nodes == 0);
}
