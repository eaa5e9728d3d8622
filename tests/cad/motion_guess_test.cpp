#include "cad/motion_guess.h"

#include <BRepPrimAPI_MakeBox.hxx>
#include <Eigen/Dense>
#include <catch2/catch.hpp>
#include <cmath>
#include <gp_Pnt.hxx>
#include <numbers>
#include <string>

#include "cad_variants.h"
#include "point_graph.h"

using namespace cadmorph;
using namespace cadmorph::testing;
using Eigen::AngleAxisd;
using Eigen::Matrix3d;
using Eigen::Vector3d;
using std::numbers::pi;
using Map = std::function<Vector3d(const Vector3d&)>;

namespace {

constexpr double kExact = 1e-9;  // of places some tens large
// Patterns are taken for a ten-thousandth of their size thicker than they are, in squares.
constexpr double kPatternExact = 1e-6;

CadModel box(const Vector3d& lower, const Vector3d& upper) {
  const auto at = [](const Vector3d& x) { return gp_Pnt(x.x(), x.y(), x.z()); };
  return to_model(BRepPrimAPI_MakeBox(at(lower), at(upper)).Shape());
}

const CadModel& base_box() {
  static const CadModel model = box({-10, -10, -10}, {10, 10, 10});
  return model;
}

std::vector<Vector3d> scattered(int count, unsigned seed = 8) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> unit(-10, 10);
  std::vector<Vector3d> points;
  for (int i = 0; i < count; ++i) {
    const double x = unit(random), y = unit(random), z = unit(random);
    points.emplace_back(x, 0.6 * y, 0.3 * z);
  }
  return points;
}

std::vector<Vector3d> images(const std::vector<Vector3d>& points, const Map& map) {
  std::vector<Vector3d> moved;
  for (const Vector3d& x : points) moved.push_back(map(x));
  return moved;
}

/// A known motion: turned by `angle`, then `scale` times as large.
Similarity known(double angle, double scale = 1) {
  Similarity s;
  s.scale = scale;
  s.rotation = AngleAxisd(angle, Vector3d(1, 2, -1).normalized()).toRotationMatrix();
  s.translation = Vector3d(15, -4, 6);
  return s;
}

/// A graph without symmetry: a path with a foot, and a tail.
GraphEdges telling(int count) {
  GraphEdges edges{{1, 3}};
  for (int n = 1; n < count; ++n) edges.emplace_back(n - 1 - (n == 3), n);
  return edges;
}

/// The guesses for nodes that moved, under other numbers.
std::vector<NamedGuess> guesses(const GraphEdges& edges, const std::vector<Vector3d>& from,
                                const std::vector<Vector3d>& to, const CadModel& to_model,
                                double scale = 1) {
  const auto count = static_cast<int>(from.size());
  const Permutation number = any_permutation(from.size(), 4);
  std::vector<double> sizes, to_sizes;
  for (int n = 0; n < count; ++n) sizes.push_back(1 + 0.1 * n);
  for (const double size : sizes) to_sizes.push_back(scale * size);
  const MatchSide base = point_graph(base_box(), edges, from, sizes),
                  variant = point_graph(to_model, renamed(edges, number), rearranged(to, number),
                                        rearranged(to_sizes, number));
  ColourRefinement colours(base.graph, variant.graph);
  REQUIRE(colours.refine());
  return first_guesses(base, variant, colours);
}

/// How far a guess is from a map at places, at most.
double error(const NamedGuess& guess, const Map& map, const std::vector<Vector3d>& places) {
  double most = 0;
  for (const Vector3d& x : places) most = std::max(most, (guess.motion.motion(x) - map(x)).norm());
  return most;
}

int count_of(const std::vector<NamedGuess>& all, const Map& map, double tolerance,
             const std::vector<Vector3d>& places) {
  return static_cast<int>(std::ranges::count_if(
      all, [&](const NamedGuess& guess) { return error(guess, map, places) < tolerance; }));
}

}  // namespace

TEST_CASE("boxes are carried onto each other by their middles and diagonals", "[cad][guess]") {
  const Vector3d lower(1, 2, 3), upper(5, 4, 9), shift(10, -20, 7);
  const CadModel from = box(lower, upper);
  const Similarity grown = align_bounds(from, box(3 * lower + shift, 3 * upper + shift));
  for (const Vector3d& x : {lower, upper, Vector3d(0, -7, 2)})
    CHECK((grown(x) - (3 * x + shift)).norm() < 1e-5);  // bounds take tolerances in
  const Similarity same = align_bounds(from, from);
  CHECK(same.scale == 1);
  CHECK(same.translation.norm() == 0);
}

TEST_CASE("places that the topology tells apart give their motion away", "[cad][guess]") {
  const auto points = scattered(8), elsewhere = scattered(20, 5);
  // A change of parameters hardly turns a part by 0.3 radians.
  for (const auto& [angle, how] : {std::pair(0.25, kInPlace), {0.35, kTurned}, {2.8, kTurned}}) {
    INFO(angle);
    const Similarity motion = known(angle, 1.5);
    const auto all = guesses(telling(8), points, images(points, motion), base_box(), 1.5);
    REQUIRE(all.size() == 8);  // nothing is alike: no pattern has a spread
    CHECK(error(
              all[0], [](const Vector3d& x) { return x; }, elsewhere) == 0);
    CHECK(error(all[1], align_bounds(base_box(), base_box()), elsewhere) == 0);
    for (const int i : {2, 3}) {
      CHECK(error(all[i], motion, elsewhere) < kExact);
      CHECK(all[i].motion.scale == Approx(1.5));
    }
    CHECK(std::string(all[2].how) == how);
  }
  // An affine change, but for what a millionth of the scatter lets the similarity have.
  const Map sheared = [](const Vector3d& x) -> Vector3d {
    return {1.2 * x.x() + 0.4 * x.z(), 0.7 * x.y(), 1.1 * x.z() + 3};
  };
  const auto all = guesses(telling(8), points, images(points, sheared), base_box());
  CHECK(error(all[2], sheared, elsewhere) < 1e-3);
  CHECK(error(all[3], sheared, elsewhere) > 0.1);
}

TEST_CASE("where the topology tells nothing apart there are no guesses by it", "[cad][guess]") {
  const auto two = scattered(2);
  const auto all = guesses({{0, 1}}, two, images(two, known(1)), base_box());
  CHECK(all.size() == 6);  // in place, by bounds, and four by principal axes
}

TEST_CASE("principal axes recover any rigid motion of unlike places", "[cad][guess]") {
  const auto points = scattered(12), elsewhere = scattered(20, 5);
  for (const double angle : {0.0, 0.4, 1.9, 3.1}) {
    INFO(angle);
    const Similarity motion = known(angle, 2);
    const CadModel to = box({-20, -20, -20}, {20, 20, 20});
    // All places are alike: their adjacency is a ring's.
    GraphEdges edges;
    for (int n = 0; n < 12; ++n) edges.emplace_back(n, (n + 1) % 12);
    const auto all = guesses(edges, points, images(points, motion), to, 2);
    REQUIRE(all.size() >= 7);
    const std::vector<NamedGuess> axes(all.end() - 4, all.end());
    CHECK(count_of(axes, motion, 1e-5, elsewhere) == 1);
    for (const NamedGuess& guess : axes) {
      Matrix3d linear;
      for (int a = 0; a < 3; ++a)
        linear.col(a) = guess.motion.motion(Vector3d::Unit(a)) - guess.motion.motion({0, 0, 0});
      CHECK(linear.determinant() == Approx(8));
      CHECK((linear.transpose() * linear).isApprox(4 * Matrix3d::Identity(), 1e-6));
    }
  }
}

TEST_CASE("a pattern whose pitches change goes where its spread goes", "[cad][guess]") {
  // Of all maps with the same effect on the spread the symmetric one moves least: this is one.
  Matrix3d stretch;
  stretch << 1.6, 0.3, 0, 0.3, 0.8, 0.1, 0, 0.1, 1.2;
  const Vector3d shift(3, 1, -5);
  const Map map = [&](const Vector3d& x) -> Vector3d { return stretch * x + shift; };
  const auto points = scattered(9);
  const auto all = guesses({}, points, images(points, map), base_box());
  REQUIRE(all.size() >= 7);
  CHECK(error(all[2], map, points) < kPatternExact);
  CHECK(all[2].how == kInPlace);
}

TEST_CASE("a pattern that turns goes by the least turn that lays it onto itself", "[cad][guess]") {
  struct Case {
    int spokes;
    double turned, expected;  // degrees
  };
  // Spokes of real parts are a little off. Exact fits differ by rounding alone.
  const double off = GENERATE(0.0, 1e-3);
  for (const Case& c : {Case{6, 50, -10}, {6, 25, 25}, {5, 60, -12}, {4, 40, 40}, {3, -100, 20}}) {
    INFO(c.spokes << " by " << c.turned);
    std::vector<Vector3d> points;
    for (int i = 0; i < c.spokes; ++i)
      points.emplace_back(5 * std::cos(2 * pi * i / c.spokes), 5 * std::sin(2 * pi * i / c.spokes),
                          0);
    const Vector3d at(20, -3, 4);
    for (Vector3d& x : points) x += at;
    const auto turn = [&](double degrees) {
      return Map([=](const Vector3d& x) -> Vector3d {
        return at + AngleAxisd(degrees * pi / 180, Vector3d::UnitZ()) * (x - at);
      });
    };
    auto places = images(points, turn(c.turned));
    for (int i = 0; i < c.spokes; ++i) places[i].z() += i % 2 == 0 ? off : -off;
    const MatchSide base = point_graph(base_box(), {}, points),
                    variant = point_graph(base_box(), {}, places);
    ColourRefinement colours(base.graph, variant.graph);
    REQUIRE(colours.refine());
    const auto all = first_guesses(base, variant, colours);
    REQUIRE(all.size() == 8);
    CHECK(error(all[3], turn(c.expected), points) < 3 * off + 1e-9);
    CHECK(all[3].how == kTurned);
    // Where nothing turned there is no such guess.
    const MatchSide still = point_graph(base_box(), {}, points);
    CHECK(first_guesses(base, still, ColourRefinement(base.graph, still.graph)).size() == 7);
  }
}

TEST_CASE("an irregular pattern turns as most of its members say", "[cad][guess]") {
  std::vector<Vector3d> most = scattered(11);
  for (Vector3d& x : most) x.z() = 0;
  std::vector<Vector3d> points = most;
  points.emplace_back(12, 1, 0);  // the farthest out
  for (const double angle : {-2.2, 0.6, 3.0}) {
    INFO(angle);
    const Map turn = [&](const Vector3d& x) -> Vector3d {
      return AngleAxisd(angle, Vector3d::UnitZ()) * x + Vector3d(3, 3, 3);
    };
    auto places = images(points, turn);
    // It alone goes 0.6 aside, by a twentieth of its distance.
    places.back() += AngleAxisd(angle, Vector3d::UnitZ()) * Vector3d(0, 0.6, 0);
    const MatchSide base = point_graph(base_box(), {}, points),
                    variant = point_graph(base_box(), {}, places);
    const ColourRefinement colours(base.graph, variant.graph);
    const auto all = first_guesses(base, variant, colours);
    REQUIRE(all.size() == 8);
    CHECK(error(all[3], turn, most) < 0.3);
  }
}
