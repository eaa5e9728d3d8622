#include <BRepAlgoAPI_Cut.hxx>
#include <BRepPrimAPI_MakeCylinder.hxx>
#include <BRepPrimAPI_MakeSphere.hxx>
#include <Eigen/Geometry>
#include <catch2/catch.hpp>
#include <cmath>
#include <gp_Ax1.hxx>
#include <gp_Ax2.hxx>
#include <limits>
#include <numbers>

#include "core/errors.h"
#include "morph_case.h"
#include "surface/own_surface.h"
#include "triangulation.h"

using namespace cadmorph;
using namespace cadmorph::testing;
using Eigen::Matrix3d;
using Eigen::Vector3d;
using std::numbers::pi;

namespace {

/// A surface about the z axis, its radius at z.
struct Wall {
  std::string kind;  // of OwnSurface
  std::function<double(double)> radius;
};

Wall cylinder_wall(double r) {
  return {"cylinder", [r](double) { return r; }};
}
Wall cone_wall(double r) {
  return {"cone", [r](double z) { return r + 0.3 * z; }};
}
Wall sphere_wall(double r) {
  return {"sphere", [r](double z) { return std::sqrt(r * r - z * z); }};
}
Wall bulged_wall(double r) {
  return {"facets", [r](double z) { return r + 0.4 * std::cos(z); }};
}

double off_wall(const Wall& wall, const Vector3d& x) {
  return std::abs(x.head<2>().norm() - wall.radius(x.z()));
}

/// A pin along the x axis, turned about the z axis.
TopoDS_Shape pin(double turn, double radius = 1) {
  gp_Trsf about_z;
  about_z.SetRotation(gp_Ax1(gp_Pnt(0, 0, 0), gp_Dir(0, 0, 1)), turn);
  return transformed(
      BRepPrimAPI_MakeCylinder(gp_Ax2(gp_Pnt(4.2, 0, 0), gp_Dir(1, 0, 0)), radius, 6.5).Solid(),
      about_z);
}

/// The space round the pin from one wall to the other, out to a cylinder of radius 4; its hub,
/// casing and far side are groups.
Mesh space_around_pin(const Wall& hub, const Wall& casing, int n = 8) {
  Mesh mesh = hex_grid(
      {n, 3 * n, n},
      [&](const Vector3d& s) -> Vector3d {
        const double d = 1 + 3 * s.x() * s.x(), a = 2 * pi * s.y();
        const double y = d * std::cos(a), z = d * std::sin(a);
        const double r = (1 - s.z()) * hub.radius(z) + s.z() * casing.radius(z);
        return {std::sqrt(r * r - y * y), y, z};
      },
      true);
  mesh.groups = {{"hub", "marker", {}}, {"casing", "marker", {}}, {"far", "marker", {}}};
  for (Index node = 0; node < mesh.node_count(); ++node) {
    const Vector3d x = mesh.points.row(node);
    if (off_wall(hub, x) < 1e-9) mesh.groups[0].nodes.push_back(node);
    if (off_wall(casing, x) < 1e-9) mesh.groups[1].nodes.push_back(node);
    if (std::abs(x.tail<2>().norm() - 4) < 1e-9) mesh.groups[2].nodes.push_back(node);
  }
  return mesh;
}

Vector3d turned(const Vector3d& x, double angle) {
  return Eigen::AngleAxisd(angle, Vector3d::UnitZ()) * x;
}

/// Quadrilaterals over (s, t) in the unit square, mapped.
SurfaceMesh patch(const std::function<Vector3d(double, double)>& at, int n = 12) {
  Mesh mesh;
  mesh.points.resize((n + 1) * (n + 1), 3);
  mesh.offsets = {0};
  for (int i = 0; i <= n; ++i)
    for (int j = 0; j <= n; ++j) {
      mesh.points.row(i * (n + 1) + j) = at(double(i) / n, double(j) / n);
      if (i == n || j == n) continue;
      const Index first = i * (n + 1) + j;
      for (const Index node : {first, first + n + 1, first + n + 2, first + 1})
        mesh.connectivity.push_back(node);
      mesh.types.push_back(CellType::Quad);
      mesh.offsets.push_back(static_cast<Index>(mesh.connectivity.size()));
    }
  return make_surface_mesh(mesh, extract_boundary(mesh), 1);
}

}  // namespace

TEST_CASE("walls that no CAD tells of keep their shape when they slide", "[surface][far-field]") {
  constexpr double kTurn = 0.15;
  for (const auto& [hub, casing] :
       {std::pair{cylinder_wall(5), cylinder_wall(10)}, std::pair{cone_wall(5.5), cone_wall(10)},
        std::pair{sphere_wall(6), sphere_wall(10)}, std::pair{bulged_wall(5), bulged_wall(10)}}) {
    CAPTURE(hub.kind);
    const MorphCase c = mesh_case(to_model(pin(0)), space_around_pin(hub, casing));
    SurfaceMorphOptions options;
    options.groups.sliding = {"hub", "casing"};
    const Morphed m = morph(c, to_model(pin(kTurn)), options);
    CHECK_THAT(m.surface.warnings.back(), !Catch::Contains("may slide"));
    CHECK(m.surface.dragged_patches == 0);
    const SurfaceMorphResult fixed = morph_surface(c, to_model(pin(kTurn)));
    CHECK(fixed.dragged_patches == 2);
    CHECK_THAT(fixed.warnings.back(),
               Catch::Contains("touches 2 of the fixed ones, which may slide, too"));
    CHECK(folded_facets(c.boundary, m.points, c.mesh.points) == 0);
    // On facets the walls are as far off as the facets' middles are.
    const double allowed = hub.kind == "facets" ? 0.05 : 1e-12 * c.diagonal;
    double off = 0, on_pin = 0, far = 0, most = 0;
    for (int side : {0, 1})
      for (const Index node : c.mesh.groups[side].nodes) {
        const Vector3d x = c.mesh.points.row(node), y = m.points.row(node);
        off = std::max(off, off_wall(side == 0 ? hub : casing, y));
        if (std::abs(x.tail<2>().norm() - 1) < 1e-9)
          on_pin = std::max(on_pin, (y - turned(x, kTurn)).norm());
        else if (x.tail<2>().norm() < 3.9)
          most = std::max(most, (y - x).norm());
        else
          far = std::max(far, (y - x).norm());
      }
    CHECK(off <= allowed);
    CHECK(on_pin <= std::max(allowed, 1e-9));
    CHECK(far == 0);
    CHECK(most > 0.9 * kTurn * 10);

    // With a small step each node's way is the derivative's.
    constexpr double kStep = 1e-5;
    const SurfaceMorph surface(c.base, c.mesh, c.boundary, options);
    const Points start = surface_points(c.boundary, c.mesh.points);
    Points at = start;
    for (const RowId n : surface.association().dimension.ids())
      if (surface.association().dimension[n] != CadDimension::None)
        at.row(n) = turned(at.row(n), kTurn);
    const Points here = surface.slide(at);
    const SlideDerivative map = surface.slide_derivative(here);
    RowMatrix u = RowMatrix::Zero(at.rows(), 3), v(at.rows(), 3);
    for (const RowId n : surface.association().dimension.ids())
      if (surface.association().dimension[n] != CadDimension::None)
        u.row(n) = Vector3d::UnitZ().cross(Vector3d(at.row(n)));
    for (Index i = 0; i < v.size(); ++i) v.data()[i] = std::sin(1e3 * double(i * i % 10007));
    const RowMatrix du = map.forward(u);
    CHECK(std::abs(v.cwiseProduct(du).sum() - map.adjoint(v).cwiseProduct(u).sum()) <=
          1e-12 * v.norm() * du.norm());
    if (hub.kind == "facets") continue;  // these have kinks
    const Points steps =
        (surface.slide(at + kStep * u) - surface.slide(at - kStep * u)) / (2 * kStep);
    CHECK((steps - du).cwiseAbs().maxCoeff() <= 1e-6 * 10);
  }
}

TEST_CASE("nodes where the CAD goes through a wall stay on both", "[surface][far-field]") {
  for (const auto& [hub, casing, digits] :
       {std::tuple{cylinder_wall(5), cylinder_wall(10), 1e-14},
        std::tuple{sphere_wall(6), sphere_wall(10), 1e-14},
        std::tuple{cylinder_wall(5), cylinder_wall(10), 1e-8}}) {  // as text rounds them
    CAPTURE(hub.kind, digits);
    Mesh mesh = space_around_pin(hub, casing);
    mesh.points = ((mesh.points / digits).array().round() * digits).matrix();
    const MorphCase c = mesh_case(to_model(pin(0)), mesh);
    SurfaceMorphOptions options;
    options.groups.sliding = {"hub", "casing"};
    const Morphed m = morph(c, to_model(pin(0.1, 1.3)), options);
    CHECK(folded_facets(c.boundary, m.points, c.mesh.points) == 0);
    int on_pin = 0;
    double off = 0, off_pin = 0;
    for (int side : {0, 1})
      for (const Index node : c.mesh.groups[side].nodes) {
        const Vector3d y = m.points.row(node);
        off = std::max(off, off_wall(side == 0 ? hub : casing, y));
        if (std::abs(c.mesh.points.row(node).tail<2>().norm() - 1) > 1e-9 + digits) continue;
        ++on_pin;
        off_pin = std::max(off_pin, std::abs(turned(y, -0.1).tail<2>().norm() - 1.3));
      }
    CHECK(on_pin == 48);
    CHECK(off <= 1e-12 * c.diagonal + 2 * digits);
    CHECK(off_pin <= 1e-9 + 2 * digits);
  }
}

TEST_CASE("a part that moves rigidly goes with the nearest piece of the CAD",
          "[surface][far-field]") {
  const Wall hub = cylinder_wall(5), casing = cylinder_wall(10);
  const MorphCase c = mesh_case(to_model(pin(0)), space_around_pin(hub, casing));
  SurfaceMorphOptions options;
  options.groups.rigid = {"far"};
  options.groups.sliding = {"hub", "casing"};
  const Morphed m = morph(c, to_model(pin(0.2)), options);
  double off = 0, off_turn = 0;
  for (const Index node : c.mesh.groups[2].nodes)
    off = std::max(off,
                   (m.points.row(node).transpose() - turned(c.mesh.points.row(node), 0.2)).norm());
  CHECK(off <= 1e-9);
  // All that bounds the walls turns: so do they.
  for (int side : {0, 1})
    for (const Index node : c.mesh.groups[side].nodes)
      off_turn = std::max(
          off_turn, (m.points.row(node).transpose() - turned(c.mesh.points.row(node), 0.2)).norm());
  CHECK(off_turn <= 1e-8);

  options.groups.rigid = {"hub", "casing"};
  options.groups.sliding = {"hub"};
  CHECK_THROWS_AS(SurfaceMorph(c.base, c.mesh, c.boundary, options), InvalidInputError);
}

TEST_CASE("named parts inside of a region stay, slide and move as one piece",
          "[surface][far-field]") {
  constexpr double kTurn = 0.15;
  const Wall hub = cylinder_wall(5), casing = cylinder_wall(10);
  MorphCase c = mesh_case(to_model(pin(0)), space_around_pin(hub, casing));
  // A tube round the pin, and the half plane from the pin that its turn leaves in place.
  c.mesh.groups.push_back({"tube", "marker", {}});
  c.mesh.groups.push_back({"plane", "marker", {}});
  for (Index node = 0; node < c.mesh.node_count(); ++node) {
    const Vector3d x = c.mesh.points.row(node);
    if (std::abs(x.tail<2>().norm() - 1.75) < 1e-9) c.mesh.groups[3].nodes.push_back(node);
    if (std::abs(x.z()) < 1e-9 && x.y() > 0) c.mesh.groups[4].nodes.push_back(node);
  }
  const std::vector<Index> far = c.mesh.groups[2].nodes, tube = c.mesh.groups[3].nodes,
                           plane = c.mesh.groups[4].nodes;
  REQUIRE(tube.size() == 9 * 24);
  REQUIRE(plane.size() == 9 * 9);
  const auto with_parts = [&](const SurfaceMorphOptions& options, double turn) {
    c.boundary =
        extract_boundary(c.mesh, find_cell_neighbours(c.mesh),
                         mark_parts_inside(c.mesh, extract_boundary(c.mesh), options.groups));
    return morph(c, to_model(pin(turn)), options);
  };
  SurfaceMorphOptions options;
  options.groups.held = {"tube"};
  for (const Points& held = with_parts(options, kTurn).points; const Index node : tube)
    REQUIRE(held.row(node) == c.mesh.points.row(node));

  options.groups = {};
  options.groups.rigid = {"tube"};
  options.groups.sliding = {"hub", "casing"};
  const Morphed rigid = with_parts(options, kTurn);
  for (const Index node : tube)
    REQUIRE((rigid.points.row(node).transpose() - turned(c.mesh.points.row(node), kTurn)).norm() <
            1e-9);
  REQUIRE(rigid.surface.notes.size() == 1);
  CHECK_THAT(rigid.surface.notes.front(), Catch::Contains("'tube' moves as the part") &&
                                              Catch::Contains("turned by 8.59437 degrees"));

  // A zone goes with the body in it, which is the CAD's.
  c.mesh.groups.push_back({"zone", "zone", {}});
  for (Index node = 0; node < c.mesh.node_count(); ++node)
    if (c.mesh.points.row(node).tail<2>().norm() < 1.75 + 1e-9)
      c.mesh.groups.back().nodes.push_back(node);
  const std::vector<Index> zone = c.mesh.groups.back().nodes;
  REQUIRE(zone.size() > 2 * tube.size());
  options.groups.rigid = {"zone"};
  const Morphed with_zone = with_parts(options, kTurn);
  for (const Index node : zone)
    REQUIRE(
        (with_zone.points.row(node).transpose() - turned(c.mesh.points.row(node), kTurn)).norm() <
        1e-9);
  c.mesh.groups.pop_back();

  options.groups = {};
  options.groups.sliding = {"hub", "casing", "plane"};
  // Nodes that it has in common with hub and casing stay.
  constexpr double kSmallTurn = 0.003;
  const Morphed slid = with_parts(options, kSmallTurn);
  double off = 0, most = 0;
  for (const Index node : plane) {
    off = std::max(off, std::abs(slid.points(node, 2)));
    most = std::max(most, (slid.points.row(node) - c.mesh.points.row(node)).norm());
  }
  CHECK(off <= 1e-12 * c.diagonal);
  CHECK(most > 0.9 * kSmallTurn * 5);
  CHECK(folded_facets(c.boundary, slid.points, c.mesh.points) == 0);

  // Single nodes have no face.
  c.mesh.groups.push_back({"probe", "marker", {tube[40]}});
  options.groups = {};
  options.groups.held = {"probe"};
  CHECK_THROWS_WITH(with_parts(options, kTurn), Catch::Contains("single nodes or lines"));
  c.mesh.groups.back().nodes.insert(c.mesh.groups.back().nodes.end(), far.begin(), far.end());
  CHECK(
      std::ranges::any_of(with_parts(options, kTurn).surface.warnings, [](const std::string& line) {
        return line.find("'probe' is to stay, but 1 of its nodes lie inside") != std::string::npos;
      }));
}

TEST_CASE("points go to the nearest point of the surface of their facets", "[surface]") {
  const Matrix3d frame =
      (Eigen::AngleAxisd(0.7, Vector3d(1, 2, 3).normalized()) * Matrix3d::Identity());
  const Vector3d shift(11, -7, 3);
  struct Form {
    std::string kind;
    std::function<Vector3d(double, double)> at;  // in the frame
  };
  const std::vector<Form> forms{
      {"sphere",
       [](double s, double t) -> Vector3d {
         return 3 * Vector3d(s - 0.4, t - 0.3, 1).normalized();
       }},
      {"cylinder",
       [](double s, double t) -> Vector3d {
         return {3 * std::cos(0.5 * s), 3 * std::sin(0.5 * s), 2 * t};
       }},
      {"cylinder",  // all round
       [](double s, double t) -> Vector3d {
         return {3 * std::cos(2 * pi * s), 3 * std::sin(2 * pi * s), 2 * t};
       }},
      {"cone",
       [](double s, double t) -> Vector3d {
         const double r = 3 - t;
         return {r * std::cos(2 * s), r * std::sin(2 * s), 2 * t};
       }},
      {"facets", [](double s, double t) -> Vector3d {
         return {(3 + std::cos(t)) * std::cos(s), (3 + std::cos(t)) * std::sin(s), std::sin(t)};
       }}};
  for (const Form& form : forms) {
    CAPTURE(form.kind);
    const SurfaceMesh surface =
        patch([&](double s, double t) -> Vector3d { return frame * form.at(s, t) + shift; });
    std::vector<FacetId> facets;
    for (const FacetId f : surface.facets.ids()) facets.push_back(f);
    const OwnSurface own(surface, facets, 1e-8);
    CHECK(own.kind() == form.kind);
    for (int i = 0; i < surface.points.rows(); i += 7) {
      const RowId n(i);
      const Vector3d p = surface.points.row(n);
      CHECK((own.foot(p, n).point - p).norm() <= 1e-12 * 20);
      const Vector3d x = p + 0.1 * Vector3d(std::sin(i), std::cos(3 * i), std::sin(5 * i));
      const OwnSurface::Foot foot = own.foot(x, n);
      const Vector3d local = frame.transpose() * (foot.point - shift);
      if (form.kind == "sphere") CHECK(std::abs(local.norm() - 3) <= 1e-11);
      if (form.kind == "cylinder") CHECK(std::abs(local.head<2>().norm() - 3) <= 1e-11);
      if (form.kind == "cone") CHECK(std::abs(local.head<2>().norm() - 3 + local.z() / 2) <= 1e-11);
      if (form.kind == "facets") continue;
      // No point of a fine net is nearer, and the way there is at right angles to the surface.
      double least = std::numeric_limits<double>::infinity();
      for (double s = -1; s <= 2; s += 0.01)
        for (double t = -1; t <= 2; t += 0.01)
          least = std::min(least, (frame * form.at(s, t) + shift - x).norm());
      CHECK((foot.point - x).norm() <= least + 1e-9);
      for (int d = 0; d < 3; ++d) {
        const Vector3d h = 1e-5 * Vector3d::Unit(d);
        const Vector3d difference = (own.foot(x + h, n).point - own.foot(x - h, n).point) / 2e-5;
        CHECK((difference - foot.slope.col(d)).norm() <= 1e-7);
      }
    }
  }
}

TEST_CASE("on facets points that follow each other over the surface keep their order",
          "[surface]") {
  const SurfaceMesh surface = patch([](double s, double t) -> Vector3d {
    return {4 * s, 3 * t, 0.3 * std::sin(4 * s) * std::cos(3 * t)};
  });
  std::vector<FacetId> facets;
  for (const FacetId f : surface.facets.ids()) facets.push_back(f);
  const OwnSurface own(surface, facets, 1e-8);
  REQUIRE(own.kind() == "facets");
  // Distance of a point to the facets, by points of all triangles.
  const auto off = [&](const Vector3d& x) {
    double least = std::numeric_limits<double>::infinity();
    for (const auto& facet : surface.facets)
      for (const int k : {1, 2}) {
        const Vector3d a = surface.points.row(facet[0]), b = surface.points.row(facet[k]),
                       c = surface.points.row(facet[k + 1]);
        const Vector3d n = (b - a).cross(c - a).normalized();
        const Vector3d foot = x - n.dot(x - a) * n;
        const bool is_inside = n.dot((b - a).cross(foot - a)) >= -1e-9 &&
                               n.dot((c - b).cross(foot - b)) >= -1e-9 &&
                               n.dot((a - c).cross(foot - c)) >= -1e-9;
        if (is_inside) least = std::min(least, (foot - x).norm());
      }
    return least;
  };
  const RowId middle(6 * 13 + 6);
  for (const double height : {-0.3, 0.3})
    for (const double t : {0.7, 1.5, 2.3}) {
      double last = 0;
      int equal = 0;
      for (double s = 0.4; s < 3.6; s += 0.02) {
        const Vector3d x(s, t, 0.3 * std::sin(s) * std::cos(t) + height);
        const Vector3d foot = own.foot(x, middle).point;
        CHECK(off(foot) <= 1e-9);
        CHECK((foot - x).norm() <= 1.1 * 0.3);
        equal += foot.x() <= last + 1e-4;
        last = foot.x();
      }
      CHECK(equal == 0);
    }
}

TEST_CASE("A ring's rims turn with the pockets between them", "[surface][curves]") {
  const auto cage = [](double turn, double radius, double height) {
    const auto cylinder = [&](double r, double h) {
      return BRepPrimAPI_MakeCylinder(gp_Ax2(gp_Pnt(0, 0, -h / 2), gp_Dir(0, 0, 1)), r, h).Shape();
    };
    TopoDS_Shape ring = BRepAlgoAPI_Cut(cylinder(42, height), cylinder(38, 2 * height)).Shape();
    for (int i = 0; i < 8; ++i) {
      const double a = turn + i * std::numbers::pi / 4;
      const gp_Pnt at(40 * std::cos(a), 40 * std::sin(a), 0);
      ring = BRepAlgoAPI_Cut(ring, BRepPrimAPI_MakeSphere(at, radius).Shape()).Shape();
    }
    return ring;
  };
  constexpr double kTurn = 0.3;
  const TopoDS_Shape base = cage(0, 6, 16);
  const MorphCase c = mesh_case(through_step(base), triangulate(base, 0.3));
  const SurfaceMorphResult moved = morph_surface(c, through_step(cage(kTurn, 7, 18)));
  for (const std::string& warning : moved.warnings) FAIL_CHECK(warning);
  const Eigen::AngleAxisd turned(kTurn, Vector3d::UnitZ());
  Index rims = 0;
  for (Index i = 0; i < moved.positions.rows(); ++i) {
    const Vector3d x = c.mesh.points.row(c.boundary.nodes[RowId(i)]);
    if (std::abs(x.z()) < 8 - 1e-9) continue;
    ++rims;
    const Vector3d to = turned * x + Vector3d(0, 0, std::copysign(1, x.z()));
    CHECK((Vector3d(moved.positions.row(i)) - to).norm() < 1e-4);
  }
  CHECK(rims > 50);
}
