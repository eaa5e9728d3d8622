#include <Eigen/Geometry>
#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>

#include "morph_case.h"

using namespace cadmorph;
using namespace cadmorph::testing;
using Eigen::Vector2d;
using Eigen::Vector3d;
using PointMap = std::function<Vector3d(const Vector3d&)>;

namespace {

TopoDS_Shape nurbs_shape(const std::string& name) {
  return to_nurbs(read_shape(model_file("shapes/" + name + ".step")));
}

/// S'(u, v) of the node's own parameters on each base face it lies on (by OCCT), against its new
/// position: the largest difference over all surface nodes.
double worst_of_parameters(const MorphCase& c, const TopoDS_Shape& base,
                           const TopoDS_Shape& variant, const Points& surface) {
  const FaceOracle from(base), to(variant);
  REQUIRE(from.face_count() == to.face_count());
  double worst = 0;
  for (std::size_t i = 0; i < c.boundary.nodes.size(); ++i) {
    const Vector3d x = c.mesh.points.row(c.boundary.nodes[i]);
    const auto [face, distance] = from.nearest(x);
    REQUIRE(distance < 1e-4 * c.diagonal);
    const Vector3d known = to.point(face, from.parameters(face, x));
    const Vector3d offset = x - from.point(face, from.parameters(face, x));
    const Vector3d found = surface.row(static_cast<Index>(i)).transpose();
    // The carried offset turns with the surface: leave out its length.
    worst = std::max(worst, (found - known).norm() - 2 * offset.norm());
  }
  return worst;
}

void check_moved_poles(const std::string& name, const PointMap& map, int spans) {
  const TopoDS_Shape base = nurbs_shape(name);
  const TopoDS_Shape variant = with_moved_poles(base, map, spans);
  const MorphCase c = model_case(to_model(base), "shapes/" + name + ".vtu");
  const CadModel variant_model = to_model(variant);
  const auto result = morph_surface(c, variant_model);
  CHECK(worst_of_parameters(c, base, variant, result.positions) <= 1e-6 * variant_model.diagonal());
}

}  // namespace

TEST_CASE("extruded and turned NURBS parts follow their moved control points", "[surface][nurbs]") {
  const std::vector<std::pair<std::string, double>> parts{
      {"box", 20},          {"plate_12_holes", 12}, {"plate_4_holes", 10}, {"stepped_shaft", 70},
      {"cone_frustum", 30}, {"cone", 30},           {"cylinder", 40},      {"blade", 75}};
  for (const auto& [name, height] : parts) {
    DYNAMIC_SECTION(name << " tapered") { check_moved_poles(name, twist_and_taper(height, 0), 0); }
    DYNAMIC_SECTION(name << " twisted") {
      check_moved_poles(name, twist_and_taper(height, 0.3), 0);
    }
  }
}

TEST_CASE("NURBS parts with inserted knots follow their moved control points", "[surface][nurbs]") {
  const std::vector<std::pair<std::string, double>> parts{
      {"cylinder", 40}, {"cone_frustum", 30}, {"blade", 75}};
  for (const auto& [name, height] : parts) {
    DYNAMIC_SECTION(name) { check_moved_poles(name, twist_and_taper(height, 0.2), 4); }
  }
}

TEST_CASE("a NURBS box, sphere and torus follow freely moved control points", "[surface][nurbs]") {
  const PointMap bulge = [](const Vector3d& x) -> Vector3d {
    const Vector3d s = x / 40;
    return x + 3 * Vector3d(std::sin(2 * s.y() + s.z()), std::cos(2 * s.x()) * s.z(),
                            std::sin(1.5 * s.x()) + s.y() * s.y());
  };
  for (const std::string name : {"box", "sphere", "torus"}) {
    DYNAMIC_SECTION(name) { check_moved_poles(name, bulge, name == "box" ? 3 : 0); }
  }
}

TEST_CASE("a general affine map of analytic parts stays on its faces, unfolded and near",
          "[surface][affine]") {
  const gp_GTrsf map = general_affine();
  for (const std::string name : {"plate_12_holes", "bracket", "stepped_shaft", "sphere_in_box",
                                 "torus", "cone_frustum", "blade", "cylinder", "sphere"}) {
    DYNAMIC_SECTION(name) {
      const MorphCase c = shape_case(name);
      const TopoDS_Shape shape =
          transformed(read_shape(model_file("shapes/" + name + ".step")), map);
      const CadModel variant = to_model(shape);
      const Morphed m = morph(c, variant);
      const Points expected =
          images(c.mesh.points, [&](const Vector3d& x) { return apply(map, x); });
      CHECK(largest_difference(m.points, expected) <= 0.05 * variant.diagonal());
      CHECK(folded_facets(c.boundary, m.points, expected) == 0);

      // Faces keep their order here: a node stays on each of the faces it lay on.
      const FaceOracle from(read_shape(model_file("shapes/" + name + ".step"))), to(shape);
      double tolerance = 1e-6 * variant.diagonal();
      for (const auto& e : variant.edges()) tolerance = std::max(tolerance, e.tolerance);
      double worst = 0;
      for (const Index n : c.boundary.nodes)
        for (int f = 0; f < from.face_count(); ++f)
          if (from.is_near(f, c.mesh.points.row(n), 1e-6 * c.diagonal))
            worst = std::max(worst, to.distance(f, m.points.row(n)));
      CHECK(worst <= tolerance);
    }
  }
}
