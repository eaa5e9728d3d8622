#include "cad/match_choice.h"

#include <BRepPrimAPI_MakeBox.hxx>
#include <Eigen/Geometry>
#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>

#include "cad/match_cost.h"
#include "cad/match_search.h"
#include "cad_variants.h"
#include "point_graph.h"

using namespace cadmorph;
using namespace cadmorph::testing;
using Eigen::Vector2d;
using Eigen::Vector3d;

namespace {

using FacePairs = std::vector<std::pair<FaceId, FaceId>>;

TopoDS_Shape box(double x, double y, double z) { return BRepPrimAPI_MakeBox(x, y, z).Shape(); }

/// Two models that are matched.
struct Sides {
  explicit Sides(const TopoDS_Shape& from, const TopoDS_Shape& to)
      : models{to_model(from), to_model(to)},
        base(make_match_side(models.first, {})),
        variant(make_match_side(models.second, {})),
        colours(base.graph, variant.graph) {
    REQUIRE(colours.refine());
  }
  Sides(const Sides&) = delete;

  /// The match with these faces become those, rated; nothing where there is none.
  std::optional<TopologyMatch> match(const FacePairs& faces) const {
    ColourRefinement decided = colours;
    for (const auto& [b, v] : faces) decided.individualise(b, v);
    if (!decided.refine() || !open_classes(decided, base.graph.entity_count()).empty())
      return std::nullopt;
    TopologyMatch result = to_match(base, decided);
    rate(base, variant, result);
    return result;
  }

  /// The match that keeps all faces.
  TopologyMatch identity() const {
    FacePairs same;
    for (const FaceId f : models.first.faces().ids()) same.emplace_back(f, f);
    return match(same).value();
  }

  std::pair<CadModel, CadModel> models;
  MatchSide base, variant;
  ColourRefinement colours;
};

/// All matches of two boxes, by where two faces at an edge go.
std::vector<TopologyMatch> all_matches(const Sides& boxes) {
  std::vector<TopologyMatch> all;
  for (FaceId f(0); f < 6; ++f)
    for (FaceId g(0); g < 6; ++g)
      if (auto match = boxes.match({{FaceId(0), f}, {FaceId(2), g}})) all.push_back(*match);
  return all;
}

double bits(double x, double unit) { return std::log2(1 + x / unit); }

/// A fabricated match of that cost.
TopologyMatch of_cost(double deformation, const char* how, int first_face) {
  TopologyMatch match;
  match.faces.push_back(FaceId(first_face));
  match.how = how;
  match.cost.deformation = deformation;
  return match;
}

/// The corners of an icosahedron round a place: each direction counts alike.
std::vector<Vector3d> icosahedron(const Vector3d& middle) {
  std::vector<Vector3d> points;
  for (const double a : {-1.0, 1.0})
    for (const double b : {-std::numbers::phi, std::numbers::phi})
      for (int axis = 0; axis < 3; ++axis) {
        Vector3d x = Vector3d::Zero();
        x[axis] = a;
        x[(axis + 1) % 3] = b;
        points.push_back(middle + x);
      }
  return points;
}

}  // namespace

// The terms are those of the table in docs/cad-and-surface.md.

TEST_CASE("of all matches of a part with itself the identity alone costs nothing",
          "[cad][choice]") {
  for (const double z : {4.0, 2.0}) {
    const Sides s(box(2, z == 4 ? 3 : 2, z), box(2, z == 4 ? 3 : 2, z));
    const auto all = all_matches(s);
    CHECK(all.size() == 24);  // the turns of a cube
    const TopologyMatch same = s.identity();
    CHECK(same.cost.sum() == 0);
    CHECK(fits_exactly(same));
    for (const TopologyMatch& match : all) {
      if (match.faces == same.faces) continue;
      CHECK(match.cost.sum() > 40);
      CHECK(cheaper(match, same)->faces == same.faces);
      CHECK(cheaper(same, match)->faces == same.faces);
    }
    CHECK(match_by_position(s.base, s.variant, s.colours)->faces == same.faces);
  }
}

TEST_CASE("a part that moves and grows as a whole costs nothing", "[cad][choice]") {
  const TopoDS_Shape part = box(2, 3, 4);
  const Sides s(part, transformed(part, similarity(2.2, 25.4, {7, -3, 90})));
  const TopologyMatch same = s.identity();
  CHECK(same.is_congruent);
  CHECK(same.cost.sum() == 0);
  CHECK(same.alignment.scale == Approx(25.4));
}

TEST_CASE("a match costs the same in any order of the variant's entities", "[cad][choice]") {
  const TopoDS_Shape changed = box(2.2, 3, 4.5);
  const Sides s(box(2, 3, 4), changed);
  for (const unsigned seed : {3, 4}) {
    const Shuffled other = shuffle(changed, {.seed = seed});
    const Sides t(box(2, 3, 4), other.shape);
    for (const TopologyMatch& match : all_matches(s)) {
      FacePairs pairs;
      for (const FaceId f : match.faces.ids()) pairs.emplace_back(f, other.faces[match.faces[f]]);
      const auto same = t.match(pairs);
      REQUIRE(same);
      CHECK(same->cost.sum() - same->cost.order ==
            Approx(match.cost.sum() - match.cost.order).epsilon(1e-9));
    }
    const auto best = match_by_position(t.base, t.variant, t.colours);
    CHECK(best->faces == other.faces);
  }
}

TEST_CASE("a cube that becomes twice as long costs what the closed forms say", "[cad][choice]") {
  const Sides s(box(1, 1, 1), box(2, 1, 1));
  const TopologyMatch match = s.identity();
  // The best similarity is 4/3 times as large. It misses the squares of corners by 1/6, of edges
  // along by 1/2, of those across by 1/4, lengths and all; the diagonal's is 6.
  const double d = std::sqrt((8 / 6. + 4 / 2. + 8 / 4.) / 20 / 6);
  CHECK(match.alignment.scale == Approx(4 / 3.));
  CHECK(match.cost.deformation == Approx(bits(d, 1e-3) + 30 * d).epsilon(1e-6));
  // A third of the edges are a bit longer.
  CHECK(match.cost.lengths == Approx(bits(std::sqrt(2.) / 3, 0.02)).epsilon(1e-6));
  // Each use of an edge by a face lies elsewhere, as part of all lengths.
  CHECK(match.cost.parameters == Approx(4 * bits(24, 1)));
  CHECK(match.cost.neighbours < 0.01);  // an affine change
  for (const double term : {match.cost.turn, match.cost.rest, match.cost.passing, match.cost.order})
    CHECK(term == 0);
  CHECK_FALSE(fits_exactly(match));
  CHECK(fits_exactly(Sides(box(1, 1, 1), box(1 + 8e-6, 1, 1)).identity()));
  CHECK_FALSE(fits_exactly(Sides(box(1, 1, 1), box(1 + 1e-3, 1, 1)).identity()));
}

TEST_CASE("an exact turn that leaves the parameters costs its way and what it takes from rest",
          "[cad][choice]") {
  const Sides s(box(2, 3, 4), box(2, 3, 4));
  const auto face = [](int f) { return FaceId(f); };
  const auto turned = s.match({{face(0), face(1)}, {face(2), face(3)}});  // by pi about z
  REQUIRE(turned);
  // Each of the 26 entities moves by twice its distance from the axis, faces about their middles
  // by 2 / pi of their areas besides, squares on the mean; the diagonal's is 29.
  const double squares = 4 * (8 * 3.25 + 4 * (3.25 + 2.25 + 1) + 2 * (1 + 2.25)),
               areas = 2 * (6 + 8 + 12);
  const double d = std::sqrt((squares + areas * 2 / std::numbers::pi) / 26 / 29);
  CHECK(turned->cost.turn == Approx(6 * bits(d, 0.2)).epsilon(1e-4));
  CHECK(turned->cost.parameters == Approx(4 * bits(6, 1)));
  CHECK(turned->cost.rest == Approx(8 * bits(6, 1)));
  CHECK(turned->cost.order == 1);
  CHECK(turned->cost.deformation + turned->cost.neighbours + turned->cost.passing == 0);
  // A cube's turn by pi / 2 about x is dearer so than as a change of design without a turn.
  const Sides cube(box(2, 2, 2), box(2, 2, 2));
  const auto quarter = cube.match({{face(0), face(0)}, {face(2), face(4)}});
  REQUIRE(quarter);
  const double way = std::sqrt((8 * 4 + 4 * 4 + 8 * 2) / 20. / 12);
  CHECK(quarter->cost.deformation == Approx(bits(way, 1e-3) + 30 * way).epsilon(1e-6));
  CHECK(quarter->cost.turn + quarter->cost.rest == 0);
}

TEST_CASE("holes that change places cost what the closed forms say", "[cad][choice]") {
  const TopoDS_Shape plate = drilled_plate(60, 20, 5, 2, {{10, 10}, {20, 10}, {30, 10}});
  const Sides s(plate, plate);
  FacePairs others;
  std::vector<FaceId> holes;  // along x
  const auto& faces = s.models.first.faces();
  for (const FaceId f : faces.ids())
    if (faces[f].type == SurfaceType::Cylinder)
      holes.push_back(f);
    else
      others.emplace_back(f, f);
  std::ranges::sort(holes, {}, [&](FaceId f) { return s.base.features[f].centre.x(); });
  const auto match = [&](std::vector<int> images) {
    FacePairs pairs = others;
    for (int i = 0; i < 3; ++i) pairs.emplace_back(holes[i], holes[images[i]]);
    return s.match(pairs).value();
  };
  CHECK(match({0, 1, 2}).cost.sum() == 0);
  const TopologyMatch swapped = match({1, 0, 2});
  const MatchCost& cost = swapped.cost;
  // Four rims of 26 corners and curves move by 10.
  const double d =
      std::sqrt(4 * 100 / 26. / s.models.second.diagonal() / s.models.second.diagonal());
  CHECK(cost.deformation == Approx(bits(d, 1e-3) + 30 * d).epsilon(1e-6));
  CHECK(cost.passing == Approx(4 * bits(2, 1)));
  CHECK(cost.parameters == Approx(4 * bits(4, 1)));  // the rims on top and bottom
  CHECK(cost.order == 1);
  CHECK(cost.lengths + cost.turn + cost.rest == Approx(0).margin(1e-9));
  // Of the neighbours' motion: see entity_motion_test.cpp.
  std::vector<Vector3d> from, to;
  for (int n = 0; n < s.base.graph.entity_count(); ++n) {
    const bool is_face = n < s.base.graph.faces;
    const bool is_curve = !is_face && n < s.base.graph.faces + s.base.graph.curves;
    const int image = is_face ? int(swapped.faces[s.base.graph.face(n)])
                      : is_curve
                          ? s.base.graph.curve_node(swapped.curves[s.base.graph.curve(n)])
                          : s.base.graph.corner_node(swapped.corners[s.base.graph.corner(n)]);
    from.push_back(s.base.features[n].centre);
    to.push_back(s.variant.features[image].centre);
  }
  const EntityMotion motion(fit_affine(from, to, {}), from, to, 40);
  double sum = 0;
  for (int n = 0; n < std::ssize(from); ++n) {
    const double off = (motion(from[n], n) - to[n]).norm() / s.models.second.diagonal();
    sum += 0.5 * (bits(off, 1e-4) + 20 * off);
  }
  CHECK(cost.neighbours == Approx(sum / double(from.size())).epsilon(1e-3));
  // One that jumps over the two others passes through them; these follow each other.
  CHECK(match({1, 2, 0}).cost.passing == Approx(4 * bits(1, 1)));
  const auto best = match_by_position(s.base, s.variant, s.colours);
  CHECK(best->faces == match({0, 1, 2}).faces);
}

TEST_CASE("holes that move by less than half their distance go to the nearest, all in all",
          "[cad][choice]") {
  const std::vector<Vector2d> holes{{10, 10}, {21, 12}, {33, 9}, {45, 14}, {52, 8}};
  std::mt19937 random(6);
  std::uniform_real_distribution<double> any(-2.5, 2.5);
  for (unsigned trial = 1; trial <= 3; ++trial) {
    std::vector<Vector2d> moved = holes;
    for (Vector2d& at : moved)
      for (double& x : at) x += any(random);
    moved = rearranged(moved, any_permutation(5, trial));
    const Sides s(drilled_plate(60, 20, 5, 1.5, holes), drilled_plate(60, 20, 5, 1.5, moved));
    std::vector<int> best, images{0, 1, 2, 3, 4};
    double least = 1e300;
    do {
      double sum = 0;
      for (int i = 0; i < 5; ++i) sum += (holes[i] - moved[images[i]]).squaredNorm();
      if (sum < least) best = images, least = sum;
    } while (std::ranges::next_permutation(images).found);
    const auto match = match_by_position(s.base, s.variant, s.colours);
    REQUIRE(match);
    int checked = 0;
    for (const FaceId f : match->faces.ids())
      for (int i = 0; i < 5; ++i) {
        const auto& at = s.base.features[f].centre;
        if (s.models.first.faces()[f].type != SurfaceType::Cylinder ||
            (at.head<2>() - holes[i]).norm() > 0.5)
          continue;
        const auto& to = s.variant.features[match->faces[f]].centre;
        CHECK((to.head<2>() - moved[best[i]]).norm() < 0.5);
        ++checked;
      }
    CHECK(checked == 5);
  }
}

TEST_CASE("of two matches the cheaper is taken, the next one is its runner-up", "[cad][choice]") {
  const auto a = of_cost(1, "a", 0), b = of_cost(2, "b", 1), c = of_cost(3, "c", 2);
  CHECK_FALSE(cheaper(std::nullopt, std::nullopt));
  CHECK(cheaper(std::nullopt, b)->how == "b");
  CHECK(cheaper(b, std::nullopt)->how == "b");
  for (const auto& best : {cheaper(cheaper(a, b), c), cheaper(cheaper(c, b), a),
                           cheaper(b, cheaper(a, c)), cheaper(cheaper(b, c), a)}) {
    CHECK(best->how == "a");
    REQUIRE(best->runner_up);
    CHECK(best->runner_up->how == "b");
    CHECK(lead(*best) == 1);
  }
  // The same match found twice is no other one.
  CHECK_FALSE(cheaper(a, of_cost(2, "again", 0))->runner_up);
  auto joined = of_cost(2, "joined", 0);
  joined.joins_edges = true;
  joined.curves.push_back(CurveId(0));
  CHECK_FALSE(cheaper(a, joined)->runner_up);
  // Of equals the lesser turn, then the lesser shift.
  auto turned = of_cost(0, "turned", 1), far = of_cost(1, "far", 2), near = of_cost(1, "near", 3);
  turned.cost.turn = 1;
  far.alignment.translation = Vector3d(0, 0, 5);
  near.alignment.translation = Vector3d(4, 0, 0);
  for (const auto& best : {cheaper(turned, far), cheaper(far, turned)}) CHECK(best->how == "far");
  for (const auto& best : {cheaper(near, far), cheaper(far, near)}) CHECK(best->how == "near");
}

TEST_CASE("confidence is how much farther the nearest other possibility lies", "[cad][choice]") {
  // Two alike, each amid a body of its own that stays.
  const Vector3d a(0, 0, 0), b(100, 20, -30);
  std::vector<Vector3d> points = icosahedron(a);
  for (const Vector3d& x : icosahedron(b)) points.push_back(x);
  const int first = static_cast<int>(points.size());
  points.push_back(a);
  points.push_back(b);
  const CadModel any = to_model(box(1, 1, 1));
  const MatchSide base = point_graph(any, {}, points);
  struct Case {
    Vector3d a, b;  // where they go
    double confidence_a, confidence_b;
  };
  const Vector3d x(1, 0, 0), y(0, 3, 0);
  for (const Case& c : {Case{a, b, 1, 1},
                        {a + x, y, 3. / 4, (b - x).norm() / ((b - x).norm() + (b - y).norm())},
                        {y, x, 1. / 4, (b - y).norm() / ((b - x).norm() + (b - y).norm())},
                        {a, a, 1. / 2, 1. / 2},
                        {b, a, 0, 0}}) {
    auto to = points;
    to[first] = c.a;
    to[first + 1] = c.b;
    const MatchSide variant = point_graph(any, {}, to);
    ColourRefinement colours(base.graph, variant.graph);
    TopologyMatch match;
    for (int n = 0; n < std::ssize(points); ++n) match.faces.push_back(FaceId(n));
    for (int n = 0; n < first; ++n) colours.individualise(n, n);
    REQUIRE(colours.refine());
    set_confidence(base, variant, colours, match);
    for (int n = 0; n < first; ++n) CHECK(match.face_confidence[FaceId(n)] == 1);
    CHECK(match.face_confidence[FaceId(first)] == Approx(c.confidence_a).margin(1e-9));
    CHECK(match.face_confidence[FaceId(first + 1)] == Approx(c.confidence_b).margin(1e-9));
  }
}
