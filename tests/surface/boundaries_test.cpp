#include <BRepAlgoAPI_Common.hxx>
#include <BRepAlgoAPI_Cut.hxx>
#include <BRepAlgoAPI_Fuse.hxx>
#include <BRepPrimAPI_MakeBox.hxx>
#include <BRepPrimAPI_MakeCylinder.hxx>
#include <BRepPrimAPI_MakeSphere.hxx>
#include <BRep_Builder.hxx>
#include <Eigen/Geometry>
#include <TopoDS_Compound.hxx>
#include <catch2/catch.hpp>
#include <cmath>
#include <gp_Ax2.hxx>
#include <numbers>

#include "cad/step_reader.h"
#include "cad/topology_match.h"
#include "core/errors.h"
#include "morph_case.h"
#include "surface/node_slide.h"
#include "triangulation.h"

using namespace cadmorph;
using namespace cadmorph::testing;
using Eigen::Vector2d;
using Eigen::Vector3d;
using std::numbers::pi;

namespace {

constexpr double kKnown = 1e-8;

Points moved_by(const MorphCase& c, const std::function<Vector3d(const Vector3d&)>& map) {
  return images(surface_points(c.boundary, c.mesh.points), map);
}

TopoDS_Shape cylinder(double radius, double height) {
  return BRepPrimAPI_MakeCylinder(radius, height).Solid();
}

gp_Trsf turn_about_z(double angle) {
  gp_Trsf turn;
  turn.SetRotation(gp_Ax1(gp_Pnt(0, 0, 0), gp_Dir(0, 0, 1)), angle);
  return turn;
}

TopoDS_Shape sphere_at(const Vector3d& centre, double radius) {
  return BRepPrimAPI_MakeSphere(gp_Pnt(centre.x(), centre.y(), centre.z()), radius).Solid();
}

/// Two blocks of one width side by side, each with its own copy of the face between them.
TopoDS_Shape two_blocks(double first, double second) {
  TopoDS_Compound blocks;
  BRep_Builder builder;
  builder.MakeCompound(blocks);
  builder.Add(blocks, BRepPrimAPI_MakeBox(gp_Pnt(0, 0, 0), gp_Pnt(first, 20, 20)).Solid());
  builder.Add(blocks,
              BRepPrimAPI_MakeBox(gp_Pnt(first, 0, 0), gp_Pnt(first + second, 20, 20)).Solid());
  return blocks;
}

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

/// A cylinder's mesh of triangles with `n` segments a turn: mantle in bands, ends as fans with a
/// ring between centre and rim.
Mesh prism(int n, double radius, double height) {
  constexpr int kBands = 10;
  Mesh mesh;
  std::vector<Vector3d> points;
  const auto ring = [&](double r, double z) {
    for (int i = 0; i < n; ++i)
      points.emplace_back(r * std::cos(2 * pi * i / n), r * std::sin(2 * pi * i / n), z);
  };
  ring(radius / 2, 0);
  for (int j = 0; j <= kBands; ++j) ring(radius, height * j / kBands);
  ring(radius / 2, height);
  points.emplace_back(0, 0, 0);
  points.emplace_back(0, 0, height);
  mesh.points.resize(std::ssize(points), 3);
  for (Index p = 0; p < std::ssize(points); ++p) mesh.points.row(p) = points[p];
  mesh.offsets = {0};
  const auto add = [&](Index p, Index q, Index r) {
    mesh.types.push_back(CellType::Triangle);
    mesh.connectivity.insert(mesh.connectivity.end(), {p, q, r});
    mesh.offsets.push_back(std::ssize(mesh.connectivity));
  };
  const Index rings = kBands + 3, bottom = rings * n, top = bottom + 1;
  for (Index i = 0; i < n; ++i) {
    const Index j = (i + 1) % n;
    for (Index k = 0; k + 1 < rings; ++k) {
      add(k * n + i, k * n + j, (k + 1) * n + j);
      add(k * n + i, (k + 1) * n + j, (k + 1) * n + i);
    }
    add(bottom, j, i);
    add(top, (rings - 1) * n + i, (rings - 1) * n + j);
  }
  return mesh;
}

}  // namespace

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

TEST_CASE("the mesh of another part is refused", "[surface][errors]") {
  for (const auto& [cad, mesh] : std::vector<std::pair<std::string, std::string>>{
           {"box", "torus"}, {"bracket", "plate_4_holes"}, {"sphere", "cylinder"}}) {
    DYNAMIC_SECTION("mesh of " << mesh << " on " << cad) {
      const MorphCase c = file_case("shapes/" + cad + ".step", "shapes/" + mesh + ".vtu");
      CHECK_THROWS_AS(SurfaceMorph(c.base, c.mesh, c.boundary), AssociationError);
    }
  }
}

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
  Index on_rim = 0;
  for (Index n = 0; n < old.rows(); ++n) {
    const bool is_on_body = std::hypot(old(n, 0), old(n, 1)) < 5 + 1e-9;
    const bool is_in_plane = std::abs(old(n, 1)) < 1e-9;
    if (is_in_plane) CHECK(std::abs(moved.positions(n, 1)) < 1e-9);
    if (is_in_plane && is_on_body) {
      ++on_rim;
      CHECK_FALSE(std::ranges::binary_search(sliding.nodes, c.boundary.nodes[n]));
    }
  }
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

namespace {

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

TEST_CASE("a flow in a plane, one cell thick, stays extruded", "[surface][far-field]") {
  // Cells grow from the cylinder out to 30 of its radii.
  const Mesh mesh = hex_grid(
      {30, 36, 1},
      [](const Vector3d& s) -> Vector3d {
        const double r = std::pow(30, s.x()), a = 2 * pi * s.y();
        return {r * std::cos(a), r * std::sin(a), s.z() - 0.5};
      },
      true);
  const auto body = [](double x, double y, double radius) {
    return to_model(
        BRepPrimAPI_MakeCylinder(gp_Ax2(gp_Pnt(x, y, -0.5), gp_Dir(0, 0, 1)), radius, 1).Solid());
  };
  const MorphCase c = mesh_case(body(0, 0, 1), mesh);
  const Morphed m = morph(c, body(0.1, -0.07, 1.2));
  double apart = 0, off_plane = 0, farthest = 0, off_body = 0;
  for (Index n = 0; n < mesh.node_count(); ++n) {
    const Vector3d x = mesh.points.row(n), y = m.points.row(n);
    farthest = std::max(farthest, (y - x).norm());
    off_plane = std::max(off_plane, std::abs(y.z() - x.z()));
    if (std::hypot(x.x(), x.y()) < 1 + 1e-9)
      off_body = std::max(off_body, std::abs(std::hypot(y.x() - 0.1, y.y() + 0.07) - 1.2));
    if (x.z() > 0) continue;
    for (Index k = 0; k < mesh.node_count(); ++k)
      if ((mesh.points.row(k).transpose() - x - Vector3d(0, 0, 1)).norm() < 1e-9)
        apart = std::max(apart, (m.points.row(k).transpose() - y - Vector3d(0, 0, 1)).norm());
  }
  CHECK(apart <= 1e-12 * 60);
  CHECK(off_plane <= 1e-12 * 60);
  CHECK(off_body <= 1e-9);
  CHECK(farthest <= 1.2 * (0.2 + std::hypot(0.1, 0.07)));
}

TEST_CASE("the sides of a sector move alike, turned", "[surface][far-field]") {
  const double angle = 200 * pi / 180;
  const std::array<int, 3> n{16, 30, 4};
  const Mesh mesh = hex_grid(n, [&](const Vector3d& s) -> Vector3d {
    const double r = 5 * std::pow(30, s.x()), a = angle * s.y();
    return {r * std::cos(a), r * std::sin(a), 20 * s.z()};
  });
  const MorphCase c = mesh_case(to_model(cylinder(5, 20)), mesh);
  const Morphed m = morph(c, to_model(cylinder(7, 20)));
  const Eigen::AngleAxisd turn(angle, Vector3d::UnitZ());
  double apart = 0, farthest = 0;
  Index pairs = 0;
  for (Index i = 0; i < mesh.node_count(); ++i) {
    const Vector3d x = mesh.points.row(i), y = m.points.row(i);
    farthest = std::max(farthest, (y - x).norm());
    if (std::abs(x.y()) > 1e-9 || x.x() < 0) continue;
    for (Index k = 0; k < mesh.node_count(); ++k)
      if ((mesh.points.row(k).transpose() - turn * x).norm() < 1e-9) {
        ++pairs;
        apart = std::max(apart, (m.points.row(k).transpose() - turn * y).norm());
      }
  }
  CHECK(pairs == 17 * 5);
  CHECK(apart <= 1e-12 * 300);
  CHECK(farthest <= 1.2 * 1.2 * 2);  // space follows the planes, these the body
}

TEST_CASE("a duct of the CAD with two like sides moves them alike", "[surface][far-field]") {
  // A square hole through a plate that is one cell thick: both sides of the plate are CAD faces.
  const auto plate = [](double x, double size) -> TopoDS_Shape {
    const TopoDS_Shape hole =
        BRepPrimAPI_MakeBox(gp_Pnt(x - size, -size, -1), gp_Pnt(x + size, size, 2)).Solid();
    return BRepAlgoAPI_Cut(BRepPrimAPI_MakeBox(gp_Pnt(-40, -40, 0), gp_Pnt(40, 40, 1)).Solid(),
                           hole)
        .Shape();
  };
  const Mesh mesh = hex_grid(
      {20, 40, 1},
      [](const Vector3d& s) -> Vector3d {
        const double side = 4 * s.y() - std::floor(4 * s.y()), r = std::pow(40, s.x());
        const Vector2d along(2 * side - 1, 1);
        const Vector2d at = r * (Eigen::Rotation2Dd(pi / 2 * std::floor(4 * s.y() + 1e-9)) * along);
        return {at.x(), at.y(), s.z()};
      },
      true);
  const MorphCase c = mesh_case(to_model(plate(0, 1)), mesh);
  const Morphed m = morph(c, to_model(plate(0.1, 1.2)));
  double apart = 0, farthest = 0;
  Index pairs = 0;
  for (Index i = 0; i < mesh.node_count(); ++i) {
    farthest = std::max(farthest, (m.points.row(i) - mesh.points.row(i)).norm());
    for (Index k = 0; k < mesh.node_count(); ++k)
      if ((mesh.points.row(k) - mesh.points.row(i) - Eigen::RowVector3d(0, 0, 1)).norm() < 1e-9) {
        ++pairs;
        apart = std::max(apart,
                         (m.points.row(k) - m.points.row(i) - Eigen::RowVector3d(0, 0, 1)).norm());
      }
  }
  CHECK(pairs == mesh.node_count() / 2);
  CHECK(apart <= 1e-12 * 100);
  CHECK(farthest <= 1.2 * std::hypot(0.3, 0.2));
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

TEST_CASE("nodes off the CAD keep their offset, and snapping removes it", "[surface][offset]") {
  for (const std::string name : {"cylinder", "sphere", "torus", "bracket", "blade"}) {
    DYNAMIC_SECTION(name) {
      MorphCase c = shape_case(name);
      const auto file = model_file("shapes/" + name + ".step");
      const FaceOracle oracle(read_shape(file));
      const Association clean = SurfaceMorph(c.base, c.mesh, c.boundary).association();
      double largest = 0;
      for (const RowId row : clean.dimension.ids()) {
        if (clean.dimension[row] != CadDimension::Face) continue;
        const Vector3d normal = c.base->normal(clean.face(row), clean.uv.row(row).transpose());
        const double offset = 0.02 * (row % 3 - 1.0) * 1.5;  // millimetres; h is 1.5 to 4.5
        c.mesh.points.row(c.boundary.nodes[row]) += offset * normal.transpose();
        largest = std::max(largest, std::abs(offset));
      }
      REQUIRE(largest > 0.02);
      const Points old = surface_points(c.boundary, c.mesh.points);

      const auto same = morph_surface(c, read_step(file));
      CHECK(largest_difference(same.positions, old) <= 1e-9 * c.diagonal);
      CHECK(std::abs(same.distance.maxCoeff() - largest) < 1e-6);

      const gp_Trsf map = similarity(0.5, 1.7, gp_Vec(30, -20, 11));
      const auto carried = morph_surface(c, to_model(transformed(read_shape(file), map)));
      const Points expected = images(old, [&](const Vector3d& x) { return apply(map, x); });
      CHECK(largest_difference(carried.positions, expected) <= kKnown * 1.7 * c.diagonal);

      SurfaceMorphOptions options;
      options.snap = true;
      const auto snapped = morph_surface(c, read_step(file), options);
      double worst = 0;
      for (Index n = 0; n < old.rows(); ++n)
        worst = std::max(worst, oracle.nearest(snapped.positions.row(n)).second);
      double tolerance = 1e-7;
      for (const auto& e : c.base->edges()) tolerance = std::max(tolerance, e.tolerance);
      CHECK(worst <= tolerance);
      CHECK(largest_difference(snapped.positions, old) <= 2 * largest);
    }
  }
}

TEST_CASE("chords that leave a curved edge still follow it", "[surface][offset]") {
  // 24 segments a turn, halved: the new rim nodes are off the circle by 0.065 of their mesh edge.
  const MorphCase c = mesh_case(to_model(cylinder(15, 40)), split_triangles(prism(24, 15, 40)));
  const SurfaceMorph surface(c.base, c.mesh, c.boundary);
  const Association& a = surface.association();
  Index on_rim = 0, on_edge = 0;
  for (const RowId i : a.dimension.ids()) {
    const Vector3d x = c.mesh.points.row(c.boundary.nodes[i]);
    const bool is_at_end = std::min(std::abs(x.z()), std::abs(x.z() - 40)) < 1e-9;
    if (!is_at_end || std::hypot(x.x(), x.y()) < 14) continue;
    ++on_rim;
    on_edge += a.dimension[i] == CadDimension::Edge;
  }
  CHECK(on_rim == 2 * 48);
  CHECK(on_edge == 2 * 48);
  CHECK(std::abs(a.max_distance - 15 * (1 - std::cos(pi / 24))) < 1e-9);

  const CadModel taller = to_model(cylinder(15, 60));
  const auto result = surface.morph(taller, match_topology(*c.base, taller));
  const Points expected = moved_by(c, [](const Vector3d& x) -> Vector3d {
    return {x.x(), x.y(), 1.5 * x.z()};
  });
  CHECK(largest_difference(result.positions, expected) <= kKnown * c.diagonal);
}

TEST_CASE("no node of a thin plate changes sides", "[surface][association]") {
  MorphCase c = mesh_case(to_model(BRepPrimAPI_MakeBox(40, 30, 0.2).Solid()),
                          hex_grid({20, 15, 1}, [](const Vector3d& s) -> Vector3d {
                            return {40 * s.x(), 30 * s.y(), 0.2 * s.z()};
                          }));
  for (Index n = 0; n < c.mesh.node_count(); ++n)  // a tenth of the tolerance, up and down
    c.mesh.points(n, 2) += 0.002 * (n % 3 - 1.0);
  const auto result = morph_surface(c, to_model(BRepPrimAPI_MakeBox(40, 30, 0.6).Solid()));
  const Points old = surface_points(c.boundary, c.mesh.points);
  for (Index n = 0; n < old.rows(); ++n) CHECK((result.positions(n, 2) > 0.3) == (old(n, 2) > 0.1));
}

TEST_CASE("mid-side nodes of quadratic cells are carried by their own parameters",
          "[surface][quadratic]") {
  const MorphCase c = shape_case("cylinder_quadratic");
  const auto result = morph_surface(c, to_model(cylinder(22, 30)));
  const Points expected = moved_by(c, [](const Vector3d& x) -> Vector3d {
    return {x.x() * 22 / 15, x.y() * 22 / 15, x.z() * 30 / 40};
  });
  CHECK(largest_difference(result.positions, expected) <= kKnown * c.diagonal);
}

TEST_CASE("both sides of an interface agree when either block changes", "[surface][solids]") {
  const MorphCase c = shape_case("two_blocks");
  const Morphed m = morph(c, to_model(two_blocks(36, 14)));
  const auto stretch = [](const Vector3d& x) -> Vector3d {
    return {x.x() <= 30 ? x.x() * 36 / 30 : 36 + (x.x() - 30) * 14 / 20, x.y(), x.z()};
  };
  CHECK(largest_difference(m.surface.positions, moved_by(c, stretch)) <= kKnown * c.diagonal);
  Index on_interface = 0;
  for (Index n = 0; n < c.mesh.node_count(); ++n)
    if (std::abs(c.mesh.points(n, 0) - 30) < 1e-9) {
      ++on_interface;
      CHECK(std::abs(m.points(n, 0) - 36) < kKnown * c.diagonal);
    }
  CHECK(on_interface > 20);
}

TEST_CASE("no node of a plate is drawn to the edges of blocks that stand on it",
          "[surface][association][solids]") {
  // Two fused blocks, their bottoms apart; nodes a third of a cell beyond edges of the one and of
  // both.
  const TopoDS_Shape left = BRepPrimAPI_MakeBox(gp_Pnt(0, 0, 0), gp_Pnt(4, 4, 3)).Solid();
  const TopoDS_Shape right = BRepPrimAPI_MakeBox(gp_Pnt(4, 0, 0), gp_Pnt(8, 4, 3)).Solid();
  const double low = 4.44 - 15 * 1.28, high = 4.44 + 15 * 1.28;
  TopoDS_Compound parts;
  BRep_Builder builder;
  builder.MakeCompound(parts);
  builder.Add(parts, BRepAlgoAPI_Fuse(left, right).Shape());
  builder.Add(parts, BRepPrimAPI_MakeBox(gp_Pnt(low, low, -6), gp_Pnt(high, high, 0)).Solid());
  const MorphCase c = mesh_case(to_model(parts), hex_grid({30, 30, 4}, [&](const Vector3d& s) {
                                  return Vector3d(low + s.x() * (high - low),
                                                  low + s.y() * (high - low), 6 * s.z() - 6);
                                }));
  const SurfaceMorph surface(c.base, c.mesh, c.boundary);
  const Association& a = surface.association();
  CHECK(a.max_distance <= 1e-9 * c.diagonal);
  CHECK(a.unmatched_nodes == 0);
  for (const RowId i : a.dimension.ids()) {
    const Vector3d x = c.mesh.points.row(c.boundary.nodes[i]);
    const bool is_inside = std::min({x.x() - low, x.y() - low, high - x.x(), high - x.y()}) > 1;
    if (x.z() > -1e-9 && is_inside) CHECK(a.dimension[i] == CadDimension::Face);
  }
}

TEST_CASE("touching blocks with meshes of their own part where they touch",
          "[surface][association][solids]") {
  // Each face between them has a coincident copy, as have its edges and corners.
  const auto first = [](const Vector3d& s) -> Vector3d {
    return {30 * s.x(), 20 * s.y(), 20 * s.z()};
  };
  const auto second = [](const Vector3d& s) -> Vector3d {
    return {30 + 20 * s.x(), 20 * s.y(), 20 * s.z()};
  };
  Mesh mesh = hex_grid({5, 4, 4}, first);
  const Mesh other = hex_grid({4, 4, 4}, second);
  const Index nodes = mesh.node_count(), cells = mesh.cell_count();
  mesh.points.conservativeResize(nodes + other.node_count(), 3);
  mesh.points.bottomRows(other.node_count()) = other.points;
  for (const Index n : other.connectivity) mesh.connectivity.push_back(nodes + n);
  for (Index c = 0; c < other.cell_count(); ++c) {
    mesh.types.push_back(other.types[c]);
    mesh.offsets.push_back(mesh.offsets.back() + 8);
  }
  mesh.regions.assign(static_cast<std::size_t>(mesh.cell_count()), 0);
  for (Index c = cells; c < mesh.cell_count(); ++c) mesh.regions[c] = 1;
  for (const bool has_regions : {true, false}) {
    if (!has_regions) mesh.regions.clear();
    const MorphCase c = mesh_case(to_model(two_blocks(30, 20)), mesh);
    const SurfaceMorph surface(c.base, c.mesh, c.boundary);
    // The blocks part by 7 mm, the second grows across.
    TopoDS_Compound apart;
    BRep_Builder().MakeCompound(apart);
    BRep_Builder().Add(apart, BRepPrimAPI_MakeBox(gp_Pnt(0, 0, 0), gp_Pnt(30, 20, 20)).Solid());
    BRep_Builder().Add(apart, BRepPrimAPI_MakeBox(gp_Pnt(37, 0, 0), gp_Pnt(57, 26, 20)).Solid());
    const CadModel variant = to_model(apart);
    const auto result = surface.morph(variant, match_topology(*c.base, variant));
    double worst = 0;
    for (std::size_t i = 0; i < c.boundary.nodes.size(); ++i) {
      const Index n = c.boundary.nodes[i];
      Vector3d expected = mesh.points.row(n);
      if (n >= nodes) expected += Vector3d(7, 0.3 * expected.y(), 0);
      worst = std::max(worst, (result.positions.row(i).transpose() - expected).norm());
    }
    INFO("regions " << has_regions);
    CHECK(worst < kKnown * c.diagonal);
  }
}

TEST_CASE("an interface that is not in the CAD follows the volume", "[surface][solids]") {
  Mesh mesh = hex_grid({8, 6, 4}, [](const Vector3d& s) -> Vector3d {
    return {40 * s.x(), 30 * s.y(), 20 * s.z()};
  });
  for (Index cell = 0; cell < mesh.cell_count(); ++cell)
    mesh.regions[cell] = mesh.points(mesh.cell(cell)[0], 0) < 19 ? 1 : 2;
  const MorphCase c = mesh_case(read_step(model_file("shapes/box.step")), mesh);
  const SurfaceMorph surface(c.base, c.mesh, c.boundary);
  Index free = 0;
  for (const RowId i : surface.association().is_free.ids()) {
    const Vector3d x = c.mesh.points.row(c.boundary.nodes[i]);
    const bool is_inside =
        x.x() > 1 && x.x() < 39 && x.y() > 1 && x.y() < 29 && x.z() > 1 && x.z() < 19;
    free += is_inside;
    CHECK(static_cast<bool>(surface.association().is_free[i]) == is_inside);
  }
  CHECK(free == 5 * 3);
  const Morphed m = morph(c, to_model(BRepPrimAPI_MakeBox(50, 24, 20).Solid()));
  const Points expected = images(c.mesh.points, [](const Vector3d& x) -> Vector3d {
    return {1.25 * x.x(), 0.8 * x.y(), x.z()};
  });
  CHECK(largest_difference(m.points, expected) <= kKnown * c.diagonal);
}

TEST_CASE("a crack inside of the mesh closes on itself: its two sides move as one",
          "[surface][crack]") {
  const double height = GENERATE(10.0, 2.5);  // the latter beside nodes on the CAD
  Mesh mesh = hex_grid({8, 6, 8}, [](const Vector3d& s) -> Vector3d {
    return {40 * s.x(), 30 * s.y(), 20 * s.z()};
  });
  // A second node at the place of one inside, for the cells on one side of it.
  Index there = -1;
  for (Index n = 0; n < mesh.node_count(); ++n)
    if (Vector3d(mesh.points.row(n)).isApprox(Vector3d(20, 15, height))) there = n;
  REQUIRE(there >= 0);
  const Index twin = mesh.node_count();
  mesh.points.conservativeResize(twin + 1, 3);
  mesh.points.row(twin) = mesh.points.row(there);
  for (Index cell = 0; cell < mesh.cell_count(); ++cell) {
    Eigen::RowVector3d middle = Eigen::RowVector3d::Zero();
    for (const Index n : mesh.cell(cell)) middle += mesh.points.row(n) / 8;
    const bool is_beyond = middle.x() > 20 || middle.z() > height;
    for (Index i = mesh.offsets[cell]; is_beyond && i < mesh.offsets[cell + 1]; ++i)
      if (mesh.connectivity[i] == there) mesh.connectivity[i] = twin;
  }
  const MorphCase c = mesh_case(read_step(model_file("shapes/box.step")), mesh);
  const Morphed m = morph(c, to_model(BRepPrimAPI_MakeBox(50, 24, 20).Solid()));
  const Points expected = images(c.mesh.points, [](const Vector3d& x) -> Vector3d {
    return {1.25 * x.x(), 0.8 * x.y(), x.z()};
  });
  CHECK(largest_difference(m.points, expected) <= kKnown * c.diagonal);
  CHECK(m.points.row(there) == m.points.row(twin));
  REQUIRE(m.surface.warnings.size() == 1);
  // Those two alone, not the nodes round them, where the sides meet.
  CHECK_THAT(m.surface.warnings[0],
             Catch::Contains("crack inside: 8 facets") &&
                 Catch::EndsWith(": " + std::to_string(there) + ", " + std::to_string(twin)));
}

TEST_CASE("a hole inside of the mesh is named as that", "[surface][crack][errors]") {
  Mesh whole = hex_grid({8, 6, 4}, [](const Vector3d& s) -> Vector3d {
    return {40 * s.x(), 30 * s.y(), 20 * s.z()};
  });
  Mesh mesh;
  mesh.points = whole.points;
  mesh.offsets = {0};
  for (Index cell = 0; cell < whole.cell_count(); ++cell) {
    Vector3d middle = Vector3d::Zero();
    for (const Index n : whole.cell(cell)) middle += whole.points.row(n).transpose() / 8;
    if ((middle - Vector3d(20, 15, 10)).norm() > 6) {
      add_cell(mesh, CellType::Hexahedron, whole.cell(cell));
      mesh.regions.push_back(0);
    }
  }
  REQUIRE(whole.cell_count() - mesh.cell_count() == 8);
  const CadModel base = read_step(model_file("shapes/box.step"));
  const Boundary boundary = extract_boundary(mesh);
  CHECK_THROWS_WITH(SurfaceMorph(std::make_shared<CadModel>(base), mesh, boundary),
                    Catch::Contains("hole inside"));
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
  for (Index n = 0; n < old.rows(); ++n)
    if (old.row(n).norm() > 15)
      CHECK((result.positions.row(n) - old.row(n)).norm() <= 1e-12 * c.diagonal);
    else
      CHECK((Vector3d(result.positions.row(n)) - apply(turn, old.row(n))).norm() <=
            kKnown * c.diagonal);
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

TEST_CASE("a ball with a hole that turns about its axis turns with the hole", "[surface][seam]") {
  const TopoDS_Shape ball =
      BRepAlgoAPI_Cut(
          sphere_at({0, 0, 0}, 30),
          BRepPrimAPI_MakeCylinder(gp_Ax2(gp_Pnt(12, 0, -40), gp_Dir(0, 0, 1)), 5, 80).Solid())
          .Shape();
  const gp_Trsf turn = turn_about_z(0.35);
  const MorphCase c = mesh_case(to_model(ball), triangulate(ball, 0.2));
  const auto result = morph_surface(c, to_model(transformed(ball, turn)));
  const Points old = surface_points(c.boundary, c.mesh.points);
  for (Index n = 0; n < old.rows(); ++n)
    CHECK((Vector3d(result.positions.row(n)) - apply(turn, old.row(n))).norm() <=
          1e-6 * c.diagonal);
}

TEST_CASE("a shell mesh of a part is morphed by its surface alone", "[surface][shell]") {
  const TopoDS_Shape part = read_shape(model_file("shapes/bracket.step"));
  const MorphCase c = mesh_case(to_model(part), triangulate(part, 0.2));
  const gp_Trsf map = similarity(0.5, 1.7, gp_Vec(30, -20, 11));
  const Morphed m = morph(c, to_model(transformed(part, map)));
  const Points expected = images(c.mesh.points, [&](const Vector3d& x) { return apply(map, x); });
  CHECK(largest_difference(m.points, expected) <= kKnown * 1.7 * c.diagonal);
}

TEST_CASE("holes that move carry their own walls", "[surface][match]") {
  const std::vector<Vector2d> old_centres{{15, 15}, {15, 45}, {45, 15}, {45, 45}};
  const std::vector<Vector2d> new_centres{{16, 17}, {13, 44}, {46, 14}, {44, 47}};
  const TopoDS_Shape base = drilled_plate(60, 60, 10, 8, old_centres);
  const MorphCase c = mesh_case(to_model(base), triangulate(base, 0.2));
  const CadModel variant = to_model(drilled_plate(
      60, 60, 10, 7, {new_centres[2], new_centres[0], new_centres[3], new_centres[1]}));
  const auto result = morph_surface(c, variant);
  Index on_walls = 0;
  for (std::size_t i = 0; i < c.boundary.nodes.size(); ++i) {
    const Vector3d x = c.mesh.points.row(c.boundary.nodes[i]);
    for (int h = 0; h < 4; ++h) {
      const Vector2d from = x.head<2>() - old_centres[h];
      if (std::abs(from.norm() - 8) > 1e-6) continue;
      ++on_walls;
      const Vector2d at = new_centres[h] + from * 7 / 8;
      const Vector3d expected(at.x(), at.y(), x.z());
      CHECK((result.positions.row(static_cast<Index>(i)).transpose() - expected).norm() <=
            kKnown * c.diagonal);
    }
  }
  CHECK(on_walls > 100);
}

TEST_CASE("the seam of a shaft with an off-centre bore turns alone", "[surface][seam]") {
  // The bore fixes the part's position; the seam of the shaft's mantle moves by 70 degrees.
  const auto shaft = [](double radius, double height, double seam) -> TopoDS_Shape {
    const gp_Ax2 axes(gp_Pnt(0, 0, 0), gp_Dir(0, 0, 1), gp_Dir(std::cos(seam), std::sin(seam), 0));
    const gp_Ax2 bore(gp_Pnt(radius / 2, 0, -1), gp_Dir(0, 0, 1));
    return BRepAlgoAPI_Cut(BRepPrimAPI_MakeCylinder(axes, radius, height).Solid(),
                           BRepPrimAPI_MakeCylinder(bore, radius / 5, height + 2).Solid())
        .Shape();
  };
  const TopoDS_Shape base = shaft(20, 30, 0);
  const MorphCase c = mesh_case(to_model(base), triangulate(base, 0.1));
  for (const double seam : {0.0, 70.0, 180.0, -45.0}) {
    DYNAMIC_SECTION("seam at " << seam) {
      // Larger and taller too: an affine map that keeps the angles.
      const auto result = morph_surface(c, to_model(shaft(24, 45, seam * pi / 180)));
      const Points expected = moved_by(c, [](const Vector3d& x) -> Vector3d {
        return {1.2 * x.x(), 1.2 * x.y(), 1.5 * x.z()};
      });
      // The phase of a circle whose seam moved is found by least motion, not by parameters.
      CHECK(largest_difference(result.positions, expected) <= 1e-3 * c.diagonal);
    }
  }
}

TEST_CASE("every node is associated with an entity that it lies on", "[surface][association]") {
  for (const auto& name : all_shapes()) {
    DYNAMIC_SECTION(name) {
      const MorphCase c = shape_case(name);
      const FaceOracle oracle(read_shape(model_file("shapes/" + name + ".step")));
      const SurfaceMorph surface(c.base, c.mesh, c.boundary);
      const Association& a = surface.association();
      double tolerance = 1e-6 * c.diagonal;
      for (const auto& e : c.base->edges()) tolerance = std::max(tolerance, e.tolerance);
      for (const RowId i : a.dimension.ids()) {
        const Vector3d x = c.mesh.points.row(c.boundary.nodes[i]);
        if (a.dimension[i] == CadDimension::Face) CHECK(oracle.is_near(a.entity[i], x, tolerance));
        if (a.dimension[i] == CadDimension::Vertex)
          CHECK((c.base->vertices()[a.vertex(i)].point - x).norm() <= tolerance);
        if (a.dimension[i] == CadDimension::Edge)
          CHECK((c.base->evaluate_edge(a.edge(i), a.t(i)).point - x).norm() <= tolerance);
        CHECK(a.dimension[i] != CadDimension::None);
      }
      for (const FacetId f : a.facet_face.ids()) {
        CHECK(a.facet_face[f] >= 0);
        for (const Index n : c.boundary.facet(f))
          CHECK(oracle.is_near(a.facet_face[f], c.mesh.points.row(n), tolerance));
      }
      CHECK(a.vertex_nodes + a.edge_nodes + a.face_nodes == std::ssize(c.boundary.nodes));
      CHECK(a.max_distance <= tolerance);
    }
  }
}
