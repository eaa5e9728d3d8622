#include <BRepPrimAPI_MakeBox.hxx>
#include <catch2/catch.hpp>

#include "cad/topology_match.h"
#include "core/errors.h"
#include "morph_case.h"
#include "triangulation.h"

using namespace cadmorph;
using namespace cadmorph::testing;
using Eigen::Vector3d;

TEST_CASE("groups that can't do what they are asked to are named", "[surface][errors]") {
  MorphCase c = shape_case("sphere_far_field");
  c.mesh.groups = {{"far", "marker", {}}, {"inside", "marker", {}}};
  for (Index n = 0; n < c.mesh.node_count(); ++n)
    if (!std::ranges::binary_search(c.boundary.nodes, n))
      c.mesh.groups[1].nodes.push_back(n);
    else if (c.mesh.points.row(n).norm() > 11)
      c.mesh.groups[0].nodes.push_back(n);
  SurfaceMorphOptions options;
  for (auto* names : {&options.groups.held, &options.groups.rigid, &options.groups.sliding}) {
    *names = {"inside"};
    CHECK_THROWS_AS(SurfaceMorph(c.base, c.mesh, c.boundary, options), InvalidInputError);
    names->clear();
  }
  options.groups.following = {"inside"};
  options.groups.sliding = {"far"};
  const auto moved = SurfaceMorph(c.base, c.mesh, c.boundary, options)
                         .morph(*c.base, match_topology(*c.base, *c.base));
  CHECK(std::ranges::any_of(moved.warnings, [](const std::string& line) {
    return line.find("'far' is to slide, but nothing that lies on the CAD touches it") !=
           std::string::npos;
  }));
}

TEST_CASE("held nodes that the CAD leaves behind are told, those that it does not are not",
          "[surface]") {
  const auto box = [](double x, double z) {
    return to_model(BRepPrimAPI_MakeBox(x, 20., z).Solid());
  };
  Mesh mesh = hex_grid({4, 4, 4}, [](const Vector3d& s) -> Vector3d {
    return {20 * s.x(), 20 * s.y(), 10 * s.z()};
  });
  mesh.groups = {{"lid", "marker", {}}};
  for (Index n = 0; n < mesh.node_count(); ++n)
    if (mesh.points(n, 2) > 10 - 1e-9) mesh.groups[0].nodes.push_back(n);
  const MorphCase c = mesh_case(box(20, 10), mesh);
  SurfaceMorphOptions options;
  options.groups.held = {"lid"};
  const auto warned = [&](const CadModel& variant) {
    const auto moved = SurfaceMorph(c.base, c.mesh, c.boundary, options)
                           .morph(variant, match_topology(*c.base, variant));
    return std::ranges::find_if(moved.warnings, [](const std::string& line) {
             return line.find("9 held nodes lie off the variant's CAD, by up to 2.5 mm") !=
                    std::string::npos;
           }) != moved.warnings.end();
  };
  CHECK(warned(box(20, 12.5)));
  CHECK(!warned(box(22, 10)));
}
