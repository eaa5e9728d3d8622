#include <BRepPrimAPI_MakeBox.hxx>
#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>

#include "cad/topology_match.h"
#include "morph_case.h"
#include "surface/node_slide.h"
#include "surface_parts.h"
#include "triangulation.h"

using namespace cadmorph;
using namespace cadmorph::testing;
using Eigen::Vector3d;
using std::numbers::pi;

namespace {

/// A mesh around a cylinder of radius 5 between two symmetry planes, out to radius 30.
Mesh ring_around_cylinder() {
  return hex_grid(
      {8, 40, 6},
      [](const Vector3d& s) -> Vector3d {
        const double r = 5 + 25 * s.x() * s.x(), a = 2 * pi * s.y();
        return {r * std::cos(a), r * std::sin(a), 20 * s.z()};
      },
      true);
}

Mesh cells_from_axis_outwards(const Mesh& mesh) {
  std::vector<std::pair<double, Index>> order;
  for (Index c = 0; c < mesh.cell_count(); ++c) {
    double radius = 0;
    for (const Index node : mesh.cell(c)) radius += mesh.points.row(node).head<2>().norm();
    order.emplace_back(radius, c);
  }
  std::ranges::sort(order);
  Mesh result;
  result.points = mesh.points;
  result.offsets = {0};
  for (const auto& [radius, c] : order) {
    const auto nodes = mesh.cell(c);
    result.types.push_back(mesh.types[c]);
    result.connectivity.insert(result.connectivity.end(), nodes.begin(), nodes.end());
    result.offsets.push_back(static_cast<Index>(result.connectivity.size()));
  }
  return result;
}

}  // namespace

TEST_CASE("half a body in a flow is the body's", "[surface][far-field]") {
  // Around half of a cylinder, up to its ends and beyond, coarse: chords take from its area.
  const Mesh mesh = hex_grid({8, 6, 6}, [](const Vector3d& s) -> Vector3d {
    const double r = 5 + 45 * s.x() * s.x(), a = pi * s.y();
    return {r * std::cos(a), r * std::sin(a), 20 * s.z()};
  });
  const MorphCase c = mesh_case(to_model(cylinder(5, 20)), mesh);
  const SurfaceMorph surface(c.base, c.mesh, c.boundary);
  CHECK(surface.association().face_nodes + surface.association().edge_nodes == 7 * 7);
  const CadModel variant = to_model(cylinder(7, 20));
  const auto moved = surface.morph(variant, match_topology(*c.base, variant));
  const Points old = surface_points(c.boundary, mesh.points);
  // The rim, where the symmetry plane cuts the body, stays in the plane: it does not slide.
  const SlidingNodes sliding = slide_on_cad(variant, surface.association(), c.boundary, moved);
  Index in_plane = 0, on_rim = 0;
  for (Index n = 0; n < old.rows(); ++n) {
    const bool is_on_body = std::hypot(old(n, 0), old(n, 1)) < 5 + 1e-9;
    const bool is_in_plane = std::abs(old(n, 1)) < 1e-9;
    if (!is_in_plane) continue;
    ++in_plane;
    CHECK(std::abs(moved.positions(n, 1)) < 1e-9);
    if (is_on_body) {
      ++on_rim;
      CHECK_FALSE(std::ranges::binary_search(sliding.nodes, c.boundary.nodes[n]));
    }
  }
  CHECK(in_plane == 2 * 7 * 9);
  CHECK(on_rim == 2 * 7);
  CHECK(sliding.nodes.size() > 20);
}

TEST_CASE("a body that sinks through a symmetry plane stays cut by it", "[surface][far-field]") {
  const Mesh mesh = hex_grid({8, 6, 6}, [](const Vector3d& s) -> Vector3d {
    const double r = 5 + 45 * s.x() * s.x(), a = pi * s.y();
    return {r * std::cos(a), r * std::sin(a), 20 * s.z()};
  });
  const MorphCase c = mesh_case(to_model(cylinder(5, 20)), mesh);
  const Points old = surface_points(c.boundary, mesh.points);
  gp_Trsf down;
  down.SetTranslation(gp_Vec(0, -4.5, 0));
  const auto moved = morph_surface(c, to_model(transformed(cylinder(5, 20), down)));
  Index on_rim = 0;
  for (Index n = 0; n < old.rows(); ++n) {
    if (std::hypot(old(n, 0), old(n, 1)) > 5 + 1e-9 || std::abs(old(n, 1)) > 1e-9) continue;
    ++on_rim;
    CHECK(std::abs(moved.positions(n, 1)) < 1e-10);
    CHECK(moved.positions(n, 0) ==
          Approx(std::copysign(std::sqrt(25 - 4.5 * 4.5), old(n, 0))).margin(1e-9));
    CHECK(std::abs(moved.positions(n, 2) - old(n, 2)) < 1e-9);
  }
  CHECK(on_rim == 2 * 7);
}

TEST_CASE("half of a part is taken where its cut is expected", "[surface][far-field][errors]") {
  Mesh mesh = hex_grid({4, 4, 4}, [](const Vector3d& s) -> Vector3d {
    return {20 * s.x(), 20 * s.y(), 10 * s.z()};
  });
  mesh.groups = {{"cut", "marker", {}}};
  for (Index n = 0; n < mesh.node_count(); ++n)
    if (mesh.points(n, 0) > 20 - 1e-9) mesh.groups[0].nodes.push_back(n);
  const auto box = [](double width) {
    return to_model(BRepPrimAPI_MakeBox(40., width, 10.).Solid());
  };
  const MorphCase c = mesh_case(box(20), mesh);
  CHECK_THROWS_WITH(SurfaceMorph(c.base, c.mesh, c.boundary),
                    Catch::Contains("hardly larger") && Catch::Contains("If they are meant"));
  SurfaceMorphOptions by_policy, by_name;
  by_policy.unmatched = UnmatchedPolicy::Slide;
  by_name.groups.sliding = {"cut"};
  for (const auto& options : {by_policy, by_name}) {
    const CadModel variant = box(24);
    const auto moved = SurfaceMorph(c.base, c.mesh, c.boundary, options)
                           .morph(variant, match_topology(*c.base, variant));
    const Points expected = moved_by(c, [](const Vector3d& x) -> Vector3d {
      return {x.x(), 1.2 * x.y(), x.z()};
    });
    CHECK(largest_difference(moved.positions, expected) <= 1e-9);
  }
  // Others are not expected.
  CHECK_THROWS_WITH(
      SurfaceMorph(std::make_shared<const CadModel>(box(11)), c.mesh, c.boundary, by_name),
      Catch::Contains("hardly larger"));
}

TEST_CASE("symmetry planes slide with the body they touch", "[surface][far-field]") {
  const MorphCase c = mesh_case(to_model(cylinder(5, 20)), ring_around_cylinder());
  const Points old = surface_points(c.boundary, c.mesh.points);
  for (const auto policy : {UnmatchedPolicy::Auto, UnmatchedPolicy::Fix}) {
    const bool slides = policy == UnmatchedPolicy::Auto;
    SurfaceMorphOptions options;
    options.unmatched = policy;
    const auto result = morph_surface(c, to_model(cylinder(8, 20)), options);
    double off_plane = 0, off_body = 0, off_rest = 0, off_ray = 0, turned_back = 0;
    const auto raise = [](double& worst, double value) { worst = std::max(worst, value); };
    for (Index n = 0; n < old.rows(); ++n) {
      const Vector3d x = old.row(n), y = result.positions.row(n);
      const double r = std::hypot(x.x(), x.y()), moved = std::hypot(y.x(), y.y());
      raise(off_plane, std::abs(y.z() - x.z()));
      if (r < 5 + 1e-9) {
        raise(off_body, std::abs(moved - 8));
      } else if (r > 30 - 1e-9 || !slides) {
        raise(off_rest, (y - x).norm());
      } else {
        // Pushed outwards along its ray, and not through the outer boundary.
        raise(turned_back, std::max(r - moved, moved - 30));
        raise(off_ray, std::abs(x.x() * y.y() - x.y() * y.x()) / (r * moved));
      }
    }
    CAPTURE(slides);
    CHECK(off_plane < 1e-9);
    CHECK(off_body < 1e-9);
    CHECK(off_rest < 1e-9);
    CHECK(off_ray < 1e-3);
    CHECK(turned_back <= 0);
  }
}

TEST_CASE("thin layers whose wall is a little off the symmetry plane do not tilt it",
          "[surface][far-field]") {
  // A wall node 1e-7 off turns the facets of a layer of 1e-3 by 1e-4.
  constexpr double kOff = 1e-7;
  Mesh mesh = ring_around_cylinder();
  for (Index n = 0; n < mesh.node_count(); ++n) {
    const double r = mesh.points.row(n).head<2>().norm();
    mesh.points.row(n).head<2>() *= (5 + 25 * std::pow(std::max(r - 5, 0.0) / 25, 2.4)) / r;
    if (r < 5 + 1e-9) mesh.points(n, 2) += kOff;
  }
  mesh = cells_from_axis_outwards(mesh);  // the thin ones are met first
  const MorphCase c = mesh_case(to_model(cylinder(5, 20)), mesh);
  const Points old = surface_points(c.boundary, c.mesh.points);
  const auto result = morph_surface(c, to_model(cylinder(8, 20)));
  Index slid = 0;
  for (Index n = 0; n < old.rows(); ++n) {
    slid += (result.positions.row(n) - old.row(n)).head<2>().norm() > 0.1;
    CHECK(std::abs(result.positions(n, 2) - old(n, 2)) <= 2 * kOff);
  }
  CHECK(slid > 0);
}

TEST_CASE("oblique symmetry planes in single precision slide", "[surface][far-field]") {
  // Rounding by up to 2e-6 turns the facets of a layer of 1e-3 by 1e-3.
  const gp_Trsf map = similarity(0.4, 1, gp_Vec(3, 4, 5));
  Mesh mesh = ring_around_cylinder();
  for (Index n = 0; n < mesh.node_count(); ++n) {
    const double r = mesh.points.row(n).head<2>().norm();
    mesh.points.row(n).head<2>() *= (5 + 25 * std::pow(std::max(r - 5, 0.0) / 25, 2.4)) / r;
    mesh.points.row(n) = apply(map, mesh.points.row(n)).cast<float>().cast<double>();
  }
  const MorphCase c = mesh_case(to_model(transformed(cylinder(5, 20), map)), mesh);
  const Points old = surface_points(c.boundary, c.mesh.points);
  const auto result = morph_surface(c, to_model(transformed(cylinder(8, 20), map)));
  const gp_Trsf back = map.Inverted();
  Index slid = 0;
  for (Index n = 0; n < old.rows(); ++n) {
    const Vector3d x = apply(back, old.row(n)), y = apply(back, result.positions.row(n));
    CHECK(std::abs(y.z() - x.z()) <= 1e-5);
    const double r = x.head<2>().norm();
    if (r > 15) continue;
    ++slid;
    CHECK(y.head<2>().norm() - r > 1);
  }
  CHECK(slid > 0);
}
