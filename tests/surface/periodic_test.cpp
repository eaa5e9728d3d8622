#include <BRepBuilderAPI_MakeEdge.hxx>
#include <BRepBuilderAPI_MakeFace.hxx>
#include <BRepBuilderAPI_MakeWire.hxx>
#include <BRepPrimAPI_MakePrism.hxx>
#include <BRepPrimAPI_MakeRevol.hxx>
#include <Eigen/Geometry>
#include <GeomAPI_Interpolate.hxx>
#include <Geom_BSplineCurve.hxx>
#include <Geom_BezierSurface.hxx>
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <gp_Ax1.hxx>
#include <numbers>
#include <set>

#include "core/errors.h"
#include "morph_case.h"
#include "surface/periodic_sides.h"
#include "triangulation.h"

using namespace cadmorph;
using namespace cadmorph::testing;
using Eigen::Isometry3d;
using Eigen::Vector3d;
using std::numbers::pi;

namespace {

/// A curved side from hub to casing and from inlet to outlet; `camber` bends it, `lean` leans it.
Handle(Geom_BezierSurface) side(double camber, double lean) {
  TColgp_Array2OfPnt poles(1, 5, 1, 4);
  for (int i = 0; i < 5; ++i)
    for (int j = 0; j < 4; ++j) {
      const double along = i / 4.0, up = j / 3.0;
      const double angle = camber * std::sin(pi * along) * (1 + up) + lean * up * up;
      const double radius = 5 + 5 * up;
      poles.SetValue(i + 1, j + 1,
                     gp_Pnt(radius * std::cos(angle), radius * std::sin(angle), 9 * along));
    }
  return new Geom_BezierSurface(poles);
}

/// A square side whose four corners are alike, which no principal axes tell apart; `bulge` bends
/// it.
Handle(Geom_BezierSurface) square_side(double bulge) {
  TColgp_Array2OfPnt poles(1, 4, 1, 4);
  for (int i = 0; i < 4; ++i)
    for (int j = 0; j < 4; ++j) {
      const bool is_inside = i % 3 != 0 && j % 3 != 0;
      poles.SetValue(i + 1, j + 1, gp_Pnt(7 + 2 * i, is_inside ? bulge : 0, 2 * j));
    }
  return new Geom_BezierSurface(poles);
}

/// A passage between a side and its image a period further on.
struct Passage {
  Handle(Geom_BezierSurface) first;
  bool is_turned;  // else shifted
  double period;   // radians, or a part of kShift
  std::array<int, 3> cells{6, 5, 4};
  double grading = 1.3;

  static inline const Vector3d kShift{1, 6, 2};

  Isometry3d at(double part) const {
    Isometry3d result = Isometry3d::Identity();
    if (is_turned)
      result.rotate(Eigen::AngleAxisd(part * period, Vector3d::UnitZ()));
    else
      result.translate(part * period * kShift);
    return result;
  }
  TopoDS_Shape shape() const {
    const TopoDS_Face face = BRepBuilderAPI_MakeFace(first, 1e-7).Face();
    const Vector3d s = period * kShift;
    if (is_turned)
      return BRepPrimAPI_MakeRevol(face, gp_Ax1(gp_Pnt(0, 0, 0), gp_Dir(0, 0, 1)), period);
    return BRepPrimAPI_MakePrism(face, gp_Vec(s.x(), s.y(), s.z()));
  }
  Mesh mesh() const {
    Mesh result = hex_grid(cells, [&](const Vector3d& s) -> Vector3d {
      const gp_Pnt p = first->Value(std::pow(s.x(), grading), s.y());
      return at(s.z()) * Vector3d(p.X(), p.Y(), p.Z());
    });
    // The grid counts the third direction first or last: sides are told by their places.
    result.groups = {{"low", "marker", {}}, {"high", "marker", {}}, {"all", "set", {}}};
    const Mesh flat = hex_grid(cells, [](const Vector3d& s) { return s; });
    for (Index n = 0; n < flat.node_count(); ++n) {
      if (flat.points(n, 2) == 0) result.groups[0].nodes.push_back(n);
      if (flat.points(n, 2) == 1) result.groups[1].nodes.push_back(n);
      result.groups[2].nodes.push_back(n);
    }
    return result;
  }
};

/// How far nodes of the second side are off the images of those of the first, and how far they
/// moved.
struct Apart {
  double most = 0, farthest = 0;
  Index pairs = 0, unpaired = 0;  // those that a repair may part
};

Apart apart(const Passage& base, const Passage& variant, const MorphCase& c, const Morphed& m) {
  const Mesh& mesh = c.mesh;
  const Points& moved = m.points;
  const std::vector<RowId> paired = nodes_of(m.surface.images);
  Apart result;
  for (Index i = 0; i < mesh.node_count(); ++i) {
    Index image = -1;
    for (Index k = 0; k < mesh.node_count(); ++k)
      if ((mesh.points.row(k).transpose() - base.at(1) * mesh.points.row(i).transpose()).norm() <
          1e-9)
        image = k;
    if (image < 0) continue;
    ++result.pairs;
    for (const Index node : {i, image}) {
      const RowId row = row_of(c.boundary, node);
      result.unpaired += !std::ranges::binary_search(paired, row);
    }
    result.most =
        std::max(result.most,
                 (moved.row(image).transpose() - variant.at(1) * moved.row(i).transpose()).norm());
    result.farthest = std::max(result.farthest, (moved.row(i) - mesh.points.row(i)).norm());
  }
  return result;
}

}  // namespace

TEST_CASE("curved sides a period apart move alike", "[surface][periodic]") {
  const bool is_turned = GENERATE(true, false);
  const unsigned seed = GENERATE(0, 1, 2);
  const double new_period = GENERATE(1.0, 1.1);
  const double period = is_turned ? pi / 6 : 1;
  CAPTURE(is_turned, seed, new_period);
  const Passage base{side(0.1, 0.05), is_turned, period},
      variant{side(0.16, -0.03), is_turned, period * new_period};
  const auto shuffled = [&](const Passage& passage, unsigned by) {
    if (seed == 0) return to_model(passage.shape());
    return to_model(
        shuffle(to_nurbs(passage.shape()),
                {.seed = seed + by, .has_reversed_edges = true, .has_reversed_surfaces = true})
            .shape);
  };
  const MorphCase c = mesh_case(shuffled(base, 0), base.mesh());
  const Morphed m = morph(c, shuffled(variant, 10));
  const Apart found = apart(base, variant, c, m);
  CHECK(found.pairs == 7 * 6);
  CHECK(found.unpaired == 0);
  CHECK(found.farthest > 0.3);
  CHECK(found.most <= 1e-12 * c.diagonal);
}

namespace {

SurfaceMorphOptions named(const std::string& first, const std::string& second) {
  SurfaceMorphOptions options;
  options.groups.periodic = {{first, second}};
  return options;
}

/// How far displacements of the second side are off those of the first, turned by `turn`.
double off_alike(const Mesh& mesh, const Points& moved,
                 const std::vector<std::pair<Index, Index>>& pairs, const Eigen::Matrix3d& turn) {
  double most = 0;
  for (const auto& [from, to] : pairs) {
    const Vector3d a = (moved.row(from) - mesh.points.row(from)).transpose();
    const Vector3d b = (moved.row(to) - mesh.points.row(to)).transpose();
    most = std::max(most, (b - turn * a).norm());
  }
  return most;
}

/// Nodes and their images by `map`.
std::vector<std::pair<Index, Index>> pairs_by(const Mesh& mesh, const Isometry3d& map) {
  std::vector<std::pair<Index, Index>> pairs;
  for (Index i = 0; i < mesh.node_count(); ++i)
    for (Index k = 0; k < mesh.node_count(); ++k)
      if ((mesh.points.row(k).transpose() - map * mesh.points.row(i).transpose()).norm() < 1e-9)
        pairs.emplace_back(i, k);
  return pairs;
}

}  // namespace

TEST_CASE("sides that have names move alike where their shape leaves the turn open",
          "[surface][periodic]") {
  // Four turns carry the one side's nodes to the other's; without names none is taken.
  const double period = 2 * pi / 9;
  const Passage base{square_side(1), true, period, {4, 4, 3}, 1.0},
      variant{square_side(2.5), true, period, {4, 4, 3}, 1.0};
  const CadModel changed =
      to_model(shuffle(to_nurbs(variant.shape()),
                       {.seed = 3, .has_reversed_edges = true, .has_reversed_surfaces = true})
                   .shape);
  const MorphCase c = mesh_case(to_model(base.shape()), base.mesh());
  const auto pairs = pairs_by(c.mesh, base.at(1));
  REQUIRE(pairs.size() == 5 * 5);
  CHECK(apart(base, variant, c, morph(c, changed)).unpaired > 0);
  const Morphed m = morph(c, changed, named("low", "high"));
  const Apart found = apart(base, variant, c, m);
  CHECK(found.unpaired == 0);
  CHECK(found.farthest > 0.5);
  CHECK(found.most <= 1e-12 * c.diagonal);
  CHECK(off_alike(c.mesh, m.points, pairs, base.at(1).linear()) <= 1e-12 * c.diagonal);
  REQUIRE(m.surface.notes.size() == 1);
  CHECK_THAT(m.surface.notes.front(), Catch::Contains("low, high: 25 nodes turned by 40 degrees"));
}

TEST_CASE("sides that the mesh file pairs move alike without an option", "[surface][periodic]") {
  const double period = 2 * pi / 9;
  const Passage base{square_side(1), true, period, {4, 4, 3}, 1.0},
      variant{square_side(2.5), true, period, {4, 4, 3}, 1.0};
  const CadModel changed =
      to_model(shuffle(to_nurbs(variant.shape()),
                       {.seed = 3, .has_reversed_edges = true, .has_reversed_surfaces = true})
                   .shape);
  const auto paired = [&](const std::string& group, const std::string& partner) {
    Mesh mesh = base.mesh();
    for (NodeGroup& each : mesh.groups)
      if (each.name == group) each.partner = partner;
    return mesh_case(to_model(base.shape()), mesh);
  };
  const MorphCase c = paired("low", "high");
  const auto pairs = pairs_by(c.mesh, base.at(1));
  const Morphed m = morph(c, changed);
  CHECK(off_alike(c.mesh, m.points, pairs, base.at(1).linear()) <= 1e-12 * c.diagonal);
  REQUIRE(m.surface.notes.size() == 1);
  CHECK(m.surface.warnings.empty());

  // Also where they are named as sides that slide where the CAD has no place for them.
  SurfaceMorphOptions sliding;
  sliding.groups.sliding = {"low", "high"};
  const Morphed slid = morph(c, changed, sliding);
  CHECK(off_alike(c.mesh, slid.points, pairs, base.at(1).linear()) <= 1e-12 * c.diagonal);
  CHECK(slid.surface.notes.size() == 1);

  // What is not periodic is morphed with a warning: of the mesh, and of the variant.
  const Morphed none = morph(paired("low", "highest"), changed);
  CHECK(none.surface.notes.empty());
  REQUIRE(none.surface.warnings.size() == 1);
  CHECK_THAT(none.surface.warnings.front(), Catch::Contains("'highest' are periodic, but"));
  gp_GTrsf stretch;
  stretch.SetValue(1, 1, 1.2);
  const CadModel stretched = to_model(transformed(base.shape(), stretch));
  const Morphed apart = morph(c, stretched);
  CHECK(apart.points == morph(mesh_case(to_model(base.shape()), base.mesh()), stretched).points);
  REQUIRE(apart.surface.warnings.size() == 1);
  CHECK_THAT(apart.surface.warnings.front(),
             Catch::Contains("mesh file says are periodic, do not"));
}

TEST_CASE("curved sides that have names are a period apart", "[surface][periodic]") {
  const bool is_turned = GENERATE(true, false);
  const double new_period = GENERATE(1.0, 1.1);
  CAPTURE(is_turned, new_period);
  const double period = is_turned ? pi / 6 : 1;
  const Passage base{side(0.1, 0.05), is_turned, period},
      variant{side(0.16, -0.03), is_turned, period * new_period};
  const MorphCase c = mesh_case(to_model(base.shape()), base.mesh());
  const Morphed m = morph(c, to_model(variant.shape()), named("high", "low"));
  const Apart found = apart(base, variant, c, m);
  CHECK(found.pairs == 7 * 6);
  CHECK(found.farthest > 0.3);
  CHECK(found.most <= 1e-12 * c.diagonal);
  CHECK_THAT(m.surface.notes.front(), Catch::Contains("high, low: 42 nodes"));
  CHECK((m.surface.notes.front().find("in the variant") == std::string::npos) == (new_period == 1));
}

TEST_CASE("lines on the sides of a plane mesh that have names move alike", "[surface][periodic]") {
  const bool is_turned = GENERATE(true, false);
  CAPTURE(is_turned);
  // From x = 4 to 10; `bend` bends it, `knots` are where its spline has its parameters.
  const double period = is_turned ? 0.7 : 5;
  Isometry3d next = Isometry3d::Identity();
  if (is_turned)
    next.rotate(Eigen::AngleAxisd(period, Vector3d::UnitZ()));
  else
    next.translate(Vector3d(1, period, 0));
  const auto line = [](double bend, double t) {
    return Vector3d(4 + 6 * t, bend * std::sin(pi * t) * (1 + t), 0);
  };
  // Another exporter's spline runs through the same points at other parameters.
  const auto spline = [&](double bend, const Isometry3d& map, double power) {
    constexpr int kPoints = 60;
    Handle(TColgp_HArray1OfPnt) points = new TColgp_HArray1OfPnt(1, kPoints + 1);
    Handle(TColStd_HArray1OfReal) parameters = new TColStd_HArray1OfReal(1, kPoints + 1);
    for (int i = 0; i <= kPoints; ++i) {
      const double t = double(i) / kPoints;
      const Vector3d x = map * line(bend, t);
      points->SetValue(i + 1, gp_Pnt(x.x(), x.y(), x.z()));
      parameters->SetValue(i + 1, (t + power * t * t) / (1 + power));
    }
    GeomAPI_Interpolate through(points, parameters, false, 1e-9);
    through.Perform();
    return through.Curve();
  };
  const auto shape = [&](double bend, double power) -> TopoDS_Shape {
    const auto low = BRepBuilderAPI_MakeEdge(spline(bend, Isometry3d::Identity(), 0)).Edge();
    const auto high = BRepBuilderAPI_MakeEdge(spline(bend, next, power)).Edge();
    const auto point = [&](double t, bool is_high) {
      const Vector3d x = is_high ? Vector3d(next * line(bend, t)) : line(bend, t);
      return gp_Pnt(x.x(), x.y(), x.z());
    };
    BRepBuilderAPI_MakeWire wire(low);
    wire.Add(BRepBuilderAPI_MakeEdge(point(1, false), point(1, true)).Edge());
    wire.Add(high);
    wire.Add(BRepBuilderAPI_MakeEdge(point(0, true), point(0, false)).Edge());
    return BRepBuilderAPI_MakeFace(wire.Wire(), true).Face();
  };
  constexpr int n = 12;
  Mesh mesh;
  mesh.points.resize((n + 1) * (n + 1), 3);
  mesh.offsets = {0};
  mesh.groups = {{"low", "marker", {}}, {"high", "marker", {}}};
  for (int i = 0; i <= n; ++i)
    for (int j = 0; j <= n; ++j) {
      const Vector3d low = line(0.5, double(i) / n), high = next * low;
      mesh.points.row(i * (n + 1) + j) = low + double(j) / n * (high - low);
      if (j == 0) mesh.groups[0].nodes.push_back(i * (n + 1) + j);
      if (j == n) mesh.groups[1].nodes.push_back(i * (n + 1) + j);
      if (i == n || j == n) continue;
      const Index first = i * (n + 1) + j;
      for (const Index node : {first, first + n + 1, first + n + 2, first + 1})
        mesh.connectivity.push_back(node);
      mesh.types.push_back(CellType::Quad);
      mesh.offsets.push_back(static_cast<Index>(mesh.connectivity.size()));
    }
  const MorphCase c = mesh_case(to_model(shape(0.5, 0)), mesh);
  const auto pairs = pairs_by(c.mesh, next);
  REQUIRE(pairs.size() == n + 1);
  const CadModel changed = to_model(shape(1, 0.1));
  const double apart_without = off_alike(c.mesh, morph(c, changed).points, pairs, next.linear());
  CHECK(apart_without > 1e-3);
  const Morphed m = morph(c, changed, named("low", "high"));
  CHECK(off_alike(c.mesh, m.points, pairs, next.linear()) <= 1e-12 * c.diagonal);
  CHECK(m.points.col(2).isZero(0));
  CHECK(folded_facets(c.boundary, m.points, c.mesh.points) == 0);
}

TEST_CASE("of the motions that carry one side onto the other the likely one counts",
          "[surface][periodic]") {
  struct Case {
    std::string what;
    std::function<Vector3d(const Vector3d&)> map;  ///< of the unit cube; sides at its third ends
    Isometry3d period;
  };
  const auto ring = [](double angle, double inner) {
    return [=](const Vector3d& s) -> Vector3d {
      const double a = angle * s.z(), r = inner + 4 * s.x();
      return {r * std::cos(a), r * std::sin(a), 4 * s.y()};
    };
  };
  const auto turn = [](double angle) {
    return Isometry3d(Eigen::AngleAxisd(angle, Vector3d::UnitZ()));
  };
  const std::vector<Case> cases = {
      {"a cube", [](const Vector3d& s) -> Vector3d { return 4 * s; },
       Isometry3d(Eigen::Translation3d(0, 0, 4))},
      {"a bend of square section", ring(pi / 2, 3), turn(pi / 2)},
      // A shift carries them onto each other, too, but with the mesh on the same side of both.
      {"half a ring", ring(pi, 3), turn(pi)},
      {"a wedge with its axis", ring(0.05, 0), turn(0.05)}};
  for (const Case& given : cases) {
    CAPTURE(given.what);
    Mesh mesh = hex_grid({4, 4, 3}, given.map);
    const Mesh cube = hex_grid({4, 4, 3}, [](const Vector3d& s) { return s; });
    mesh.groups = {{"low", "marker", {}}, {"high", "marker", {}}};
    for (Index n = 0; n < mesh.node_count(); ++n)
      for (const int end : {0, 1})
        if (cube.points(n, 2) == end) mesh.groups[end].nodes.push_back(n);
    const Boundary boundary = extract_boundary(mesh);
    const SurfaceMesh surface = make_surface_mesh(mesh, boundary, 1);
    const std::size_t rows = boundary.nodes.size();
    Association association;
    association.dimension.assign(rows, CadDimension::None);
    association.is_free.assign(rows, 0);
    const IdVector<RowId, char> held(rows, 0);
    const auto find = [&](const std::string& first, const std::string& second) {
      return find_periodic_sides({mesh, boundary, surface, association, held}, {{first, second}});
    };
    const PeriodicSides sides = find("low", "high").front();
    const Isometry& found = sides.pair.before;
    CHECK((found.linear - given.period.linear()).norm() <= 1e-13);
    CHECK((found.shift - given.period.translation()).norm() <= 1e-12);
    CHECK(sides.pair.from.size() == 25);
    std::set<RowId> once(sides.pair.to.begin(), sides.pair.to.end());
    CHECK(once.size() == 25);
    for (std::size_t i = 0; i < sides.pair.from.size(); ++i)
      CHECK((given.period * surface.points.row(sides.pair.from[i]).transpose() -
             surface.points.row(sides.pair.to[i]).transpose())
                .norm() <= 1e-12);

    CHECK_THROWS_WITH(find("low", "hihg"),
                      Catch::Contains("'hihg'") && Catch::Contains("low, high"));
    CHECK_THROWS_AS(find("low", "low"), InvalidInputError);
    mesh.groups[1].nodes.pop_back();
    CHECK_THROWS_WITH(find("low", "high"), Catch::Contains("25 and 24 nodes"));
    mesh.groups[1].nodes.clear();
    CHECK_THROWS_WITH(find("low", "high"), Catch::Contains("no node on the surface"));
    // Another part with as many nodes.
    for (Index n = 0; n < mesh.node_count(); ++n)
      if (cube.points(n, 0) == 1) mesh.groups[1].nodes.push_back(n);
    mesh.groups[0].nodes.resize(20);
    CHECK_THROWS_WITH(find("low", "high"),
                      Catch::Contains("no translation or rotation") && Catch::Contains("mm off"));
    association.is_free.assign(rows, 1);
    CHECK_THROWS_WITH(find("low", "high"), Catch::Contains("follows the volume"));
  }
}

TEST_CASE("variants whose named sides are no images of each other are refused",
          "[surface][periodic]") {
  const Passage base{side(0.1, 0.05), true, pi / 6};
  const MorphCase c = mesh_case(to_model(base.shape()), base.mesh());
  gp_GTrsf stretch;
  stretch.SetValue(1, 1, 1.2);
  const CadModel stretched = to_model(transformed(base.shape(), stretch));
  CHECK_NOTHROW(morph(c, stretched));
  CHECK_THROWS_WITH(morph(c, stretched, named("low", "high")),
                    Catch::Contains("'low' and 'high'") && Catch::Contains("mm off the image"));
  SurfaceMorphOptions held = named("low", "high");
  held.groups.held = {"high"};
  const CadModel moved = to_model(Passage{side(0.16, -0.03), true, pi / 6}.shape());
  CHECK_THROWS_AS(morph(c, moved, held), InvalidInputError);
}
