#include "surface/mesh_unit.h"

#include <BRepPrimAPI_MakeCylinder.hxx>
#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>

#include "morph_case.h"
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
