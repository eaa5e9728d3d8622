#include "cad/match_search.h"

#include <BRepPrimAPI_MakeBox.hxx>
#include <Eigen/Geometry>
#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>
#include <set>

#include "cad_variants.h"
#include "point_graph.h"

using namespace cadmorph;
using namespace cadmorph::testing;
using Eigen::AngleAxisd;
using Eigen::Vector3d;
using std::numbers::pi;

namespace {

constexpr int kEnough = 1000;  // refinements

/// A graph with all its nodes alike, and places that show it.
struct Shape {
  const char* name;
  GraphEdges edges;
  std::vector<Vector3d> points;
  std::size_t symmetries;  // the order of its group
};

GraphEdges ring(int first, int count) {
  GraphEdges edges;
  for (int i = 0; i < count; ++i) edges.emplace_back(first + i, first + (i + 1) % count);
  return edges;
}

Vector3d on_circle(double part, double radius = 1, double z = 0) {
  return {radius * std::cos(2 * pi * part), radius * std::sin(2 * pi * part), z};
}

Shape hexagon() {
  Shape s{"hexagon", ring(0, 6), {}, 12};
  for (int i = 0; i < 6; ++i) s.points.push_back(on_circle(i / 6.));
  return s;
}

Shape cube() {
  Shape s{"cube", {}, {}, 48};
  for (int n = 0; n < 8; ++n) {
    s.points.emplace_back(n & 1, (n >> 1) & 1, n >> 2);
    for (const int bit : {1, 2, 4})
      if (!(n & bit)) s.edges.emplace_back(n, n | bit);
  }
  return s;
}

Shape petersen() {
  Shape s{"Petersen's graph", ring(0, 5), {}, 120};
  for (int i = 0; i < 5; ++i) {
    s.edges.emplace_back(i, i + 5);
    s.edges.emplace_back(5 + i, 5 + (i + 2) % 5);
  }
  for (int i = 0; i < 10; ++i) s.points.push_back(on_circle(i / 5., i < 5 ? 2 : 1, i < 5 ? 0 : 1));
  return s;
}

const CadModel& any_model() {
  static const CadModel box = to_model(BRepPrimAPI_MakeBox(1, 1, 1).Shape());
  return box;
}

std::vector<Vector3d> shaken(std::vector<Vector3d> points, double amount, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> any(-amount, amount);
  for (Vector3d& x : points)
    for (int a = 0; a < 3; ++a) x[a] += any(random);
  return points;
}

MotionGuess in_place() {
  return {[](const Vector3d& x) { return x; }, 1};
}

/// What each node of the base became; empty where the search says no.
Permutation found(const MatchSide& base, const MatchSide& variant,
                  const MotionGuess& guess = in_place(), int most = kEnough) {
  ColourRefinement colours(base.graph, variant.graph);
  if (!colours.refine()) return {};
  const auto decided = decide_by_closeness(base, variant, colours, guess, most);
  if (!decided) return {};
  Permutation result;
  for (const int colour : decided->base_colours()) {
    const auto& others = decided->variant_colours();
    CHECK(std::ranges::count(others, colour) == 1);
    result.push_back(static_cast<int>(std::ranges::find(others, colour) - others.begin()));
  }
  return result;
}

}  // namespace

TEST_CASE("the search finds each symmetry of a graph that its places show, whatever the order",
          "[cad][search]") {
  for (const Shape& shape : {hexagon(), cube(), petersen()}) {
    const int count = static_cast<int>(shape.points.size());
    const auto symmetries = isomorphisms(count, shape.edges, shape.edges);
    REQUIRE(symmetries.size() == shape.symmetries);
    const MatchSide base = point_graph(any_model(), shape.edges, shape.points);
    unsigned seed = 0;
    std::size_t right = 0;
    for (const Permutation& symmetry : symmetries) {
      // The node that takes the place of n, under another number.
      const Permutation number = any_permutation(shape.points.size(), ++seed);
      Permutation expected;
      for (const int n : symmetry) expected.push_back(number[n]);
      const auto places = rearranged(shaken(shape.points, 0.1, seed), expected);
      const MatchSide variant = point_graph(any_model(), renamed(shape.edges, number), places);
      right += found(base, variant) == expected;
    }
    INFO(shape.name);
    CHECK(right == symmetries.size());
  }
}

TEST_CASE("the search finds the nearest of all isomorphisms where that is clear", "[cad][search]") {
  // Places that move by up to half an edge: many a node comes nearest to a wrong one.
  int asked = 0, misled = 0;
  for (const Shape& shape : {hexagon(), cube(), petersen()}) {
    const int count = static_cast<int>(shape.points.size());
    const auto all = isomorphisms(count, shape.edges, shape.edges);
    const MatchSide base = point_graph(any_model(), shape.edges, shape.points);
    for (unsigned seed = 1; seed <= 100; ++seed) {
      const auto places = shaken(shape.points, 0.5, seed);
      std::vector<std::pair<double, const Permutation*>> ranked;
      for (const Permutation& p : all) {
        double sum = 0;
        for (int n = 0; n < count; ++n) sum += (shape.points[n] - places[p[n]]).squaredNorm();
        ranked.emplace_back(sum, &p);
      }
      std::ranges::sort(ranked);
      if (ranked[0].first > 0.5 * ranked[1].first) continue;
      ++asked;
      for (int n = 0; n < count; ++n) {
        const auto distance = [&](int v) { return (shape.points[n] - places[v]).norm(); };
        const Permutation& best = *ranked[0].second;
        const int nearest = std::ranges::min(best, {}, distance);
        if (nearest != best[n] && ++misled) break;
      }
      INFO(shape.name << ", seed " << seed);
      CHECK(found(base, point_graph(any_model(), shape.edges, places)) == *ranked[0].second);
    }
  }
  CHECK(asked > 100);
  CHECK(misled > 10);
}

TEST_CASE("the search follows its guess", "[cad][search]") {
  // A hexagon that turned by 170 degrees seems to have gone by 180 where it is; the guess knows.
  const Shape shape = hexagon();
  const AngleAxisd turn(170 * pi / 180, Vector3d::UnitZ());
  std::vector<Vector3d> places;
  for (const Vector3d& x : shape.points) places.emplace_back(2 * (turn * x));
  const MatchSide base = point_graph(any_model(), shape.edges, shape.points),
                  variant =
                      point_graph(any_model(), shape.edges, places, std::vector<double>(6, 2));
  CHECK(found(base, variant) == Permutation{3, 4, 5, 0, 1, 2});
  const MotionGuess known{[&](const Vector3d& x) -> Vector3d { return 2 * (turn * x); }, 2};
  CHECK(found(base, variant, known) == Permutation{0, 1, 2, 3, 4, 5});
}

TEST_CASE("sizes tell what lies at one place apart, as large as the guess makes them",
          "[cad][search]") {
  const std::vector<Vector3d> places(3, Vector3d(1, 2, 3));
  const MatchSide base = point_graph(any_model(), {}, places, {2, 4, 8}),
                  variant = point_graph(any_model(), {}, places, {16, 8, 4});
  const MotionGuess doubled{[](const Vector3d& x) { return x; }, 2};
  CHECK(found(base, variant, doubled) == Permutation{2, 1, 0});
}

TEST_CASE("what is decided tells where the rest goes", "[cad][search]") {
  // A path that its foot decides, with twins at each node, grows to four times its length: where
  // they are the twins seem to have changed places with others.
  GraphEdges edges{{1, 8}};
  std::vector<Vector3d> from, to;
  for (int n = 0; n < 8; ++n) {
    if (n > 0) edges.emplace_back(n - 1, n);
    from.emplace_back(n, (n * n) % 5, n % 3);
  }
  from.emplace_back(2, -1, 1);
  for (int n = 0; n < 8; ++n)
    for (const double side : {-0.2, 0.2}) {
      edges.emplace_back(n, static_cast<int>(from.size()));
      from.emplace_back(from[n] + Vector3d(side, 0.5, 0));
    }
  for (const Vector3d& x : from) to.emplace_back(4 * x.x() - 40, x.y(), x.z());
  const Permutation number = any_permutation(from.size(), 3);
  CHECK(found(point_graph(any_model(), edges, from),
              point_graph(any_model(), renamed(edges, number), rearranged(to, number))) == number);
}

TEST_CASE("what lies far from all that is decided is decided late", "[cad][search]") {
  // Beads on a string that is pulled the more, the farther out: the first seven are known, and
  // what they tell of the last ones is wrong by more than a bead.
  const GraphEdges known{{0, 1}, {1, 2}, {2, 3}, {1, 4}, {0, 5}, {5, 6}};
  std::vector<Vector3d> from, to;
  for (int n = 0; n < 24; ++n) from.emplace_back(n, 0, 0);
  for (const Vector3d& x : from) to.emplace_back(x.x() + 0.006 * x.x() * x.x(), 0, 0);
  const Permutation number = any_permutation(from.size(), 9);
  CHECK(found(point_graph(any_model(), known, from),
              point_graph(any_model(), renamed(known, number), rearranged(to, number))) == number);
}

TEST_CASE("all that is clear is decided at once", "[cad][search]") {
  // Forty alike stay, and two that lie close together move by half of their distance.
  std::vector<Vector3d> from;
  for (int n = 0; n < 40; ++n) from.emplace_back(n % 7, n / 7, n % 3);
  from.emplace_back(20, 0, 0);
  from.emplace_back(20.1, 0, 0);
  auto to = from;
  to[40].x() += 0.05;
  to[41].x() += 0.05;
  const Permutation number = any_permutation(from.size(), 2);
  const MatchSide base = point_graph(any_model(), {}, from),
                  variant = point_graph(any_model(), {}, rearranged(to, number));
  CHECK(found(base, variant, in_place(), 3) == number);
}

TEST_CASE("a place that contradicts the adjacency gives way to the next one", "[cad][search]") {
  // A hexagon and two triangles that seem to have changed places: to refinement all nodes are
  // alike.
  GraphEdges edges = ring(0, 6);
  for (const int first : {6, 9})
    for (const auto& edge : ring(first, 3)) edges.push_back(edge);
  std::vector<Vector3d> from, to(12);
  for (int n = 0; n < 12; ++n) from.push_back(on_circle(n / 6.) + Vector3d(n < 6 ? 0 : 9, 0, 0));
  for (int n = 0; n < 12; ++n) to[n] = from[(n + 6) % 12] + Vector3d(0.01 * n, 0.02 * n, 0);
  const auto all = isomorphisms(12, edges, edges);
  REQUIRE(all.size() == 12 * 72);
  const Permutation result =
      found(point_graph(any_model(), edges, from), point_graph(any_model(), edges, to));
  CHECK(std::ranges::count(all, result) == 1);
}

TEST_CASE("the search says no where no isomorphism is, or where it may not look", "[cad][search]") {
  // Refinement alone takes two triangles for a hexagon.
  const Shape shape = hexagon();
  GraphEdges triangles = ring(0, 3);
  for (const auto& edge : ring(3, 3)) triangles.push_back(edge);
  REQUIRE(isomorphisms(6, shape.edges, triangles).empty());
  const MatchSide whole = point_graph(any_model(), shape.edges, shape.points),
                  parts = point_graph(any_model(), triangles, shape.points);
  REQUIRE(ColourRefinement(whole.graph, parts.graph).refine());
  CHECK(found(whole, parts).empty());
  CHECK(found(parts, whole).empty());
  CHECK(found(whole, whole, in_place(), 0).empty());
  // Of a path with a foot nothing is open.
  const GraphEdges path{{0, 1}, {1, 2}, {2, 3}, {1, 4}, {4, 5}, {5, 6}};
  const auto places = shaken(std::vector<Vector3d>(7, Vector3d::Zero()), 1, 5);
  const MatchSide rigid = point_graph(any_model(), path, places);
  REQUIRE(isomorphisms(7, path, path).size() == 1);
  CHECK(found(rigid, rigid, in_place(), 0) == Permutation{0, 1, 2, 3, 4, 5, 6});
}

TEST_CASE("classes are the orbits of a tree, the open ones those of several", "[cad][search]") {
  // A root with two arms of two and a third of one.
  const GraphEdges tree{{0, 1}, {1, 2}, {0, 3}, {3, 4}, {0, 5}};
  const Permutation number{5, 3, 0, 1, 4, 2};
  const std::vector<Vector3d> places(6, Vector3d::Zero());
  const MatchSide base = point_graph(any_model(), tree, places),
                  variant = point_graph(any_model(), renamed(tree, number), places);
  ColourRefinement colours(base.graph, variant.graph);
  REQUIRE(colours.refine());
  using Members = std::pair<std::vector<int>, std::vector<int>>;
  const auto as_set = [](const std::vector<ColourClass>& classes) {
    std::set<Members> result;
    for (const ColourClass& c : classes) result.emplace(c.base, c.variant);
    return result;
  };
  const Members arms{{1, 3}, {1, 3}}, ends{{2, 4}, {0, 4}};
  CHECK(as_set(open_classes(colours, 6)) == std::set<Members>{arms, ends});
  CHECK(as_set(classes_of(colours, 6)) ==
        std::set<Members>{arms, ends, Members{{0}, {5}}, Members{{5}, {2}}});
}

TEST_CASE("the nearest members are those of all members compared", "[cad][search]") {
  const EntityFeature feature{Vector3d(9, 9, 9), 1.5};
  const Vector3d at(1, 2, 2);
  // 1^2 + 2^2 + 2^2, and sizes 3 and 7 differ by 4.
  CHECK(squared_distance(feature, {Vector3d::Zero(), 7}, at, 2) == 25);
  for (const std::size_t count : {5, 48, 49, 300}) {  // beside and beyond the tree's least
    INFO(count);
    const auto places = shaken(std::vector<Vector3d>(2 * count, Vector3d::Zero()), 10, 7);
    std::vector<double> sizes;
    for (const Vector3d& x : places) sizes.push_back(std::abs(x.x() * x.y()));
    const MatchSide variant = point_graph(any_model(), {}, places, sizes);
    std::vector<int> members;  // each second node
    for (std::size_t n = 0; n < places.size(); n += 2) members.push_back(static_cast<int>(n));
    std::vector<std::pair<double, int>> all;
    for (const int n : members)
      all.emplace_back((places[n] - at).squaredNorm() + std::pow(2 * 1.5 - sizes[n], 2), n);
    std::ranges::sort(all);
    const auto nearest = NearestMembers(variant, members).find(feature, at, 2, 12);
    REQUIRE(nearest.size() == std::min<std::size_t>(count, 12));
    for (std::size_t i = 0; i < nearest.size(); ++i) {
      CHECK(nearest[i].second == all[i].second);
      CHECK(nearest[i].first == Approx(all[i].first));
    }
  }
}
