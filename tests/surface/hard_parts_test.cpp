#include <BOPAlgo_Builder.hxx>
#include <BRepAlgoAPI_Common.hxx>
#include <BRepAlgoAPI_Cut.hxx>
#include <BRepAlgoAPI_Fuse.hxx>
#include <BRepBuilderAPI_MakeEdge.hxx>
#include <BRepBuilderAPI_MakeFace.hxx>
#include <BRepBuilderAPI_MakeWire.hxx>
#include <BRepFilletAPI_MakeFillet.hxx>
#include <BRepOffsetAPI_ThruSections.hxx>
#include <BRepPrimAPI_MakeBox.hxx>
#include <BRepPrimAPI_MakeCone.hxx>
#include <BRepPrimAPI_MakeCylinder.hxx>
#include <BRepPrimAPI_MakeRevol.hxx>
#include <BRepPrimAPI_MakeSphere.hxx>
#include <BRepPrimAPI_MakeTorus.hxx>
#include <BRep_Builder.hxx>
#include <BRep_Tool.hxx>
#include <Eigen/Geometry>
#include <GC_MakeArcOfCircle.hxx>
#include <Geom2dAPI_Interpolate.hxx>
#include <Geom2d_BSplineCurve.hxx>
#include <GeomAPI_Interpolate.hxx>
#include <TColStd_HArray1OfReal.hxx>
#include <TColgp_HArray1OfPnt.hxx>
#include <TColgp_HArray1OfPnt2d.hxx>
#include <TopExp_Explorer.hxx>
#include <TopoDS.hxx>
#include <TopoDS_Edge.hxx>
#include <TopoDS_Face.hxx>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>

#include "cad/topology_match.h"
#include "core/errors.h"
#include "core/parallel.h"
#include "known_parts.h"
#include "morph_case.h"
#include "triangulation.h"
#include "warped_shape.h"

using namespace cadmorph;
using namespace cadmorph::testing;
using Eigen::Vector2d;
using Eigen::Vector3d;
using std::numbers::pi;

namespace {

// Distance from a trimmed face that counts as on it, of these meshes: millimetres.
constexpr double kUnnoticed = 1e-2;

double largest_tolerance(const CadModel& model) {
  double tolerance = 1e-7;
  for (const auto& f : model.faces()) tolerance = std::max(tolerance, f.tolerance);
  for (const auto& e : model.edges()) tolerance = std::max(tolerance, e.tolerance);
  for (const auto& v : model.vertices()) tolerance = std::max(tolerance, v.tolerance);
  return tolerance;
}

gp_Ax2 axes(double seam) {
  return gp_Ax2(gp_Pnt(0, 0, 0), gp_Dir(0, 0, 1), gp_Dir(std::cos(seam), std::sin(seam), 0));
}

/// A cylinder with a radial hole at angle 0, which the seam crosses when it is there too.
TopoDS_Shape drilled_shaft(double hole, double seam) {
  return BRepAlgoAPI_Cut(
             BRepPrimAPI_MakeCylinder(axes(seam), 15, 40).Solid(),
             BRepPrimAPI_MakeCylinder(gp_Ax2(gp_Pnt(0, 0, 20), gp_Dir(1, 0, 0)), hole, 30).Solid())
      .Shape();
}

/// A cylinder with a hemisphere on top, as one turned part: no edge at the pole.
TopoDS_Shape capsule(double radius, double height, double seam) {
  const Vector2d x(std::cos(seam), std::sin(seam));
  const auto at = [&](double r, double z) { return gp_Pnt(r * x.x(), r * x.y(), z); };
  BRepBuilderAPI_MakeWire outline(
      BRepBuilderAPI_MakeEdge(at(0, 0), at(radius, 0)).Edge(),
      BRepBuilderAPI_MakeEdge(at(radius, 0), at(radius, height)).Edge(),
      BRepBuilderAPI_MakeEdge(
          GC_MakeArcOfCircle(at(radius, height),
                             at(radius * std::sqrt(0.5), height + radius * std::sqrt(0.5)),
                             at(0, height + radius))
              .Value())
          .Edge(),
      BRepBuilderAPI_MakeEdge(at(0, height + radius), at(0, 0)).Edge());
  return BRepPrimAPI_MakeRevol(BRepBuilderAPI_MakeFace(outline.Wire()),
                               gp_Ax1(gp_Pnt(0, 0, 0), gp_Dir(0, 0, 1)))
      .Shape();
}

/// Both blocks with one common face.
TopoDS_Shape glued_blocks(double first, double second) {
  BOPAlgo_Builder builder;
  builder.AddArgument(BRepPrimAPI_MakeBox(gp_Pnt(0, 0, 0), gp_Pnt(first, 20, 20)).Solid());
  builder.AddArgument(
      BRepPrimAPI_MakeBox(gp_Pnt(first, 0, 0), gp_Pnt(first + second, 20, 20)).Solid());
  builder.Perform();
  return builder.Shape();
}

struct OnCad {
  double farthest = 0;  ///< of any node of a facet from the variant of the facet's base face
  Index folded = 0;     ///< facets that look to the inside of their variant face
};

/// Judges a morphed triangulation whose regions are the base faces of its triangles.
OnCad judge(const MorphCase& c, const Points& surface, const TopologyMatch& match,
            const CadModel& variant, const TopoDS_Shape& shape) {
  const FaceOracle oracle(shape);
  Points points = c.mesh.points;
  points(c.boundary.nodes, Eigen::all) = surface;
  OnCad result;
  for (Index t = 0; t < c.mesh.cell_count(); ++t) {
    const auto n = c.mesh.cell(t);
    const int face = match.faces[FaceId(c.mesh.region(t))];
    const Vector3d a = points.row(n[0]), b = points.row(n[1]), d = points.row(n[2]);
    for (const Vector3d& x : {a, b, d})
      result.farthest = std::max(result.farthest, oracle.distance(face, x));
    const Vector3d middle = (a + b + d) / 3;
    const Vector3d normal = variant.normal(FaceId(face), oracle.parameters(face, middle));
    result.folded += (b - a).cross(d - a).dot(normal) <= 0;
  }
  return result;
}

// Morphs the surface of a part along a twist about the z axis.
void check_twist(const TopoDS_Shape& part) {
  const auto twist = [](const Vector3d& x) -> Vector3d {
    return Eigen::AngleAxisd(0.02 * x.z(), Vector3d::UnitZ()) * x;
  };
  const MorphCase c = mesh_case(to_model(part), triangulate(part, 0.1));
  const auto result = morph_surface(c, to_model(warped(part, twist)));
  const Points expected = images(surface_points(c.boundary, c.mesh.points), twist);
  // What the B-splines of the warped shape interpolate.
  CHECK(largest_difference(result.positions, expected) < 1e-6 * c.diagonal);
}

// A loft of three equal profiles, round at (-20, 1.5) and sharper at (20, 1.5), whose spline starts
// at a point of 40.
TopoDS_Shape blade(int start, double thickness) {
  constexpr int kPoints = 40;
  BRepOffsetAPI_ThruSections loft(true);
  for (const double height : {0.0, 15.0, 30.0}) {
    const Handle(TColgp_HArray1OfPnt) points = new TColgp_HArray1OfPnt(1, kPoints);
    for (int i = 0; i < kPoints; ++i) {
      const double angle = 2 * pi * (i + start) / kPoints, x = std::cos(angle);
      const double y = thickness * std::sin(angle) * (1 - 0.6 * x) + 1.5 * x * x;
      points->SetValue(i + 1, {20 * x, y, height});
    }
    GeomAPI_Interpolate section(points, true, 1e-9);
    section.Perform();
    const TopoDS_Edge edge = BRepBuilderAPI_MakeEdge(section.Curve());
    loft.AddWire(BRepBuilderAPI_MakeWire(edge));
  }
  return loft.Shape();
}

// A bent loft that tapers, with a hole across its middle, whose rims begin where a kernel began to
// trace them.
TopoDS_Shape stem(double length) {
  constexpr int kPoints = 24;
  BRepOffsetAPI_ThruSections loft(true);
  for (const double part : {0.0, 0.25, 0.5, 0.75, 1.0}) {
    const Handle(TColgp_HArray1OfPnt) points = new TColgp_HArray1OfPnt(1, kPoints);
    for (int i = 0; i < kPoints; ++i) {
      const double angle = 2 * pi * i / kPoints;
      points->SetValue(i + 1, {14 * part * part + 12 * (1 - 0.5 * part) * std::cos(angle),
                               9 * (1 - 0.3 * part) * std::sin(angle), part * length});
    }
    GeomAPI_Interpolate section(points, true, 1e-9);
    section.Perform();
    const TopoDS_Edge edge = BRepBuilderAPI_MakeEdge(section.Curve());
    loft.AddWire(BRepBuilderAPI_MakeWire(edge));
  }
  const gp_Ax2 across(gp_Pnt(4, -30, 0.55 * length), gp::DY());
  return BRepAlgoAPI_Cut(loft.Shape(), BRepPrimAPI_MakeCylinder(across, 3, 60).Shape());
}

}  // namespace

TEST_CASE("facets are given to the face they came from", "[surface][association]") {
  for (const auto& name : all_shapes()) {
    DYNAMIC_SECTION(name) {
      const TopoDS_Shape shape = read_shape(model_file("shapes/" + name + ".step"));
      for (const bool is_split : {false, true}) {
        if (is_split && name == "blade") continue;  // chords leave its leading edge by too much
        Mesh mesh = triangulate(shape, 0.1, 0.25);
        if (is_split) mesh = split_triangles(mesh);
        const MorphCase c = mesh_case(to_model(shape), mesh);
        SurfaceMorphOptions options;
        options.association.tolerance = 0.5;  // chords of slender triangles: their middles are off
        const SurfaceMorph surface(c.base, c.mesh, c.boundary, options);
        Index wrong = 0;
        for (const FacetId f : surface.association().facet_face.ids())
          wrong += surface.association().facet_face[f] != c.mesh.region(c.boundary.cell[f]);
        CAPTURE(is_split, mesh.cell_count());
        // Coincident copies of an interface can't be told apart.
        CHECK(wrong == (name == "two_blocks" ? wrong : 0));
        CHECK(surface.association().unmatched_nodes == 0);
      }
    }
  }
}

TEST_CASE("a seam that crosses a hole leaves every node in place when it moves away",
          "[surface][seam]") {
  const TopoDS_Shape base = drilled_shaft(5, 0);
  const MorphCase c = mesh_case(to_model(base), triangulate(base, 0.05));
  const Points old = surface_points(c.boundary, c.mesh.points);
  for (const double seam : {0.0, 20.0, 90.0, 180.0}) {
    DYNAMIC_SECTION("seam at " << seam) {
      const CadModel variant = to_model(drilled_shaft(5, seam * pi / 180));
      const auto result = morph_surface(c, variant);
      // The curve where hole and shaft meet is computed anew each time, to its tolerance.
      const double tolerance = 2 * std::max(largest_tolerance(*c.base), largest_tolerance(variant));
      CHECK(largest_difference(result.positions, old) <= tolerance + 1e-8 * c.diagonal);
    }
  }
}

TEST_CASE("a growing radial hole keeps its nodes on all faces, wherever the seams are",
          "[surface][seam]") {
  const TopoDS_Shape base = drilled_shaft(5, 0);
  const MorphCase c = mesh_case(to_model(base), triangulate(base, 0.05));
  for (const double seam : {0.0, 90.0, 180.0}) {
    DYNAMIC_SECTION("seam at " << seam) {
      const TopoDS_Shape shape = drilled_shaft(6.5, seam * pi / 180);
      const CadModel variant = to_model(shape);
      const TopologyMatch match = match_topology(*c.base, variant);
      const auto result = SurfaceMorph(c.base, c.mesh, c.boundary).morph(variant, match);
      const OnCad judged = judge(c, result.positions, match, variant, shape);
      CHECK(judged.farthest <= 2 * largest_tolerance(variant));
      CHECK(judged.folded == 0);
    }
  }
}

TEST_CASE("a narrow groove follows a twist of the part", "[surface][seam]") {
  // Both circles of the groove's floor turn by nearly one angle, as if only their seam had moved.
  TopoDS_Shape part = BRepPrimAPI_MakeBox(gp_Pnt(-15, -12, 0), gp_Pnt(15, 12, 10)).Solid();
  double z = 10;
  for (const auto& [height, from, to] : std::initializer_list<std::array<double, 3>>{
           {30, 6, 6}, {1, 6, 5}, {0.005, 5, 5}, {1, 5, 6}, {3, 6, 6}, {1, 6, 5}, {3, 5, 5}}) {
    const gp_Ax2 at(gp_Pnt(0, 0, z), gp_Dir(0, 0, 1));
    const TopoDS_Shape piece = from == to ? BRepPrimAPI_MakeCylinder(at, from, height).Solid()
                                          : BRepPrimAPI_MakeCone(at, from, to, height).Solid();
    part = BRepAlgoAPI_Fuse(part, piece).Shape();
    z += height;
  }
  check_twist(part);
}

TEST_CASE("a groove between plane walls follows a twist of the part", "[surface][seam]") {
  // The walls link no seams, and both circles of the floor turn by nearly one angle.
  for (const bool has_flat : {false, true}) {
    DYNAMIC_SECTION((has_flat ? "in a shaft with a flat" : "in a round shaft")) {
      TopoDS_Shape part = BRepPrimAPI_MakeBox(gp_Pnt(-15, -12, 0), gp_Pnt(15, 12, 10)).Solid();
      double z = 10;
      for (const auto& [height, radius] :
           std::initializer_list<std::array<double, 2>>{{30, 6}, {0.05, 3}, {3, 6}}) {
        TopoDS_Shape piece =
            BRepPrimAPI_MakeCylinder(gp_Ax2(gp_Pnt(0, 0, z), gp_Dir(0, 0, 1)), radius, height)
                .Solid();
        const TopoDS_Shape beyond =
            BRepPrimAPI_MakeBox(gp_Pnt(5, -9, z - 1), gp_Pnt(9, 9, z + height + 1)).Solid();
        if (has_flat) piece = BRepAlgoAPI_Cut(piece, beyond).Shape();
        part = BRepAlgoAPI_Fuse(part, piece).Shape();
        z += height;
      }
      check_twist(part);
    }
  }
}

TEST_CASE("rounded corners follow a twist where the variant's u runs the other way",
          "[surface][pole]") {
  const TopoDS_Shape box = BRepPrimAPI_MakeBox(gp_Pnt(0, 0, 0), gp_Pnt(30, 20, 10)).Solid();
  BRepFilletAPI_MakeFillet rounding(box);
  for (TopExp_Explorer it(box, TopAbs_EDGE); it.More(); it.Next())
    rounding.Add(3, TopoDS::Edge(it.Current()));
  const TopoDS_Shape base = rounding.Shape();
  const auto twist = [](const Vector3d& x) -> Vector3d {
    return Eigen::AngleAxisd(0.01 * x.x(), Vector3d::UnitX()) * x;
  };
  const MorphCase c = mesh_case(to_model(base), triangulate(base, 0.1));
  const Shuffled variant = shuffle(
      warped(base, twist),
      {.seed = 1, .is_order_shuffled = false, .has_reversed_surfaces = true, .probability = 1});
  // The reader makes degenerate edges of its own, which run with u.
  const auto result = morph_surface(c, through_step(variant.shape));
  const Points expected = images(surface_points(c.boundary, c.mesh.points), twist);
  CHECK(largest_difference(result.positions, expected) < 1e-6 * c.diagonal);
}

TEST_CASE("a rib's foot is spread evenly where the shaft's seam crosses it", "[surface][seam]") {
  // The seam cuts the arcs of the foot, not always at the same place of the rib.
  const auto ribbed = [](double half, double seam) {
    const gp_Ax2 from(gp_Pnt(0, 0, 15), gp_Dir(0, 0, 1),
                      gp_Dir(std::cos(half), -std::sin(half), 0));
    return BRepAlgoAPI_Fuse(BRepPrimAPI_MakeCylinder(axes(seam), 15, 40).Shape(),
                            BRepPrimAPI_MakeCylinder(from, 25, 10, 2 * half).Shape())
        .Shape();
  };
  const double half = 0.5, wider = 0.6;
  const TopoDS_Shape base = ribbed(half, 0.1);
  const MorphCase c = mesh_case(to_model(base), triangulate(base, 0.02));
  const Points before = surface_points(c.boundary, c.mesh.points);
  for (const double seam : {0.1, -0.3, 0.4}) {
    const SurfaceMorphResult result = morph_surface(c, to_model(ribbed(wider, seam)));
    int on_foot = 0;
    for (Index i = 0; i < before.rows(); ++i) {
      const Vector3d x = before.row(i), y = result.positions.row(i);
      const double angle = std::atan2(x.y(), x.x()), after = std::atan2(y.y(), y.x());
      if (std::abs(x.head<2>().norm() - 15) > 1e-6 || std::abs(std::abs(x.z() - 20) - 5) > 1e-6 ||
          std::abs(angle) > half)
        continue;
      ++on_foot;
      CAPTURE(seam, angle);
      CHECK(std::abs(after - angle * wider / half) < 1e-6);
    }
    CHECK(on_foot > 20);
  }
}

TEST_CASE(
    "the rims of a hole keep their angles about it, whatever an intersection's parameters are",
    "[surface][parameters]") {
  const auto drilled_ring = [](double tube) {
    const gp_Ax2 hole(gp_Pnt(19, 6, -20), gp_Dir(0, 0, 1), gp_Dir(1, 0, 0));
    return BRepAlgoAPI_Cut(BRepPrimAPI_MakeTorus(20, tube).Shape(),
                           BRepPrimAPI_MakeCylinder(hole, 2.5, 40).Shape())
        .Shape();
  };
  const TopoDS_Shape base = drilled_ring(6);
  const MorphCase c = mesh_case(to_model(base), triangulate(base, 0.02));
  const Points before = surface_points(c.boundary, c.mesh.points);
  const CadModel variant = to_model(drilled_ring(7.2));
  const double tolerance = std::max(largest_tolerance(*c.base), largest_tolerance(variant));
  const SurfaceMorphResult result = morph_surface(c, variant);
  int in_hole = 0;
  for (Index i = 0; i < before.rows(); ++i) {
    const Vector2d x = before.row(i).head<2>().transpose() - Vector2d(19, 6);
    if (std::abs(x.norm() - 2.5) > 10 * tolerance) continue;
    ++in_hole;
    const Vector2d y = result.positions.row(i).head<2>().transpose() - Vector2d(19, 6);
    CHECK((y - x).norm() < 10 * tolerance);
  }
  CHECK(in_hole > 20);
}

TEST_CASE("a hole that tilts is not twisted from one end to the other", "[surface][seam]") {
  // Two holes, tilted against each other; what is round about them turns one rim more than the
  // other.
  struct Holes {
    double radius, across, along;

    gp_Ax2 place(double side) const {
      const gp_Pnt middle(15 * side, 0, 15);
      gp_Ax2 axes(gp_Pnt(15 * side, 0, -30), gp_Dir(0, 0, 1), gp_Dir(1, 0, 0));
      axes.Rotate(gp_Ax1(middle, gp_Dir(1, 0, 0)), along);
      axes.Rotate(gp_Ax1(middle, gp_Dir(0, 1, 0)), -side * across);
      return axes;
    }

    TopoDS_Shape block() const {
      TopoDS_Shape shape = BRepPrimAPI_MakeBox(gp_Pnt(-30, -20, 0), gp_Pnt(30, 20, 30)).Shape();
      for (const double side : {-1.0, 1.0})
        shape = BRepAlgoAPI_Cut(shape, BRepPrimAPI_MakeCylinder(place(side), radius, 90).Shape())
                    .Shape();
      return shape;
    }

    /// About the hole from the seam of its wall, times the radius.
    Vector2d around(double side, const Vector3d& x) const {
      const gp_Ax2 axes = place(side);
      const gp_Vec from(axes.Location(), gp_Pnt(x.x(), x.y(), x.z()));
      return {from.Dot(gp_Vec(axes.XDirection())), from.Dot(gp_Vec(axes.YDirection()))};
    }
  };
  const Holes before{5, 20 * pi / 180, 0};
  const TopoDS_Shape base = before.block();
  const MorphCase c = mesh_case(to_model(base), triangulate(base, 0.02));
  const Points from = surface_points(c.boundary, c.mesh.points);
  for (const double along : {5, 8, 10, 12, 15}) {
    const Holes after{6, before.across, along * pi / 180};
    const SurfaceMorphResult result = morph_surface(c, to_model(after.block()));
    for (const double side : {-1.0, 1.0}) {
      double most = 0;
      int in_hole = 0;
      for (Index i = 0; i < from.rows(); ++i) {
        const Vector2d x = before.around(side, from.row(i));
        if (std::abs(x.norm() - before.radius) > 1e-6) continue;
        ++in_hole;
        const Vector2d y = after.around(side, result.positions.row(i));
        most = std::max(most, (y / after.radius - x / before.radius).norm());
      }
      CAPTURE(along, side);
      CHECK(in_hole > 20);
      CHECK(most < 1e-6);
    }
  }
}

TEST_CASE("a tilted hole does not turn with the seam of its wall", "[surface][seam]") {
  // As kernels choose the first axis of a cylinder by its direction: it jumps as the hole tilts.
  const auto plate = [](double tilt, double seam) {
    const gp_Dir along(std::sin(tilt), 0, std::cos(tilt));
    const gp_Ax1 axis(gp_Pnt(0, 0, 0), along);
    gp_Ax2 place(gp_Pnt(-60 * along.X(), 0, -60 * along.Z()), along,
                 gp_Dir(std::cos(tilt), 0, -std::sin(tilt)));
    place.Rotate(axis, seam);
    return BRepAlgoAPI_Cut(BRepPrimAPI_MakeBox(gp_Pnt(-40, -30, -10), gp_Pnt(40, 30, 10)).Shape(),
                           BRepPrimAPI_MakeCylinder(place, 3, 120).Shape())
        .Shape();
  };
  const TopoDS_Shape base = plate(0.17, 0);
  const MorphCase c = mesh_case(to_model(base), triangulate(base, 0.02));
  const Points before = surface_points(c.boundary, c.mesh.points);
  for (const double seam : {0.0, 0.5 * pi, pi}) {
    const SurfaceMorphResult result = morph_surface(c, to_model(plate(0.21, seam)));
    CAPTURE(seam);
    CHECK(largest_difference(result.positions, before) < 0.5);  // tan 0.21 - tan 0.17 is 0.04
  }
}

TEST_CASE("a blade keeps its leading edge when its section starts elsewhere and changes",
          "[surface][seam]") {
  const TopoDS_Shape base = blade(0, 3);
  const MorphCase c = mesh_case(to_model(base), triangulate(base, 0.1));
  const Points before = surface_points(c.boundary, c.mesh.points);
  for (const int start : {0, 2, 5, 16}) {
    CAPTURE(start);
    const SurfaceMorphResult result = morph_surface(c, to_model(blade(start, 4)));
    // The thicker section is up to 1.4 farther out; along it nodes go a little as well.
    CHECK(largest_difference(result.positions, before) < 2);
  }
}

TEST_CASE("a blade keeps its leading edge where what cuts it moves along it", "[surface]") {
  // As the halves of a cylinder cut a blade that stands on it: the thicker it is, the farther the
  // slanted cut runs along its sides, from one towards the nose and from the other away.
  const auto cut = [](double thickness) {
    const gp_Ax2 slanted(gp_Pnt(-45, -30, -1), gp_Dir(0, 0, 1), gp_Dir(1.5, 1, 0));
    return BRepAlgoAPI_Common(blade(0, thickness),
                              BRepPrimAPI_MakeBox(slanted, 100, 60, 60).Shape())
        .Shape();
  };
  const TopoDS_Shape base = cut(3);
  const MorphCase c = mesh_case(to_model(base), triangulate(base, 0.1, 0.1));
  const Points before = surface_points(c.boundary, c.mesh.points);
  const SurfaceMorphResult result = morph_surface(c, to_model(cut(3.6)));
  int at_nose = 0;
  for (Index i = 0; i < before.rows(); ++i) {
    if (before(i, 0) > -19.99) continue;
    ++at_nose;
    // 0.75 by parameters, on a nose of 1.2 in radius.
    CHECK((result.positions.row(i) - before.row(i)).norm() < 0.35);
  }
  CHECK(at_nose > 6);
}

TEST_CASE("rims of a hole across a free form do not turn, wherever they begin", "[surface][seam]") {
  constexpr double kBefore = 80;
  const CadModel base = to_model(stem(kBefore));
  const auto is_traced = [](const CadEdge& edge) { return edge.is_free_form && !edge.is_seam; };
  REQUIRE(std::ranges::count_if(base.edges(), is_traced) == 6);  // two rims in two pieces each
  CHECK(base.skeleton().corners.empty());
  const MorphCase c = mesh_case(base, triangulate(stem(kBefore), 0.2));
  for (const double length : {72.0, 84.0, 88.0, 92.0, 100.0}) {
    const SurfaceMorphResult result = morph_surface(c, to_model(stem(length)));
    double most = 0;
    Index nodes = 0;
    for (std::size_t i = 0; i < c.boundary.nodes.size(); ++i) {
      const Vector3d from = c.mesh.points.row(c.boundary.nodes[i]), to = result.positions.row(i);
      const Eigen::Vector2d before(from.x() - 4, from.z() - 0.55 * kBefore),
          after(to.x() - 4, to.z() - 0.55 * length);
      if (std::abs(before.norm() - 3) > 1e-3) continue;
      ++nodes;
      most = std::max(most, (after.normalized() - before.normalized()).norm());
    }
    CAPTURE(length, nodes);
    CHECK(nodes > 30);
    CHECK(most < 0.002);
  }
}

TEST_CASE("a sheet's rim goes with the tube, whichever seams cut it", "[surface][seam]") {
  const KnownPart& part = known_part("welded_tubes");
  const TopoDS_Shape base = part.make(part.sizes).shape;
  const CadModel model = to_model(base);
  CHECK(model.skeleton().corners.empty());
  const MorphCase c = mesh_case(model, triangulate(base, 0.5));
  constexpr double kShift = -50;
  for (const double seam : {0.0, pi}) {
    Sizes sizes = part.sizes;
    sizes["x"] += kShift;
    sizes["seam"] = seam;
    const SurfaceMorphResult result = morph_surface(c, to_model(part.make(sizes).shape));
    double most = 0;
    Index nodes = 0;
    for (std::size_t i = 0; i < c.boundary.nodes.size(); ++i) {
      const Vector3d from = c.mesh.points.row(c.boundary.nodes[i]), to = result.positions.row(i);
      if (std::hypot(from.y(), from.z()) < sizes("radius") + 1e-3) continue;  // of the chord
      ++nodes;
      most = std::max(most, (to - from - Vector3d(kShift, 0, 0)).norm());
    }
    CAPTURE(seam, nodes);
    CHECK(nodes > 20);
    CHECK(most < 1e-6 * c.diagonal);  // the kernel's tolerance of intersections
  }
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

TEST_CASE("a ball with one hole is not spun about it", "[surface][seam]") {
  const auto ball = [](double hole) {
    const TopoDS_Shape shell =
        BRepAlgoAPI_Cut(BRepPrimAPI_MakeSphere(20).Shape(), BRepPrimAPI_MakeSphere(16).Shape())
            .Shape();
    const gp_Ax2 along(gp_Pnt(0, 0, 0), gp_Dir(3, 1, 2));
    return BRepAlgoAPI_Cut(shell, BRepPrimAPI_MakeCylinder(along, hole, 30).Shape()).Shape();
  };
  const TopoDS_Shape base = ball(8);
  const MorphCase c = mesh_case(to_model(base), triangulate(base, 0.2));
  const SurfaceMorphResult result = morph_surface(c, to_model(ball(10)));
  CHECK(largest_difference(result.positions, surface_points(c.boundary, c.mesh.points)) < 4);
}

TEST_CASE("rims without a corner keep their sense and phase when what stands beside them moves",
          "[surface][seam]") {
  // A ring with a hole; a boss on it goes round. Nothing else is there to predict the rims from.
  const auto ring = [](double azimuth) {
    const auto pin = [](double at, double z, double radius, double height) {
      const gp_Pnt place(21 * std::cos(at), 21 * std::sin(at), z);
      return BRepPrimAPI_MakeCylinder(gp_Ax2(place, gp_Dir(0, 0, 1)), radius, height).Solid();
    };
    TopoDS_Shape part = BRepAlgoAPI_Cut(BRepPrimAPI_MakeCylinder(30, 20).Solid(),
                                        BRepPrimAPI_MakeCylinder(12, 20).Solid())
                            .Shape();
    part = BRepAlgoAPI_Cut(part, pin(1.97, -1, 4, 40)).Shape();
    return BRepAlgoAPI_Fuse(part, pin(azimuth, 10, 3, 16)).Shape();
  };
  const TopoDS_Shape base = ring(4.87);
  const MorphCase c = mesh_case(to_model(base), triangulate(base, 0.2));
  for (const double azimuth : {4.6, 5.2, 5.5}) {
    const SurfaceMorphResult result = morph_surface(c, to_model(ring(azimuth)));
    const Points before = surface_points(c.boundary, c.mesh.points);
    double moved = 0;
    for (Index n = 0; n < before.rows(); ++n) {
      const double radius = before.row(n).head<2>().norm();
      if (std::abs(radius - 30) < 1e-6 || std::abs(radius - 12) < 1e-6)
        moved = std::max(moved, (result.positions.row(n) - before.row(n)).norm());
    }
    CAPTURE(azimuth);
    CHECK(moved < 1e-9 * c.diagonal);
  }
}

TEST_CASE("a pcurve that runs unevenly along its edge moves no node", "[surface][pcurves]") {
  const TopoDS_Shape even = BRepPrimAPI_MakeCylinder(15, 40).Solid();
  const TopoDS_Shape uneven = BRepPrimAPI_MakeCylinder(15, 40).Solid();
  const TopoDS_Face face =
      TopoDS::Face(TopExp_Explorer(uneven, TopAbs_FACE).Current().Oriented(TopAbs_FORWARD));
  for (TopExp_Explorer it(face, TopAbs_EDGE); it.More(); it.Next()) {
    const TopoDS_Edge edge = TopoDS::Edge(it.Current());
    if (BRep_Tool::IsClosed(edge, face)) continue;
    double first, last;
    const double v = BRep_Tool::CurveOnSurface(edge, face, first, last)->Value(first).Y();
    constexpr int n = 60;
    const Handle(TColgp_HArray1OfPnt2d) points = new TColgp_HArray1OfPnt2d(1, n + 1);
    const Handle(TColStd_HArray1OfReal) parameters = new TColStd_HArray1OfReal(1, n + 1);
    for (int i = 0; i <= n; ++i) {
      const double t = 2 * pi * i / n;
      points->SetValue(i + 1, gp_Pnt2d(t + 0.002 * std::sin(3 * t), v));
      parameters->SetValue(i + 1, t);
    }
    Geom2dAPI_Interpolate pcurve(points, parameters, false, 1e-12);
    pcurve.Perform();
    BRep_Builder().UpdateEdge(edge, pcurve.Curve(), face, 1e-7);
  }
  const auto bend = [](const Vector3d& x) -> Vector3d {
    return x + Vector3d(0.004 * x.z() * x.z(), 0, 0.05 * x.x());
  };
  const MorphCase c = mesh_case(to_model(uneven), triangulate(even, 0.1));
  const auto result = morph_surface(c, to_model(warped(even, bend)));
  const Points expected = images(surface_points(c.boundary, c.mesh.points), bend);
  CHECK(largest_difference(result.positions, expected) < 1e-6 * c.diagonal);
}

TEST_CASE("a capsule that grows longer moves its dome as it is", "[surface][pole]") {
  const TopoDS_Shape base = capsule(10, 30, 0);
  const MorphCase c = mesh_case(to_model(base), triangulate(base, 0.05));
  const Points old = surface_points(c.boundary, c.mesh.points);
  for (const double seam : {0.0, 100.0}) {
    DYNAMIC_SECTION("seam at " << seam) {
      const auto result = morph_surface(c, to_model(capsule(10, 45, seam * pi / 180)));
      const Points expected = images(old, [](const Vector3d& x) -> Vector3d {
        return {x.x(), x.y(), x.z() <= 30 ? 1.5 * x.z() : x.z() + 15};
      });
      CHECK(largest_difference(result.positions, expected) <= 1e-8 * c.diagonal);
    }
  }
}

TEST_CASE("the poles of spheres and the seams of tori may lie anywhere", "[surface][pole][seam]") {
  const gp_Pnt middle(0, 0, 30);
  // A pin with a round head, a ball and a ring in blocks.
  const auto pin = [&](double radius, double height, const gp_Dir& pole) {
    const gp_Pnt top(0, 0, height);
    return BRepAlgoAPI_Fuse(BRepPrimAPI_MakeCylinder(radius, height).Solid(),
                            BRepPrimAPI_MakeSphere(gp_Ax2(top, pole), radius).Solid())
        .Shape();
  };
  const auto block = [&](const TopoDS_Shape& inside) {
    return BRepAlgoAPI_Cut(BRepPrimAPI_MakeBox(gp_Pnt(-30, -30, 0), gp_Pnt(30, 30, 60)).Solid(),
                           inside)
        .Shape();
  };
  const auto ball = [&](double radius, const gp_Dir& pole) {
    return block(BRepPrimAPI_MakeSphere(gp_Ax2(middle, pole), radius).Solid());
  };
  const auto ring = [&](double major, double minor, const gp_Dir& axis, const gp_Dir& start) {
    return block(BRepPrimAPI_MakeTorus(gp_Ax2(middle, axis, start), major, minor).Solid());
  };
  const auto check = [](const TopoDS_Shape& base, const TopoDS_Shape& variant,
                        const std::function<Vector3d(const Vector3d&)>& map) {
    const MorphCase c = mesh_case(to_model(base), triangulate(base, 0.2));
    const Points before = surface_points(c.boundary, c.mesh.points);
    const auto moved = morph_surface(c, to_model(variant));
    CHECK(largest_difference(moved.positions, images(before, map)) < 1e-6 * c.diagonal);
  };
  const gp_Dir up(0, 0, 1), down(0, 0, -1), aside(1, 0, 0), askew(1, 2, -2), tilted(2, 1, 1);
  for (const gp_Dir& pole : {up, down, askew, tilted})
    for (const bool is_of_base : {false, true}) {
      CAPTURE(pole.X(), pole.Z(), is_of_base);
      const gp_Dir before = is_of_base ? pole : up, after = is_of_base ? up : pole;
      check(ball(8, before), ball(11, after), [](const Vector3d& x) -> Vector3d {
        const Vector3d way = x - Vector3d(0, 0, 30);
        return way.norm() > 15 ? x : Vector3d(Vector3d(0, 0, 30) + 11.0 / 8 * way);
      });
      check(pin(10, 30, before), pin(12, 40, after), [](const Vector3d& x) -> Vector3d {
        const double z = x.z() < 30 ? 40.0 / 30 * x.z() : 40 + 1.2 * (x.z() - 30);
        return {1.2 * x.x(), 1.2 * x.y(), z};
      });
    }
  for (const gp_Dir& axis : {up, down}) {
    CAPTURE(axis.Z());
    check(ring(12, 4, up, aside), ring(14, 5, axis, gp_Dir(1, 1.3, 0)),
          [](const Vector3d& x) -> Vector3d {
            const Vector3d out(x.x(), x.y(), 0);
            if (out.norm() > 20 || std::abs(x.z() - 30) > 10) return x;
            const double height = 1.25 * (x.z() - 30), far = 14 + 1.25 * (out.norm() - 12);
            return far * out.normalized() + Vector3d(0, 0, 30 + height);
          });
  }
}

TEST_CASE("a hole that moves far leaves no fold unreported", "[surface][fold]") {
  for (const double to : {20.0, 30.0, 45.0, 50.0}) {
    DYNAMIC_SECTION("to " << to) {
      const TopoDS_Shape base = drilled_plate(60, 60, 10, 6, {{15, 15}});
      const MorphCase c =
          mesh_case(to_model(base), split_triangles(split_triangles(triangulate(base, 0.02, 0.2))));
      const TopoDS_Shape shape = drilled_plate(60, 60, 10, 8, {{to, to}});
      const CadModel variant = to_model(shape);
      const TopologyMatch match = match_topology(*c.base, variant);
      SurfaceMorphOptions options;
      options.snap = true;
      const auto result = SurfaceMorph(c.base, c.mesh, c.boundary, options).morph(variant, match);
      const OnCad judged = judge(c, result.positions, match, variant, shape);
      CAPTURE(judged.folded, judged.farthest);
      // A node may leave the trimmed face only with a word about it.
      CHECK((judged.folded == 0 || !result.folded_facets.empty()));
      CHECK((judged.farthest <= 1e-6 || !result.beyond_wires.isZero(0)));
      CHECK(result.distance.maxCoeff() == Approx(judged.farthest).margin(kUnnoticed));
      CHECK(judged.folded == 0);
    }
  }
}

TEST_CASE("what a face took to be mapped without a fold is no warning", "[surface][fold]") {
  const TopoDS_Shape base = drilled_plate(60, 60, 10, 6, {{15, 15}});
  const MorphCase c =
      mesh_case(to_model(base), split_triangles(split_triangles(triangulate(base, 0.02, 0.2))));
  std::size_t remedies = 0;
  for (const double to : {20.0, 25.0, 30.0, 35.0, 40.0}) {
    const SurfaceMorphResult result =
        morph_surface(c, to_model(drilled_plate(60, 60, 10, 8, {{to, to}})));
    for (const auto& [what, faces] : result.remedies) {
      CAPTURE(to, what);
      CHECK_FALSE(faces.empty());
      ++remedies;
    }
    for (const std::string& warning : result.warnings)
      CHECK_THAT(warning, !Catch::Matchers::Contains("wires"));
  }
  CHECK(remedies > 0);
}

TEST_CASE("blocks that share one face keep their interface", "[surface][solids]") {
  const MorphCase c = model_case(to_model(glued_blocks(30, 20)), "shapes/two_blocks.vtu");
  CHECK(c.base->faces().size() == 11);
  const auto stretch = [](const Vector3d& x) -> Vector3d {
    return {x.x() <= 30 ? x.x() * 36 / 30 : 36 + (x.x() - 30) * 14 / 20, x.y(), x.z()};
  };
  const auto result = morph_surface(c, to_model(glued_blocks(36, 14)));
  const Points expected = images(surface_points(c.boundary, c.mesh.points), stretch);
  CHECK(largest_difference(result.positions, expected) <= 1e-8 * c.diagonal);
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

TEST_CASE("the surface is the same to the last bit on any number of threads",
          "[surface][parallel]") {
  const MorphCase c = file_case("bore/base.step", "bore/tet.vtu");
  const CadModel variant = to_model(read_shape(model_file("bore/step20.step")));
  std::vector<Points> results;
  for (const int threads : {1, 2, 3}) {
    set_thread_count(threads);
    results.push_back(morph_surface(c, variant).positions);
  }
  set_thread_count(0);
  CHECK(results[0] == results[1]);
  CHECK(results[0] == results[2]);
}

TEST_CASE("one surface morph serves any number of variants", "[surface]") {
  const MorphCase c = file_case("pipe/base.step", "pipe/tet.vtu");
  const SurfaceMorph surface(c.base, c.mesh, c.boundary);
  const CadModel near = to_model(read_shape(model_file("pipe/step05.step")));
  const CadModel far = to_model(read_shape(model_file("pipe/step20.step")));
  const auto first = surface.morph(far, match_topology(*c.base, far));
  surface.morph(near, match_topology(*c.base, near));
  const auto again = surface.morph(far, match_topology(*c.base, far));
  CHECK(first.positions == again.positions);
  CHECK(first.positions == morph_surface(c, far).positions);
}
