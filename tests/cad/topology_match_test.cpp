#include "cad/topology_match.h"

#include <BRepAlgoAPI_BuilderAlgo.hxx>
#include <BRepAlgoAPI_Cut.hxx>
#include <BRepAlgoAPI_Fuse.hxx>
#include <BRepBuilderAPI_Copy.hxx>
#include <BRepBuilderAPI_MakeEdge.hxx>
#include <BRepBuilderAPI_MakeFace.hxx>
#include <BRepBuilderAPI_MakePolygon.hxx>
#include <BRepBuilderAPI_MakeSolid.hxx>
#include <BRepBuilderAPI_MakeWire.hxx>
#include <BRepBuilderAPI_Sewing.hxx>
#include <BRepFilletAPI_MakeFillet.hxx>
#include <BRepPrimAPI_MakeBox.hxx>
#include <BRepPrimAPI_MakeCylinder.hxx>
#include <BRepPrimAPI_MakePrism.hxx>
#include <BRepPrimAPI_MakeTorus.hxx>
#include <BRep_Builder.hxx>
#include <GeomAPI_Interpolate.hxx>
#include <Geom_BSplineCurve.hxx>
#include <TColgp_HArray1OfPnt.hxx>
#include <TopExp_Explorer.hxx>
#include <TopTools_ListOfShape.hxx>
#include <TopoDS.hxx>
#include <TopoDS_Compound.hxx>
#include <TopoDS_Edge.hxx>
#include <TopoDS_Face.hxx>
#include <algorithm>
#include <catch2/catch.hpp>
#include <fstream>
#include <functional>
#include <gp_Pln.hxx>
#include <numbers>
#include <numeric>
#include <regex>
#include <set>
#include <sstream>

#include "cad/brep_builder.h"
#include "cad/step_reader.h"
#include "cad_variants.h"
#include "core/errors.h"
#include "known_parts.h"

using namespace cadmorph;
using namespace cadmorph::testing;
using Catch::Matchers::Contains;
using Eigen::Vector2d;
using Eigen::Vector3d;

namespace {

/// Middle of a curve: mean of points along its edges.
Vector3d middle(const CadModel& model, CurveId curve) {
  constexpr int kSamples = 40;
  Vector3d sum = Vector3d::Zero();
  double weight = 0;
  for (const CurveLink& link : model.skeleton().curves[curve].links) {
    const CadEdge& e = model.edges()[link.edge];
    for (int i = 0; i < kSamples; ++i) {
      const double t = e.first + (e.last - e.first) * (i + 0.5) / kSamples;
      const CurvePoint p = model.evaluate_edge(link.edge, t);
      sum += p.dt.norm() * (e.last - e.first) * p.point;
      weight += p.dt.norm() * (e.last - e.first);
    }
  }
  return sum / weight;
}

template <class Id>
bool is_permutation(IdVector<Id, Id> map, std::size_t size) {
  std::sort(map.begin(), map.end());
  IdVector<Id, Id> all(size);
  std::iota(all.begin(), all.end(), Id(0));
  return map == all;
}

/// The solids, shells or faces of a shape, copied so that they share nothing.
TopoDS_Shape parts(const TopoDS_Shape& shape, TopAbs_ShapeEnum kind) {
  TopoDS_Compound all;
  BRep_Builder().MakeCompound(all);
  for (TopExp_Explorer it(shape, kind); it.More(); it.Next())
    BRep_Builder().Add(all, BRepBuilderAPI_Copy(it.Current()).Shape());
  return all;
}

/// Number of base entities whose counterpart is not at the image of their place.
int misplaced(const CadModel& base, const CadModel& variant, const TopologyMatch& match,
              const gp_Trsf& map) {
  int count = 0;
  const double near = 1e-6 * variant.diagonal();
  for (const CornerId c : match.corners.ids()) {
    const auto b = base.vertices()[base.skeleton().corners[c]].point;
    const auto v = variant.vertices()[variant.skeleton().corners[match.corners[c]]].point;
    count += (apply(map, b) - v).norm() > near;
  }
  for (const CurveId c : match.curves.ids())
    count +=
        (apply(map, middle(base, CurveId(c))) - middle(variant, match.curves[c])).norm() > near;
  return count;
}

std::vector<Vector2d> grid(int columns, int rows, double pitch) {
  std::vector<Vector2d> centres;
  for (int i = 0; i < columns; ++i)
    for (int j = 0; j < rows; ++j) centres.emplace_back((i + 0.5) * pitch, (j + 0.5) * pitch);
  return centres;
}

/// The cylinder face whose axis passes nearest to (x, y).
FaceId hole_at(const CadModel& model, const Vector2d& centre) {
  std::pair<double, FaceId> best{1e300, FaceId()};
  for (const FaceId f : model.faces().ids()) {
    const CadFace& face = model.faces()[f];
    if (face.type != SurfaceType::Cylinder) continue;
    const Vector2d a = face.lower, b{0.5 * (face.lower.x() + face.upper.x()), face.lower.y()};
    const Vector3d axis = 0.5 * (model.evaluate(f, a).point + model.evaluate(f, b).point);
    best = std::min(best, {(axis.head<2>() - centre).norm(), f});
  }
  return best.second;
}

TopoDS_Shape with_fillets(int count) {
  const TopoDS_Shape box = BRepPrimAPI_MakeBox(40, 30, 20).Solid();
  BRepFilletAPI_MakeFillet fillet(box);
  std::set<const void*> seen;
  for (TopExp_Explorer e(box, TopAbs_EDGE); e.More() && count > 0; e.Next())
    if (seen.insert(e.Current().TShape().get()).second && seen.size() % 5 == 1) {
      fillet.Add(3, TopoDS::Edge(e.Current()));
      --count;
    }
  return fillet.Shape();
}

std::string refusal(const CadModel& base, const CadModel& variant) {
  try {
    match_topology(base, variant);
  } catch (const TopologyError& error) {
    return error.what();
  }
  return "matched";
}

/// Names the faces of a STEP file in its order, by their numbers from 0.
void name_faces(const std::filesystem::path& path, const std::function<std::string(int)>& name) {
  std::ifstream in(path);
  std::stringstream text;
  text << in.rdbuf();
  const std::string old = text.str();
  const std::regex face("ADVANCED_FACE\\('[^']*'");
  std::ofstream out(path);
  int face_number = 0;
  std::size_t at = 0;
  for (std::sregex_iterator it(old.begin(), old.end(), face), end; it != end; ++it) {
    out << old.substr(at, static_cast<std::size_t>(it->position()) - at) << "ADVANCED_FACE('"
        << name(face_number++) << "'";
    at = static_cast<std::size_t>(it->position() + it->length());
  }
  out << old.substr(at);
}

gp_Trsf half_turn(double x, double y) {
  gp_Trsf turn;
  turn.SetRotation(gp_Ax1(gp_Pnt(x, y, 0), gp_Dir(0, 0, 1)), std::numbers::pi);
  return turn;
}

const std::vector<Vector2d> kFourHoles{{15, 15}, {15, 45}, {45, 15}, {45, 45}};

/// The plate with four holes and its image, with named faces, through STEP.
struct NamedPair {
  using Name = std::function<std::string(int)>;
  static CadModel named_plate(const gp_Trsf& map, const Name& name) {
    const TemporaryFile file(".step");
    write_step(file.path(), transformed(read_shape(model_file("shapes/plate_4_holes.step")), map));
    name_faces(file.path(), name);
    return read_step(file.path());
  }
  NamedPair(const gp_Trsf& map, const Name& base_name, const Name& variant_name)
      : base(named_plate({}, base_name)), variant(named_plate(map, variant_name)) {}
  CadModel base, variant;
};

}  // namespace

TEST_CASE("500 random shuffles and reversals of a part with 60 faces are all matched",
          "[cad][match]") {
  const TopoDS_Shape part = drilled_plate(180, 120, 12, 6, grid(9, 6, 20));
  const CadModel base = to_model(part);
  REQUIRE(base.faces().size() == 60);
  int wrong_faces = 0, wrong_others = 0;
  for (unsigned seed = 0; seed < 500; ++seed) {
    const Shuffled variant = shuffle(
        part, {.seed = seed, .has_reversed_planes = true, .has_reversed_edges = seed % 3 == 0});
    const CadModel model = to_model(variant.shape);
    const TopologyMatch match = match_topology(base, model);
    wrong_faces += match.faces != variant.faces;
    wrong_others += misplaced(base, model, match, {});
  }
  CHECK(wrong_faces == 0);
  CHECK(wrong_others == 0);
}

TEST_CASE(
    "a symmetric part turned by less than half its symmetry is matched to the nearest position",
    "[cad][match]") {
  const TopoDS_Shape part = drilled_plate(180, 120, 12, 6, grid(9, 6, 20));
  const CadModel base = to_model(part);
  const gp_Trsf map = similarity(0.3, 1.4, gp_Vec(-20, 10, 300));
  for (unsigned seed = 0; seed < 10; ++seed) {
    const Shuffled variant =
        shuffle(transformed(part, map),
                {.seed = seed, .has_reversed_planes = true, .has_reversed_edges = seed % 3 == 0});
    const CadModel model = to_model(variant.shape);
    const TopologyMatch match = match_topology(base, model);
    CHECK(match.faces == variant.faces);
    CHECK(misplaced(base, model, match, map) == 0);
  }
}

TEST_CASE("shapes match themselves in any order, entity by entity", "[cad][match]") {
  for (const std::string name : {"bracket", "plate_12_holes", "plate_4_holes", "stepped_shaft",
                                 "blade", "two_blocks", "sphere_in_box", "torus", "cone"})
    for (const unsigned seed : {11u, 12u, 13u}) {
      DYNAMIC_SECTION(name << ' ' << seed) {
        const TopoDS_Shape shape = read_shape(model_file("shapes/" + name + ".step"));
        const CadModel base = to_model(shape);
        const Shuffled shuffled =
            shuffle(shape, {.seed = seed, .has_reversed_planes = true, .has_reversed_edges = true});
        const CadModel variant = to_model(shuffled.shape);
        const TopologyMatch match = match_topology(base, variant);
        CHECK(match.faces == shuffled.faces);
        CHECK(is_permutation(match.curves, base.skeleton().curves.size()));
        CHECK(is_permutation(match.corners, base.skeleton().corners.size()));
        CHECK(misplaced(base, variant, match, {}) == 0);
        CHECK(match.is_congruent);
        CHECK(match.face_confidence.size() == match.faces.size());
        CHECK(match.curve_confidence.size() == match.curves.size());
        CHECK(match.corner_confidence.size() == match.corners.size());
        for (const std::vector<double>& all : std::initializer_list<std::vector<double>>{
                 match.face_confidence, match.curve_confidence, match.corner_confidence})
          for (const double confidence : all) {
            CHECK(confidence > 0);
            CHECK(confidence <= 1);
          }
      }
    }
}

TEST_CASE("equal holes are matched by position when they move and the operands change order",
          "[cad][match]") {
  const CadModel base = to_model(drilled_plate(60, 60, 10, 8, kFourHoles));
  std::vector<Vector2d> moved{{16, 17}, {13, 44}, {46, 14}, {44, 47}};
  std::vector<int> order{0, 1, 2, 3};
  do {
    std::vector<Vector2d> drilled;
    for (const int i : order) drilled.push_back(moved[i]);
    const CadModel variant = to_model(drilled_plate(62, 60, 11, 8.5, drilled));
    const TopologyMatch match = match_topology(base, variant);
    for (int i = 0; i < 4; ++i) {
      const FaceId from = hole_at(base, kFourHoles[i]), to = hole_at(variant, moved[i]);
      CHECK(match.faces[from] == to);
    }
  } while (std::next_permutation(order.begin(), order.end()));
}

TEST_CASE("rows of equal holes keep their neighbours when the part shears, bends or twists far",
          "[cad][match]") {
  const TopoDS_Shape plate = to_nurbs(drilled_plate(180, 120, 12, 6, grid(9, 6, 20)));
  const CadModel base = to_model(plate);
  // Holes move by several times their distance.
  const auto bend = [](const Vector3d& x) -> Vector3d {
    const double angle = x.x() / 90, radius = 140 + x.y();
    return {radius * std::sin(angle), radius * std::cos(angle), x.z() * (1 + x.x() / 200)};
  };
  const auto twist = [](const Vector3d& x) -> Vector3d {
    const double angle = x.x() / 120, y = x.y() - 60, z = x.z() - 6;
    return {1.2 * x.x(), y * std::cos(angle) - z * std::sin(angle),
            y * std::sin(angle) + z * std::cos(angle)};
  };
  const auto shear = [](const Vector3d& x) -> Vector3d {
    return {1.4 * x.x() + 0.5 * x.y(), 0.7 * x.y(), x.z() + 0.3 * x.x()};
  };
  const std::vector<std::pair<const char*, std::function<Vector3d(const Vector3d&)>>> maps{
      {"bent", bend}, {"twisted", twist}, {"sheared", shear}};
  for (const auto& [name, map] : maps)
    for (const unsigned seed : {1u, 2u}) {
      DYNAMIC_SECTION(name << ' ' << seed) {
        const Shuffled variant =
            shuffle(with_moved_poles(plate, map, 6), {.seed = seed, .has_reversed_edges = true});
        CHECK(match_topology(base, to_model(variant.shape)).faces == variant.faces);
        // Without a word from the parameters, which the conversion of the sheared part changes.
        if (name != std::string("sheared")) continue;
        const TopoDS_Shape analytic = drilled_plate(180, 120, 12, 6, grid(9, 6, 20));
        gp_GTrsf affine;
        for (int column = 1; column <= 3; ++column) {
          const Vector3d image = shear(Vector3d::Unit(column - 1));
          for (int row = 1; row <= 3; ++row) affine.SetValue(row, column, image[row - 1]);
        }
        const Shuffled sheared = shuffle(transformed(analytic, affine), {.seed = seed});
        CHECK(match_topology(to_model(analytic), to_model(sheared.shape)).faces == sheared.faces);
      }
    }
}

TEST_CASE("a part that changes in its own frame is matched in place", "[cad][match]") {
  // By the generator and the faces' places: the pipe's faces keep their numbers; of the bore's, the
  // wall (7) and the sides and ground of its keyway (6, 9, 8) come in another order.
  const std::vector<std::pair<std::string, std::vector<int>>> families{
      {"pipe", {0, 1, 2, 3, 4, 5, 6, 7}}, {"bore", {0, 1, 2, 3, 4, 7, 5, 8, 6, 9, 10, 11, 12}}};
  for (const auto& [family, known] : families)
    for (const std::string step : {"step05", "step10", "step20"}) {
      DYNAMIC_SECTION(family << ' ' << step) {
        const CadModel base = read_step(model_file(family + "/base.step"));
        const Shuffled variant =
            shuffle(read_shape(model_file(family + "/" + step + ".step")), {.seed = 3});
        IdVector<FaceId, FaceId> expected;
        for (const int f : known) expected.push_back(variant.faces[FaceId(f)]);
        CHECK(match_topology(base, to_model(variant.shape)).faces == expected);
      }
    }
}

TEST_CASE("a sheet in a plane is not turned over", "[cad][match]") {
  // An angle whose legs exchange their lengths: turned over, the one is the other.
  const auto angle = [](double along_x, double along_y, int first, bool is_reversed) {
    const gp_Pnt corners[] = {{0, 0, 0},   {along_x, 0, 0},  {along_x, 20, 0},
                              {20, 20, 0}, {20, along_y, 0}, {0, along_y, 0}};
    BRepBuilderAPI_MakePolygon wire;
    for (int i = 0; i < 6; ++i) wire.Add(corners[(first + i) % 6]);
    wire.Close();
    TopoDS_Shape face = BRepBuilderAPI_MakeFace(gp_Pln(), wire.Wire()).Face();
    if (is_reversed) face.Reverse();
    return face;
  };
  const CadModel base = to_model(angle(80, 100, 0, false));
  for (int first = 0; first < 6; ++first)
    for (const bool is_reversed : {false, true}) {
      INFO("from corner " << first << (is_reversed ? ", reversed" : ""));
      const CadModel variant = to_model(angle(100, 80, first, is_reversed));
      const TopologyMatch match = match_topology(base, variant);
      for (const CornerId c : match.corners.ids()) {
        const Vector3d from = base.vertices()[base.skeleton().corners[c]].point;
        const Vector3d to = variant.vertices()[variant.skeleton().corners[match.corners[c]]].point;
        CHECK((to - from).norm() <= 20 + 1e-9);
      }
    }
}

TEST_CASE("unique names in the STEP files decide before position does", "[cad][match]") {
  const NamedPair pair(
      half_turn(30, 30), [](int f) { return "side " + std::to_string(7 * f % 11); },
      [](int f) { return "side " + std::to_string(7 * f % 11); });
  IdVector<FaceId, FaceId> same;
  for (const FaceId f : pair.base.faces().ids()) same.push_back(f);
  CHECK(pair.base.faces()[FaceId(1)].name == "side 7");
  // The same set of points, each face opposite to where it was.
  CHECK(match_topology(pair.base, pair.variant).faces == same);
}

TEST_CASE("names that only number the faces of a file don't mislead", "[cad][match]") {
  const auto number = [](int f) { return "Face" + std::to_string(f + 1); };
  const NamedPair pair(half_turn(30, 30), number, number);
  const FaceId hole = hole_at(pair.base, kFourHoles[0]);
  CHECK(match_topology(pair.base, pair.variant).faces[hole] ==
        hole_at(pair.variant, kFourHoles[0]));
}

TEST_CASE("names that contradict the positions don't mislead", "[cad][match]") {
  std::vector<int> holes;
  const CadModel plate = read_step(model_file("shapes/plate_4_holes.step"));
  for (const FaceId f : plate.faces().ids())
    if (plate.faces()[f].type == SurfaceType::Cylinder) holes.push_back(f);
  REQUIRE(holes.size() == 4);
  const auto name = [](int f) { return "side " + std::to_string(7 * f % 11); };
  // Two holes have changed names: possible by adjacency, but nothing else moved.
  const NamedPair pair({}, name, [&](int f) {
    return name(f == holes[0] ? holes[1] : f == holes[1] ? holes[0] : f);
  });
  IdVector<FaceId, FaceId> same;
  for (const FaceId f : pair.base.faces().ids()) same.push_back(f);
  CHECK(match_topology(pair.base, pair.variant).faces == same);
}

TEST_CASE("pairs of a map file decide before position does", "[cad][match]") {
  const TopoDS_Shape plate = read_shape(model_file("shapes/plate_4_holes.step"));
  const CadModel base = to_model(plate), variant = to_model(transformed(plate, half_turn(30, 30)));
  const FaceId hole = hole_at(base, kFourHoles[0]);
  REQUIRE(hole >= 0);
  IdVector<FaceId, FaceId> same;
  for (const FaceId f : base.faces().ids()) same.push_back(f);
  // By position each hole meets the one opposite in the file's order.
  CHECK(match_topology(base, variant).faces[hole] != hole);
  MatchOptions options;
  for (int f = 0; f < static_cast<int>(same.size()); ++f)
    options.given_faces.emplace_back(f + 1, f + 1);
  const TopologyMatch match = match_topology(base, variant, options);
  CHECK(match.faces == same);
  CHECK(misplaced(base, variant, match, half_turn(30, 30)) == 0);
  CHECK(match.how == "map file");
}

TEST_CASE("impossible pairs of a map file are refused", "[cad][match][errors]") {
  const CadModel base = to_model(read_shape(model_file("shapes/bracket.step")));
  int plane = -1, cylinder = -1;
  for (const FaceId f : base.faces().ids())
    (base.faces()[f].wires.size() > 1 ? plane : cylinder) = f;
  REQUIRE(plane >= 0);
  REQUIRE(cylinder >= 0);
  MatchOptions options;
  options.given_faces = {{plane + 1, cylinder + 1}};
  CHECK_THROWS_AS(match_topology(base, base, options), TopologyError);
  options.given_faces = {{1, static_cast<int>(base.faces().size()) + 1}};
  CHECK_THROWS_AS(match_topology(base, base, options), Error);
  options.given_faces = {{0, 1}};
  CHECK_THROWS_AS(match_topology(base, base, options), Error);
}

TEST_CASE("a face map file is read with comments and a header", "[cad][match]") {
  const TemporaryFile file(".csv");
  std::ofstream(file.path()) << "base,variant\n1,4\n# a comment\n 2 , 3  # another\n\n10,11\n";
  const std::vector<std::pair<int, int>> expected{{1, 4}, {2, 3}, {10, 11}};
  CHECK(read_face_map(file.path()) == expected);
}

TEST_CASE("a bad face map file is refused with its line", "[cad][match][errors]") {
  const TemporaryFile file(".csv");
  CHECK_THROWS_AS(read_face_map(file.path()), IoError);
  std::ofstream(file.path()) << "1,2\n3,four\n";
  CHECK_THROWS_AS(read_face_map(file.path()), InvalidInputError);
  CHECK_THROWS_WITH(read_face_map(file.path()), Contains(":2"));
  std::ofstream(file.path()) << "1;2\n3,4\n";
  CHECK_THROWS_WITH(read_face_map(file.path()), Contains(":1"));
}

TEST_CASE("a face map that a spreadsheet saved is read", "[cad][match]") {
  const TemporaryFile file(".csv");
  const std::vector<std::pair<int, int>> expected = {{1, 2}, {3, 4}};
  for (const std::string header : {"", "base,variant\r\n"}) {
    std::ofstream(file.path()) << "\xEF\xBB\xBF" << header << "1,2\r\n3,4\r\n";
    CHECK(read_face_map(file.path()) == expected);
  }
}

TEST_CASE("an added hole is refused and named", "[cad][match][errors]") {
  const CadModel base = to_model(drilled_plate(60, 60, 10, 5, kFourHoles));
  auto centres = kFourHoles;
  centres.insert(centres.begin() + 2, Vector2d(30, 30));
  const CadModel variant = to_model(drilled_plate(60, 60, 10, 5, centres));
  const int added = hole_at(variant, {30, 30});
  CHECK_THROWS_AS(match_topology(base, variant), TopologyError);
  CHECK_THAT(refusal(base, variant), Contains("variant face " + std::to_string(added + 1) + " "));
  CHECK_THAT(refusal(base, variant), Contains("cylinder"));
  // The other way round a hole was removed.
  CHECK_THAT(refusal(variant, base), Contains("base face " + std::to_string(added + 1) + " "));
}

TEST_CASE("a round feature in place of a flat one is refused", "[cad][match][errors]") {
  struct Hole {
    Vector2d corner;
    bool is_round = false;
  };
  // With three walls each: a prism's, or a quarter of a cylinder's.
  const auto punched = [](const std::vector<Hole>& holes) {
    // No square: turned by a quarter, the holes would be in their places.
    TopoDS_Shape plate = BRepPrimAPI_MakeBox(75, 60, 10).Solid();
    for (const auto& [corner, is_round] : holes) {
      const gp_Pnt at(corner.x(), corner.y(), -1);
      const TopoDS_Face floor =
          BRepBuilderAPI_MakeFace(BRepBuilderAPI_MakePolygon(at, at.Translated(gp_Vec(8, 0, 0)),
                                                             at.Translated(gp_Vec(0, 8, 0)), true)
                                      .Wire())
              .Face();
      plate =
          BRepAlgoAPI_Cut(plate, is_round ? BRepPrimAPI_MakeCylinder(gp_Ax2(at, gp_Dir(0, 0, 1)), 8,
                                                                     12, std::numbers::pi / 2)
                                                .Shape()
                                          : BRepPrimAPI_MakePrism(floor, gp_Vec(0, 0, 12)).Shape());
    }
    return to_model(plate);
  };
  const CadModel base = punched({{{10, 26}}, {{42, 26}}});
  CHECK_NOTHROW(match_topology(base, punched({{{26, 10}}, {{26, 42}}})));
  const CadModel variant = punched({{{26, 10}}, {{26, 42}, true}});
  REQUIRE(variant.faces().size() == base.faces().size());
  CHECK_THAT(refusal(base, variant), Contains("of other kinds"));
  // In its place it is the same feature of another shape.
  CHECK_NOTHROW(match_topology(base, punched({{{10, 26}}, {{42, 26}, true}})));
}

TEST_CASE("a feature that went to another face is refused, and the faces named",
          "[cad][match][errors]") {
  // A boss at the end of a channel, or under it.
  const auto channel = [](const gp_Ax2& boss) {
    const TopoDS_Shape cut =
        BRepAlgoAPI_Cut(BRepPrimAPI_MakeBox(40, 30, 20).Solid(),
                        BRepPrimAPI_MakeBox(gp_Pnt(-1, 10, 12), 42, 10, 10).Solid());
    return to_model(BRepAlgoAPI_Fuse(cut, BRepPrimAPI_MakeCylinder(boss, 3, 5)));
  };
  const CadModel at_end = channel({{40, 15, 6}, {1, 0, 0}}),
                 below = channel({{20, 15, 0}, {0, 0, -1}});
  REQUIRE(at_end.faces().size() == below.faces().size());
  CHECK_NOTHROW(match_topology(at_end, channel({{40, 15, 7}, {1, 0, 0}})));
  const std::string text = refusal(at_end, below);
  CHECK_THAT(text, Contains("The counts agree but faces are connected differently: base face ") &&
                       Contains("with 9 edges") && Contains("with 8 edges") &&
                       Contains("variant face ") && Contains("with 5 edges"));
  CHECK_THAT(text, !Contains("; and "));
}

TEST_CASE("a removed solid is refused and named", "[cad][match][errors]") {
  const auto bars = [](const std::vector<int>& places) {
    TopoDS_Compound all;
    BRep_Builder builder;
    builder.MakeCompound(all);
    for (const int place : places)
      builder.Add(all, BRepPrimAPI_MakeBox(gp_Pnt(10.0 * place, 0, 0), 4, 3, 2).Shape());
    return to_model(all);
  };
  const CadModel base = bars({0, 1, 2, 3}), variant = bars({0, 1, 3});
  CHECK_THAT(refusal(base, variant), Contains("4 solids"));
  CHECK_THAT(refusal(base, variant), Contains("base solid 3 (6 faces, about 22 1.5 1 mm)"));
  CHECK_THAT(refusal(variant, base), Contains("variant solid 3 (6 faces, about 22 1.5 1 mm)"));
}

TEST_CASE("a removed fillet is refused and named", "[cad][match][errors]") {
  const CadModel base = to_model(with_fillets(2)), variant = to_model(with_fillets(1));
  REQUIRE(base.faces().size() == variant.faces().size() + 1);
  CHECK_THROWS_AS(match_topology(base, variant), TopologyError);
  CHECK_THAT(refusal(base, variant), Contains("base face"));
  CHECK_THAT(refusal(base, variant), Contains("cylinder"));
}

TEST_CASE("faces that both exporters cut are merged with those that one of them cut",
          "[cad][match]") {
  // Two boxes side by side leave a cut through four sides of the one they make together.
  const TopoDS_Shape left = BRepPrimAPI_MakeBox(20, 20, 20).Solid();
  const TopoDS_Shape right = BRepPrimAPI_MakeBox(gp_Pnt(20, 0, 0), gp_Pnt(50, 20, 20)).Solid();
  const TopoDS_Shape joined = BRepAlgoAPI_Fuse(left, right).Shape();
  const TopoDS_Shape pin = BRepPrimAPI_MakeCylinder(gp_Ax2(gp_Pnt(50, 10, 10), gp::DX()), 5, 8);
  const TopoDS_Shape whole = BRepAlgoAPI_Fuse(joined, pin).Shape();
  const CadModel plain = to_model(whole), cut = to_model(with_cut_faces(whole));
  REQUIRE(plain.faces().size() == 6 + 4 + 2);
  REQUIRE(cut.faces().size() == plain.faces().size() + 1);
  const MatchedModels merged = match_models(plain, cut);
  CHECK(merged.base.faces().size() == 8);
  CHECK(merged.base.merged_face_count() == 4);
  CHECK(merged.variant.merged_face_count() == 5);
  CHECK(merged.match.faces == match_topology(merged.base, merged.variant).faces);
}

TEST_CASE("pieces of an opened cylinder are merged wherever its seam lies", "[cad][match]") {
  const KnownPart& part = known_part("split_ring");
  Sizes sizes = part.sizes;
  for (const double seam : {0.0, 0.8, 2.8, 4.4}) {
    CAPTURE(seam);
    sizes["seam"] = seam;
    const TopoDS_Shape ring = part.make(sizes).shape;
    for (const CadModel& model : {to_model(ring), through_step(ring)}) {
      REQUIRE(model.faces().size() == 9);
      const auto merged = model.with_merged_faces(FaceMerge::AcrossSeams);
      REQUIRE(merged);
      CHECK(merged->faces().size() == 7);
      CHECK((merged->lower() - model.lower()).norm() < 0.05);
      CHECK((merged->upper() - model.upper()).norm() < 0.05);
      CHECK(merged->solid_count() == 1);
    }
  }
}

TEST_CASE("a joint that turns by a little more is a corner in both models, or in none",
          "[cad][match]") {
  // A prism over an oval, one closed edge that turns at its only vertex.
  const auto oval = [](double turn_deg) {
    constexpr int kPoints = 16;
    const auto along = [](double angle) { return gp_Vec(-std::sin(angle), std::cos(angle), 0); };
    Handle(TColgp_HArray1OfPnt) points = new TColgp_HArray1OfPnt(1, kPoints + 1);
    for (int i = 0; i <= kPoints; ++i) {
      const double angle = i % kPoints * 2 * std::numbers::pi / kPoints;
      points->SetValue(i + 1, gp_Pnt(20 * std::cos(angle), 12 * std::sin(angle), 0));
    }
    GeomAPI_Interpolate curve(points, false, 1e-6);
    const double half = turn_deg / 2 * std::numbers::pi / 180;
    curve.Load(along(half), along(-half));
    curve.Perform();
    const TopoDS_Edge edge = BRepBuilderAPI_MakeEdge(curve.Curve());
    const TopoDS_Face face =
        BRepBuilderAPI_MakeFace(gp_Pln(), BRepBuilderAPI_MakeWire(edge).Wire());
    return to_model(BRepPrimAPI_MakePrism(face, gp_Vec(0, 0, 5)).Shape());
  };
  REQUIRE(oval(19).skeleton().corners.empty());
  REQUIRE(oval(21).skeleton().corners.size() == 2);
  for (const auto& [from, to] : {std::pair(19., 21.), {21., 19.}, {0., 60.}}) {
    CAPTURE(from, to);
    const CadModel base = oval(from);
    const MatchedModels matched = match_models(base, oval(to));
    CHECK(matched.match.corners.size() == base.skeleton().corners.size());
    CHECK(matched.variant.skeleton().corners.size() == base.skeleton().corners.size());
    CHECK(matched.variant.faces().size() == 3);
  }
}

TEST_CASE("faces of the parts of an assembly are merged where these are placed", "[cad][match]") {
  const KnownPart& part = known_part("split_ring");
  const TopoDS_Shape ring = part.make(part.sizes).shape;
  const gp_Trsf place = similarity(0.7, 1, gp_Vec(100, 20, 30));
  TopoDS_Compound both;
  BRep_Builder builder;
  builder.MakeCompound(both);
  builder.Add(both, ring);
  builder.Add(both, ring.Moved(TopLoc_Location(place)));
  for (const CadModel& model : {to_model(both), through_step(both)}) {
    REQUIRE(model.faces().size() == 18);
    const auto merged = model.with_merged_faces(FaceMerge::AcrossSeams);
    REQUIRE(merged);
    CHECK(merged->faces().size() == 14);
    CHECK(merged->solid_count() == 2);
    CHECK((merged->lower() - model.lower()).norm() < 0.05);
    CHECK((merged->upper() - model.upper()).norm() < 0.05);
  }
}

TEST_CASE("pieces of a bend, closed the other way, are merged", "[cad][match]") {
  const auto bend = [](double start) {
    gp_Ax2 axes(gp_Pnt(), gp::DZ());
    axes.Rotate(gp::OZ(), start);
    return BRepPrimAPI_MakeTorus(axes, 30, 8, 0.8).Solid();
  };
  const CadModel model = to_model(BRepAlgoAPI_Fuse(bend(0), bend(0.8)).Shape());
  REQUIRE(model.faces().size() == 4);
  const auto merged = model.with_merged_faces();
  REQUIRE(merged);
  CHECK(merged->faces().size() == 3);
  CHECK((merged->upper() - model.upper()).norm() < 1e-3);
}

TEST_CASE("a whole sphere or torus that was cut becomes one face again", "[cad][match]") {
  for (const std::string name : {"sphere_in_box", "torus"}) {
    INFO(name);
    const TopoDS_Shape shape = read_shape(model_file("shapes/" + name + ".step"));
    const CadModel whole = to_model(shape), cut = through_step(with_cut_faces(shape));
    REQUIRE(cut.faces().size() > whole.faces().size());
    const auto merged = cut.with_merged_faces(FaceMerge::AcrossSeams);
    REQUIRE(merged);
    CHECK(merged->faces().size() == whole.faces().size());
    CHECK(merged->solid_count() == whole.solid_count());
    for (const auto& [base, variant] : {std::pair{&whole, &cut}, std::pair{&cut, &whole}})
      CHECK(match_models(*base, *variant).match.faces.size() == whole.faces().size());
  }
}

TEST_CASE("merged faces leave the names of the others", "[cad][match]") {
  const TopoDS_Shape whole = read_shape(model_file("shapes/stepped_shaft.step"));
  int count = 0;
  const auto name = [&](const TopoDS_Face&) { return "face " + std::to_string(++count); };
  const CadModel cut = build_model(with_cut_faces(whole), {"memory", "MM", name});
  const auto merged = cut.with_merged_faces();
  REQUIRE(merged);
  for (const CadFace& face : merged->faces())
    CHECK(face.name.empty() == (face.type != SurfaceType::Plane));
}

TEST_CASE("a change of the topology is no matter of merging", "[cad][match][errors]") {
  const CadModel base = to_model(BRepPrimAPI_MakeBox(40, 30, 20).Solid());
  const CadModel drilled = to_model(drilled_plate(40, 30, 20, 3, {{10, 10}}));
  CHECK_FALSE(base.with_merged_faces());
  CHECK_THROWS_AS(match_models(base, drilled), TopologyError);
}

TEST_CASE("the shells of solids match them", "[cad][match]") {
  for (const std::string name : {"bracket", "two_blocks", "sphere_in_box"}) {
    const TopoDS_Shape solids = read_shape(model_file("shapes/" + name + ".step"));
    const TopoDS_Shape shells = parts(solids, TopAbs_SHELL);
    INFO(name);
    CHECK(match_topology(to_model(solids), through_step(shells)).faces ==
          match_topology(to_model(solids), through_step(solids)).faces);
    CHECK_NOTHROW(match_topology(to_model(shells), to_model(solids)));
  }
}

TEST_CASE("faces that are not joined are refused with the remedy", "[cad][match][errors]") {
  const TopoDS_Shape solid = read_shape(model_file("shapes/bracket.step"));
  const CadModel base = to_model(solid), loose = to_model(parts(solid, TopAbs_FACE));
  CHECK_THROWS_WITH(match_topology(base, through_step(parts(solid, TopAbs_FACE))),
                    Contains("The faces of the variant are not joined along"));
  CHECK_THROWS_WITH(match_topology(loose, base), Contains("The faces of the base are not joined"));
  CHECK_NOTHROW(match_topology(loose, loose));
}

TEST_CASE("equal counts with another adjacency are refused", "[cad][match][errors]") {
  const auto drill = [](const TopoDS_Shape& shape, const gp_Pnt& at, const gp_Dir& along) {
    return BRepAlgoAPI_Cut(shape, BRepPrimAPI_MakeCylinder(gp_Ax2(at, along), 2, 100).Solid())
        .Shape();
  };
  const TopoDS_Shape box = BRepPrimAPI_MakeBox(40, 30, 20).Solid();
  const TopoDS_Shape once = drill(box, gp_Pnt(10, 10, -1), gp_Dir(0, 0, 1));
  const CadModel parallel = to_model(drill(once, gp_Pnt(30, 20, -1), gp_Dir(0, 0, 1)));
  const CadModel crossed = to_model(drill(once, gp_Pnt(30, -1, 10), gp_Dir(0, 1, 0)));
  REQUIRE(parallel.faces().size() == crossed.faces().size());
  REQUIRE(parallel.edges().size() == crossed.edges().size());
  CHECK_THROWS_AS(match_topology(parallel, crossed), TopologyError);
  CHECK_THAT(refusal(parallel, crossed), Contains("face"));
}

namespace {

/// A motor: coils, magnets of a width, turned by an angle, shaft, rotor, gap and stator, which
/// touch, each with faces of its own. The numbers of the magnets and coils in the order of the
/// file.
CadModel motor(double width, double turn, const std::array<int, 10>& order) {
  TopTools_ListOfShape bodies;
  const auto add_box = [&](double from, double depth, double wide, double angle) {
    gp_Trsf about_z;
    about_z.SetRotation(gp_Ax1(gp_Pnt(0, 0, 0), gp_Dir(0, 0, 1)), angle);
    bodies.Append(transformed(
        BRepPrimAPI_MakeBox(gp_Pnt(from, -wide / 2, 0), gp_Pnt(from + depth, wide / 2, 10)).Solid(),
        about_z));
  };
  for (const int k : order)
    k < 4 ? add_box(12, 3, width, turn + k * std::numbers::pi / 2)
          : add_box(23, 8, 5, k * std::numbers::pi / 3);
  for (const double radius : {5, 20, 21, 38})
    bodies.Append(BRepPrimAPI_MakeCylinder(radius, 10).Solid());
  BRepAlgoAPI_BuilderAlgo fragments;
  fragments.SetArguments(bodies);
  fragments.Build();
  TopoDS_Compound apart;
  BRep_Builder builder;
  builder.MakeCompound(apart);
  for (TopExp_Explorer solid(fragments.Shape(), TopAbs_SOLID); solid.More(); solid.Next())
    builder.Add(apart, BRepBuilderAPI_Copy(solid.Current()).Shape());
  return to_model(apart);
}

}  // namespace

TEST_CASE("bodies that stay are matched in place while others turn and change",
          "[cad][match][resting]") {
  const CadModel base = motor(10, 0, {0, 1, 2, 3, 4, 5, 6, 7, 8, 9});
  const auto& corners = base.skeleton().corners;
  for (const double turn : {0.1, 0.2, 0.25, -0.2, 0.3}) {
    CAPTURE(turn);
    const CadModel variant = motor(11, turn, {7, 2, 4, 0, 9, 3, 8, 5, 1, 6});
    const TopologyMatch match = match_topology(base, variant);
    int of_coils = 0;
    for (const CornerId c : corners.ids()) {
      const Vector3d at = base.vertices()[corners[c]].point;
      if (at.head<2>().norm() < 22) continue;
      const VertexId partner = variant.skeleton().corners[match.corners[c]];
      CHECK((variant.vertices()[partner].point - at).norm() < 1e-6);
      ++of_coils;
    }
    CHECK(of_coils == 2 * 6 * 8);
  }
}

TEST_CASE("a sliver that the variant alone has is taken for a point", "[cad][match][sliver]") {
  // A roof with a ridge; without one, a pyramid.
  const auto roof = [](double ridge) {
    const gp_Pnt a(0, 0, 0), b(10, 0, 0), c(10, 8, 0), d(0, 8, 0), e(5, 4, 6), f(5 + ridge, 4, 6);
    BRepBuilderAPI_Sewing sewing(1e-7);
    const auto add = [&](const std::vector<gp_Pnt>& corners) {
      BRepBuilderAPI_MakePolygon outline;
      for (const gp_Pnt& corner : corners) outline.Add(corner);
      outline.Close();
      sewing.Add(BRepBuilderAPI_MakeFace(outline.Wire()).Shape());
    };
    add({d, c, b, a});
    add({d, a, e});
    add({b, c, f});
    if (ridge == 0) {
      add({a, b, e});
      add({c, d, e});
    } else {
      add({a, b, f, e});
      add({c, d, e, f});
    }
    sewing.Perform();
    TopExp_Explorer shell(sewing.SewedShape(), TopAbs_SHELL);
    return to_model(BRepBuilderAPI_MakeSolid(TopoDS::Shell(shell.Current())).Shape());
  };
  const CadModel pyramid = roof(0), sliver = roof(0.005);
  const MatchedModels matched = match_models(pyramid, sliver);
  CHECK(matched.base.edges_as_points() == 0);
  CHECK(matched.variant.edges_as_points() == 1);
  CHECK(sliver.skeleton().curves.size() == 9);
  CHECK(matched.variant.skeleton().curves.size() == 8);
  CHECK(matched.variant.skeleton().corners.size() == 5);
  for (const FaceId face : matched.match.faces.ids()) {
    const auto middle = [&](const CadModel& model, FaceId f) {
      const CadFace& of = model.faces()[f];
      return model.evaluate(f, (of.lower + of.upper) / 2).point;
    };
    const FaceId image = matched.match.faces[face];
    CHECK((middle(pyramid, face) - middle(sliver, image)).norm() < 0.01);
  }
  CHECK_THROWS_AS(match_models(sliver, pyramid), TopologyError);  // a mesh has nodes on it
  CHECK_THROWS_AS(match_models(pyramid, roof(0.1)), TopologyError);
}
