#include <BRepPrimAPI_MakeCylinder.hxx>
#include <BRepPrimAPI_MakeSphere.hxx>
#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>

#include "cad/step_reader.h"
#include "cad/topology_match.h"
#include "morph_case.h"

using namespace cadmorph;
using namespace cadmorph::testing;
using Eigen::Vector3d;

namespace {

constexpr double kIdentity = 1e-9;  // of the diagonal, as the project asks
constexpr double kAffine = 1e-8;    // of the diagonal, as the project asks

Vector3d grown(const Vector3d& x, double radius) {
  const double r = std::hypot(x.x(), x.y());
  return {x.x() / r * radius, x.y() / r * radius, x.z()};
}

}  // namespace

TEST_CASE("the same STEP file twice moves no node of a shape", "[surface][identity]") {
  for (const auto& name : all_shapes()) {
    DYNAMIC_SECTION(name) {
      const MorphCase c = shape_case(name);
      const Morphed m = morph(c, read_step(model_file("shapes/" + name + ".step")));
      CHECK(largest_difference(m.points, c.mesh.points) <= kIdentity * c.diagonal);
      CHECK(m.surface.warnings.empty());
      CHECK(m.surface.folded_facets.empty());
      CHECK(m.surface.beyond_wires.isZero(0));
    }
  }
}

TEST_CASE("the same STEP file twice moves no node of bore and pipe", "[surface][identity]") {
  for (const std::string family : {"bore", "pipe"})
    for (const std::string mesh : {"hex", "tet", "tet_quadratic"}) {
      DYNAMIC_SECTION(family << ' ' << mesh) {
        const MorphCase c = file_case(family + "/base.step", family + "/" + mesh + ".vtu");
        const auto surface = morph_surface(c, read_step(model_file(family + "/base.step")));
        CHECK(largest_difference(surface.positions, surface_points(c.boundary, c.mesh.points)) <=
              kIdentity * c.diagonal);
        CHECK(surface.warnings.empty());
        CHECK(surface.folded_facets.empty());
        CHECK(surface.beyond_wires.isZero(0));
      }
    }
}

TEST_CASE("the same STEP file twice keeps a far field", "[surface][identity]") {
  const MorphCase c = shape_case("sphere_far_field");
  const Morphed m = morph(c, read_step(model_file("shapes/sphere_far_field.step")));
  CHECK(largest_difference(m.points, c.mesh.points) <= kIdentity * c.diagonal);
}

TEST_CASE("rotation, uniform scale and translation carry every node", "[surface][affine]") {
  const gp_Trsf map = similarity(0.5, 1.7, gp_Vec(30, -20, 11));
  for (const auto& name : all_shapes()) {
    DYNAMIC_SECTION(name) {
      const MorphCase c = shape_case(name);
      const CadModel variant =
          to_model(transformed(read_shape(model_file("shapes/" + name + ".step")), map));
      const Morphed m = morph(c, variant);
      const Points expected =
          images(c.mesh.points, [&](const Vector3d& x) { return apply(map, x); });
      CHECK(largest_difference(m.points, expected) <= kAffine * variant.diagonal());
    }
  }
}

TEST_CASE("a similarity survives a trip through STEP", "[surface][affine]") {
  const gp_Trsf map = similarity(-2.1, 0.4, gp_Vec(-3, 8, 100));
  for (const std::string name : {"bracket", "cone", "torus", "sphere", "two_blocks"}) {
    DYNAMIC_SECTION(name) {
      const MorphCase c = shape_case(name);
      const CadModel variant =
          through_step(transformed(read_shape(model_file("shapes/" + name + ".step")), map));
      const Morphed m = morph(c, variant);
      const Points expected =
          images(c.mesh.points, [&](const Vector3d& x) { return apply(map, x); });
      // STEP files keep 15 digits of coordinates that are larger than the part here.
      CHECK(largest_difference(m.points, expected) <= kAffine * variant.diagonal());
    }
  }
}

TEST_CASE("a general affine map of planar shapes carries every node", "[surface][affine]") {
  const gp_GTrsf map = general_affine();
  for (const std::string name : {"box", "two_blocks"}) {
    DYNAMIC_SECTION(name) {
      const MorphCase c = shape_case(name);
      const CadModel variant =
          to_model(transformed(read_shape(model_file("shapes/" + name + ".step")), map));
      const Morphed m = morph(c, variant);
      const Points expected =
          images(c.mesh.points, [&](const Vector3d& x) { return apply(map, x); });
      CHECK(largest_difference(m.points, expected) <= kAffine * variant.diagonal());
    }
  }
}

TEST_CASE("a general affine map of NURBS-converted shapes carries every node",
          "[surface][affine]") {
  const gp_GTrsf map = general_affine();
  for (const auto& name : all_shapes()) {
    DYNAMIC_SECTION(name) {
      const TopoDS_Shape nurbs = to_nurbs(read_shape(model_file("shapes/" + name + ".step")));
      const MorphCase c = model_case(to_model(nurbs), "shapes/" + name + ".vtu");
      const CadModel variant = to_model(transformed(nurbs, map));
      const Morphed m = morph(c, variant);
      const Points expected =
          images(c.mesh.points, [&](const Vector3d& x) { return apply(map, x); });
      CHECK(largest_difference(m.points, expected) <= kAffine * variant.diagonal());
    }
  }
}

TEST_CASE("a growing cylinder keeps angles and heights", "[surface][analytic]") {
  const MorphCase c = shape_case("cylinder");
  const auto surface = morph_surface(c, to_model(BRepPrimAPI_MakeCylinder(19.5, 40).Solid()));
  const Points old = surface_points(c.boundary, c.mesh.points);
  Index on_mantle = 0;
  for (Index n = 0; n < old.rows(); ++n) {
    const Vector3d x = old.row(n), y = surface.positions.row(n);
    if (std::abs(std::hypot(x.x(), x.y()) - 15) > 1e-9 * 15) continue;
    ++on_mantle;
    CHECK(std::abs(std::hypot(y.x(), y.y()) / 19.5 - 1) < 1e-9);
    CHECK((y - grown(x, 19.5)).norm() < 1e-9 * c.diagonal);
  }
  CHECK(on_mantle > 100);
}

TEST_CASE("a growing sphere keeps directions", "[surface][analytic]") {
  const MorphCase c = shape_case("sphere");
  const auto surface = morph_surface(c, to_model(BRepPrimAPI_MakeSphere(31).Solid()));
  const Points old = surface_points(c.boundary, c.mesh.points);
  for (Index n = 0; n < old.rows(); ++n) {
    const Vector3d x = old.row(n), y = surface.positions.row(n);
    CHECK(std::abs(y.norm() / 31 - 1) < 1e-9);
    CHECK((y - 31 * x.normalized()).norm() < 1e-9 * c.diagonal);
  }
}

TEST_CASE("a cylinder that grows in radius and height stretches evenly", "[surface][analytic]") {
  const MorphCase c = shape_case("cylinder");
  const Morphed m = morph(c, to_model(BRepPrimAPI_MakeCylinder(12, 70).Solid()));
  // An affine map, carried by the CAD's parameters: every node, inside too.
  const Points expected = images(c.mesh.points, [](const Vector3d& x) -> Vector3d {
    return {x.x() * 12 / 15, x.y() * 12 / 15, x.z() * 70 / 40};
  });
  CHECK(largest_difference(m.points, expected) <= kAffine * c.diagonal);
}

TEST_CASE("a part far from the origin is carried as well", "[surface][affine]") {
  gp_Trsf away;
  away.SetTranslation(gp_Vec(2e4, -3e4, 1e4));
  for (const std::string name : {"bracket", "torus", "cone"}) {
    DYNAMIC_SECTION(name) {
      const TopoDS_Shape shape =
          transformed(read_shape(model_file("shapes/" + name + ".step")), away);
      MorphCase c = shape_case(name);
      Mesh mesh = c.mesh;
      mesh.points.rowwise() += Eigen::RowVector3d(2e4, -3e4, 1e4);
      c = mesh_case(to_model(shape), mesh);
      const gp_Trsf map = similarity(0.7, 1.3, gp_Vec(5, 5, 5));
      const CadModel variant = to_model(transformed(shape, map));
      const auto result = morph_surface(c, variant);
      const Points expected = images(surface_points(c.boundary, c.mesh.points),
                                     [&](const Vector3d& x) { return apply(map, x); });
      CHECK(largest_difference(result.positions, expected) <= 1e-8 * variant.diagonal());
    }
  }
}

TEST_CASE("many similarities carry the surfaces of all shapes", "[surface][affine]") {
  for (const auto& name : all_shapes()) {
    DYNAMIC_SECTION(name) {
      const MorphCase c = shape_case(name);
      const SurfaceMorph surface(c.base, c.mesh, c.boundary);
      const TopoDS_Shape shape = read_shape(model_file("shapes/" + name + ".step"));
      for (int i = 0; i < 8; ++i) {
        gp_Trsf tilt;
        tilt.SetRotation(gp_Ax1(gp_Pnt(1, 2, 3), gp_Dir(std::sin(i), std::cos(2 * i), 0.3)), i);
        const gp_Trsf map =
            tilt * similarity(0.8 * i, std::pow(10, 0.5 * (i - 4)), gp_Vec(20 * i, -7 * i, i * i));
        const CadModel variant = to_model(transformed(shape, map));
        const auto result = surface.morph(variant, match_topology(*c.base, variant));
        const Points expected = images(surface_points(c.boundary, c.mesh.points),
                                       [&](const Vector3d& x) { return apply(map, x); });
        CAPTURE(i);
        // Coordinates far above the part's own size cost digits of it.
        const double reach = expected.rowwise().norm().maxCoeff();
        CHECK(largest_difference(result.positions, expected) <=
              1e-8 * variant.diagonal() + 1e-12 * reach);
      }
    }
  }
}
