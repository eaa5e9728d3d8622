#include <BRepAlgoAPI_Cut.hxx>
#include <BRepBuilderAPI_MakeFace.hxx>
#include <BRepBuilderAPI_MakePolygon.hxx>
#include <BRepPrimAPI_MakeBox.hxx>
#include <BRepPrimAPI_MakeCylinder.hxx>
#include <BRepPrimAPI_MakePrism.hxx>
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <map>
#include <numbers>

#include "cad/topology_match.h"
#include "core/errors.h"
#include "morph_case.h"
#include "triangulation.h"

using namespace cadmorph;
using namespace cadmorph::testing;
using Eigen::Vector3d;
using std::numbers::pi;

namespace {

constexpr double kKnown = 1e-8;

TopoDS_Shape tube() {
  return BRepAlgoAPI_Cut(BRepPrimAPI_MakeCylinder(15, 12).Solid(),
                         BRepPrimAPI_MakeCylinder(6, 12).Solid())
      .Shape();
}

/// Hexahedra of the tube, six a turn: their edges cut off 2 mm of the outer circle.
Mesh coarse_tube() {
  return hex_grid(
      {2, 6, 3},
      [](const Vector3d& s) -> Vector3d {
        const double r = 6 + 9 * s.x(), a = 2 * pi * s.y();
        return {r * std::cos(a), r * std::sin(a), 12 * s.z()};
      },
      true);
}

using Corners = std::vector<std::vector<int>>;
const Corners kHexEdges = {{0, 1}, {1, 2}, {2, 3}, {3, 0}, {4, 5}, {5, 6},
                           {6, 7}, {7, 4}, {0, 4}, {1, 5}, {2, 6}, {3, 7}};
const Corners kHexMiddles = {{0, 3, 4, 7},
                             {1, 2, 5, 6},
                             {0, 1, 4, 5},
                             {2, 3, 6, 7},
                             {0, 1, 2, 3},
                             {4, 5, 6, 7},
                             {0, 1, 2, 3, 4, 5, 6, 7}};

/// The hexahedra with nodes in the middles of their corners, as straight-sided meshers add them.
Mesh with_middles(const Mesh& hexes, bool has_face_nodes) {
  Corners added = kHexEdges;
  if (has_face_nodes) added.insert(added.end(), kHexMiddles.begin(), kHexMiddles.end());
  std::vector<Vector3d> points;
  for (Index n = 0; n < hexes.node_count(); ++n) points.emplace_back(hexes.points.row(n));
  std::map<std::vector<Index>, Index> middles;
  Mesh mesh;
  mesh.offsets = {0};
  for (Index c = 0; c < hexes.cell_count(); ++c) {
    const auto corners = hexes.cell(c);
    mesh.connectivity.insert(mesh.connectivity.end(), corners.begin(), corners.end());
    for (const auto& local : added) {
      std::vector<Index> nodes;
      Vector3d sum = Vector3d::Zero();
      for (const int i : local) {
        nodes.push_back(corners[static_cast<std::size_t>(i)]);
        sum += hexes.points.row(nodes.back()).transpose();
      }
      std::sort(nodes.begin(), nodes.end());
      const auto [at, is_new] = middles.emplace(nodes, std::ssize(points));
      if (is_new) points.push_back(sum / static_cast<double>(nodes.size()));
      mesh.connectivity.push_back(at->second);
    }
    mesh.types.push_back(has_face_nodes ? CellType::TriquadraticHexahedron
                                        : CellType::QuadraticHexahedron);
    mesh.offsets.push_back(std::ssize(mesh.connectivity));
  }
  mesh.points.resize(std::ssize(points), 3);
  for (Index n = 0; n < mesh.node_count(); ++n) mesh.points.row(n) = points[n];
  return mesh;
}

}  // namespace

TEST_CASE("straight-sided quadratic cells stay straight however coarse they are",
          "[surface][quadratic]") {
  const TopoDS_Shape base = to_nurbs(tube());
  const gp_GTrsf map = general_affine();
  const CadModel variant = to_model(transformed(base, map));
  for (const bool has_face_nodes : {false, true})
    for (const bool is_single : {false, true}) {
      DYNAMIC_SECTION((has_face_nodes ? "with" : "without")
                      << " nodes on faces, in " << (is_single ? "single" : "double")
                      << " precision") {
        Mesh mesh = with_middles(coarse_tube(), has_face_nodes);
        if (is_single) mesh.points = mesh.points.cast<float>().cast<double>().eval();
        const MorphCase c = mesh_case(to_model(base), mesh);
        const SurfaceMorph surface(c.base, c.mesh, c.boundary);
        CHECK(surface.association().unmatched_nodes == 0);
        CHECK(surface.association().amid_nodes >= 2 * 6 * 4);
        const auto result = surface.morph(variant, match_topology(*c.base, variant));
        const Points expected = images(surface_points(c.boundary, c.mesh.points),
                                       [&](const Vector3d& x) { return apply(map, x); });
        CHECK(largest_difference(result.positions, expected) <=
              (is_single ? 1e-6 : kKnown) * c.diagonal);
      }
    }
}

TEST_CASE("straight edges of quadratic cells within plane faces stay straight",
          "[surface][quadratic]") {
  // A block of 10 x 10 x 4 whose side at x = 10 becomes 4 wide: no affine map of its top.
  const auto block = [](double width) {
    BRepBuilderAPI_MakePolygon polygon;
    polygon.Add(gp_Pnt(0, -5, 0));
    polygon.Add(gp_Pnt(10, -width / 2, 0));
    polygon.Add(gp_Pnt(10, width / 2, 0));
    polygon.Add(gp_Pnt(0, 5, 0));
    polygon.Close();
    return to_model(
        BRepPrimAPI_MakePrism(BRepBuilderAPI_MakeFace(polygon.Wire()).Face(), gp_Vec(0, 0, 4))
            .Shape());
  };
  const Mesh mesh = with_middles(hex_grid({5, 5, 2},
                                          [](const Vector3d& s) -> Vector3d {
                                            return {10 * s.x(), 10 * s.y() - 5, 4 * s.z()};
                                          }),
                                 true);
  const MorphCase c = mesh_case(block(10), mesh);
  const auto result = morph_surface(c, block(4));
  const Boundary& boundary = c.boundary;
  Points points = mesh.points;
  for (Index i = 0; i < std::ssize(boundary.nodes); ++i)
    points.row(boundary.nodes[i]) = result.positions.row(i);
  Index count = 0;
  for (Index cell = 0; cell < mesh.cell_count(); ++cell)
    for (std::size_t edge = 0; edge < kHexEdges.size(); ++edge) {
      const auto nodes = mesh.cell(cell);
      const Index a = nodes[kHexEdges[edge][0]], b = nodes[kHexEdges[edge][1]],
                  middle = nodes[8 + edge];
      if (!std::ranges::binary_search(boundary.nodes, middle)) continue;
      ++count;
      CHECK((points.row(middle) - (points.row(a) + points.row(b)) / 2).norm() <=
            1e-12 * c.diagonal);
    }
  CHECK(count > 300);
}

TEST_CASE("middles of straight edges that digits left off stay where nothing changes",
          "[surface][quadratic]") {
  Mesh mesh = with_middles(hex_grid({5, 5, 2},
                                    [](const Vector3d& s) -> Vector3d {
                                      return {10 * s.x(), 10 * s.y(), 4 * s.z()};
                                    }),
                           true);
  // As a deck of few digits has them.
  mesh.points = ((mesh.points / 3 * 1e4).array().round() * 3e-4).matrix().eval();
  const TopoDS_Shape block = BRepPrimAPI_MakeBox(10, 10, 4).Shape();
  const MorphCase c = mesh_case(to_model(block), mesh);
  CHECK(largest_difference(morph_surface(c, to_model(block)).positions,
                           surface_points(c.boundary, mesh.points)) < 1e-12 * c.diagonal);
}

TEST_CASE("long curved edges of slender facets may lie off the CAD by a part of their own length",
          "[surface][quadratic]") {
  // Facets of 15 mm round the tube and 0.3 mm along it; middles bent out, but not all the way.
  Mesh slender = with_middles(hex_grid(
                                  {2, 6, 40},
                                  [](const Vector3d& s) -> Vector3d {
                                    const double r = 6 + 9 * s.x(), a = 2 * pi * s.y();
                                    return {r * std::cos(a), r * std::sin(a), 12 * s.z()};
                                  },
                                  true),
                              false);
  for (Index n = 0; n < slender.node_count(); ++n) {
    const double r = slender.points.row(n).head<2>().norm();
    for (const double wall : {6.0, 15.0})
      if (std::abs(r - wall * std::cos(pi / 6)) < 1e-6)
        slender.points.row(n).head<2>() *= 0.98 * wall / r;
  }
  const MorphCase c = mesh_case(to_model(tube()), slender);
  const gp_Trsf map = similarity(0.3, 1.4, gp_Vec(1, 2, 3));
  const auto result = morph_surface(c, to_model(transformed(tube(), map)));
  const Points expected = images(surface_points(c.boundary, c.mesh.points),
                                 [&](const Vector3d& x) { return apply(map, x); });
  CHECK(largest_difference(result.positions, expected) <= kKnown * c.diagonal);
}

TEST_CASE("nodes off the body go with it or are refused, not left behind with the far field",
          "[surface][far-field][errors]") {
  MorphCase c = shape_case("sphere_far_field");
  Index moved = 0;
  for (Index n = 0; n < c.mesh.node_count() && moved < 3; ++n) {
    if (std::abs(c.mesh.points.row(n).norm() - 10) > 1e-6) continue;
    c.mesh.points.row(n) *= 1.04;
    ++moved;
  }
  REQUIRE(moved == 3);
  const SurfaceMorph surface(c.base, c.mesh, c.boundary);
  CHECK(surface.association().stray_nodes == 3);
  SurfaceMorphOptions strict;
  strict.unmatched = UnmatchedPolicy::Error;
  CHECK_THROWS_WITH(SurfaceMorph(c.base, c.mesh, c.boundary, strict),
                    Catch::Matchers::Contains("amid nodes that are on it"));
}
