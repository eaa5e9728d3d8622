#include <cadmorph/cadmorph.h>

#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <map>

#include "workplace.h"

namespace cadmorph {
namespace {

using namespace testing;
using Catch::Matchers::Contains;

CadModel cad(const std::string& name) { return CadModel::from_step(model(name + ".step")); }

// The bore's base is its step 5, so that it has models of both signs.
struct Bore {
  explicit Bore(const MorphOptions& options = {}) : morpher(base, mesh_of(base), options) {}

  static Mesh mesh_of(const CadModel& cad_model) {
    const Mesh mesh = Mesh::read(model("bore/hex.vtu"));
    const Morpher to(cad("bore/base"), mesh, {.quality = Quality::Fast});
    return mesh.at(to.morph(cad_model).positions());
  }

  Points start() const { return morpher.mesh().points()(morpher.surface_nodes(), Eigen::all); }

  CadModel base = cad("bore/step05");
  ParameterPair pair{cad("bore/step10"), cad("bore/base"), 0.25};
  Morpher morpher;
};

RowMatrix noise(Index rows, Index columns, double seed) {
  RowMatrix result(rows, columns);
  for (Index i = 0; i < result.size(); ++i)
    result.data()[i] = std::sin(seed + 1e3 * static_cast<double>(i * i % 100'003));
  return result;
}

double dot(const RowMatrix& a, const RowMatrix& b) { return a.cwiseProduct(b).sum(); }

double largest(const RowMatrix& a) { return a.cwiseAbs().maxCoeff(); }

double farthest(const Points& motions) { return motions.rowwise().norm().maxCoeff(); }

}  // namespace

TEST_CASE("A derivative and its adjoint are transposes", "[library]") {
  for (const Solver solver : {Solver::Auto, Solver::Cholesky}) {
    const Bore bore({.solver = solver});
    const Velocity velocity = bore.morpher.velocity(bore.pair);
    const Derivative map = bore.morpher.derivative(bore.start() + 0.2 * velocity.surface());
    CHECK(map.node_count() == bore.morpher.mesh().node_count());
    CHECK(map.surface_count() == bore.start().rows());
    const RowMatrix moved = map.forward(velocity.surface());
    const RowMatrix by_nodes = noise(map.node_count(), 3, 1);
    CHECK(std::abs(dot(by_nodes, moved) - dot(map.adjoint(by_nodes), velocity.surface())) <
          1e-12 * by_nodes.norm() * moved.norm());
    CHECK(moved(bore.morpher.surface_nodes(), Eigen::all) == RowMatrix(velocity.surface()));
  }
}

TEST_CASE("A derivative is the slope of the warp", "[library]") {
  const Bore bore({.solver = Solver::Cholesky});  // no tolerance
  const Velocity velocity = bore.morpher.velocity(bore.pair);
  const RowMatrix slope = bore.morpher.derivative().forward(velocity.surface());
  const double size = bore.base.diagonal_mm();
  for (const double step : {1e-1, 1e-3}) {  // the warp is linear: rounding over the step is left
    const auto warped = [&](double h) {
      return bore.morpher.warp(bore.start() + h * velocity.surface());
    };
    CHECK(largest((warped(step) - warped(-step)) / (2 * step) - slope) < 1e-12 * size / step);
  }
}

TEST_CASE("Columns of a derivative may be any number", "[library]") {
  const Bore bore;
  const Derivative map = bore.morpher.derivative();
  const RowMatrix six = noise(map.surface_count(), 6, 2);
  const RowMatrix forward = map.forward(six);
  CHECK(forward.cols() == 6);
  CHECK(largest(forward.rightCols(2) - map.forward(six.rightCols(2))) < 1e-9);
  CHECK(map.adjoint(noise(map.node_count(), 1, 3)).cols() == 1);
  CHECK(map.forward(RowMatrix(map.surface_count(), 0)).cols() == 0);
}

TEST_CASE("A gradient is the sum of dJ/dX times the velocity of all nodes", "[library]") {
  const Bore bore;
  const RowMatrix slopes = noise(bore.morpher.mesh().node_count(), 3, 4);
  const ParameterPair turned{bore.pair.minus, bore.pair.plus, 0.5};
  const auto gradient = [&](const std::optional<CadModel>& present) {
    return bore.morpher.gradient(slopes, {{"change", bore.pair}, {"back", turned}},
                                 {.present = present});
  };
  const auto expected = [&](const std::optional<CadModel>& present) {
    const Velocity velocity = bore.morpher.velocity(bore.pair, {.present = present});
    return dot(slopes, velocity.nodes());
  };
  const double scale = slopes.norm() * bore.morpher.velocity(bore.pair).nodes().norm();
  const std::vector<ParameterGradient> at_base = gradient({});
  REQUIRE(at_base.size() == 2);
  CHECK(at_base[0].name == "change");
  CHECK(std::abs(at_base[0].gradient - expected({})) < 1e-12 * scale);
  CHECK(at_base[1].gradient == Approx(-0.5 * at_base[0].gradient).epsilon(1e-9));
  CHECK(at_base[0].motion_mm == Approx(0.25 * at_base[0].max_speed));
  const CadModel step10 = cad("bore/step10");
  CHECK(std::abs(gradient(step10)[0].gradient - expected(step10)) < 1e-12 * scale);
}

namespace {

// Hexahedra round the box of models/shapes, up to 37 times as far away as it is large.
Mesh far_box_mesh() {
  constexpr int kOut = 7;
  const std::array<int, 3> inside{4, 3, 2};
  std::array<std::vector<double>, 3> lines;
  for (int d = 0; d < 3; ++d) {
    for (int i = -kOut; i <= inside[d] + kOut; ++i) {
      const int out = std::max(-i, i - inside[d]);
      const double beyond = out > 0 ? 10 * (std::pow(1.8, out) - 1) / 0.8 : 0;
      lines[d].push_back(10 * std::clamp(i, 0, inside[d]) + (i < 0 ? -beyond : beyond));
    }
  }
  const auto count = [&](int d) { return static_cast<int>(lines[d].size()); };
  const auto is_inside = [&](int i, int d) { return i >= kOut && i < kOut + inside[d]; };
  constexpr std::array<std::array<int, 3>, 8> kCorners{
      {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}}};
  std::map<std::array<int, 3>, Index> ids;
  MeshArrays mesh{.points = {}, .types = {}, .offsets = {0}, .connectivity = {}};
  for (int i = 0; i + 1 < count(0); ++i)
    for (int j = 0; j + 1 < count(1); ++j)
      for (int k = 0; k + 1 < count(2); ++k) {
        if (is_inside(i, 0) && is_inside(j, 1) && is_inside(k, 2)) continue;
        for (const auto& [a, b, c] : kCorners)
          mesh.connectivity.push_back(
              ids.try_emplace({i + a, j + b, k + c}, std::ssize(ids)).first->second);
        mesh.offsets.push_back(std::ssize(mesh.connectivity));
        mesh.types.push_back(12);  // a hexahedron
      }
  mesh.points.resize(std::ssize(ids), 3);
  for (const auto& [at, node] : ids)
    mesh.points.row(node) << lines[0][at[0]], lines[1][at[1]], lines[2][at[2]];
  return Mesh(mesh);
}

// The box in a far field that stays, and how it grows.
struct FarBox {
  CadModel base = cad("shapes/box"), grown = cad("shapes/box_variant");
  Mesh mesh = far_box_mesh();
  Morpher morpher{base, mesh, {.unmatched = Unmatched::Fix, .quality = Quality::Fast}};
  ParameterPair pair{grown, base, 0.5};
  RowMatrix slopes = noise(mesh.node_count(), 3, 6);

  double gradient(const std::optional<CadModel>& present) const {
    return morpher.gradient(slopes, {{"size", pair}}, {.present = present})[0].gradient;
  }
};

}  // namespace

TEST_CASE("A gradient counts for the anchors that hold a motion in a far field", "[library]") {
  const FarBox far;
  const Velocity velocity = far.morpher.velocity(far.pair);
  CHECK(std::abs(far.gradient({}) - dot(far.slopes, velocity.nodes())) <
        1e-10 * far.slopes.norm() * velocity.nodes().norm());
}

TEST_CASE("About the base itself a velocity has the anchors of its motion", "[library]") {
  const FarBox far;
  const Velocity expected = far.morpher.velocity(far.pair);
  for (const CadModel& same : {far.base, cad("shapes/box")}) {
    const Velocity velocity = far.morpher.velocity(far.pair, {.present = same});
    CHECK(velocity.nodes() == expected.nodes());
    CHECK(far.gradient(same) == far.gradient({}));
    CHECK(farthest(velocity.nodes()) <= 1.21 * farthest(velocity.surface()));
  }
}

TEST_CASE("Linearised, morph, velocity, gradient and derivative agree in a far field",
          "[library]") {
  FarBox far;
  Morpher& morpher = far.morpher;
  const auto formula = [&](const Points& velocity) {
    return dot(morpher.derivative().adjoint(far.slopes), velocity);
  };
  const double scale = far.slopes.norm();
  {  // Before, the derivative at the base has no anchors.
    const Velocity velocity = morpher.velocity(far.pair);
    CHECK(std::abs(formula(velocity.surface()) - dot(far.slopes, velocity.nodes())) >
          1e-3 * scale * velocity.nodes().norm());
  }
  morpher.linearise({far.grown, far.base});
  const Velocity velocity = morpher.velocity(far.pair);
  const double size = velocity.nodes().norm();
  const double expected = dot(far.slopes, velocity.nodes());
  CHECK(std::abs(formula(velocity.surface()) - expected) < 1e-11 * scale * size);
  CHECK(std::abs(far.gradient({}) - expected) < 1e-11 * scale * size);
  CHECK(std::abs(far.gradient(far.grown) - expected) < 1e-11 * scale * size);
  const MorphResult grown = morpher.morph(far.grown);
  CHECK(largest(grown.positions() - far.mesh.points() - velocity.nodes()) < 1e-10 * size);
  CHECK(farthest(velocity.nodes()) <= 1.21 * farthest(velocity.surface()));
  CHECK(grown.report().is_plain);
}

TEST_CASE("A morph can't be linearised for nothing", "[library]") {
  FarBox far;
  CHECK_THROWS_WITH(far.morpher.linearise({}), Contains("no model is given"));
  CHECK_THROWS_WITH(far.morpher.linearise({far.base}), Contains("moves the surface of"));
  Morpher femwarp(far.base, far.mesh, {.method = Method::Femwarp});
  CHECK_THROWS_AS(femwarp.linearise({far.grown}), InvalidInputError);
  const Velocity velocity = far.morpher.velocity(far.pair);  // as before
  CHECK(farthest(velocity.nodes()) <= 1.21 * farthest(velocity.surface()));
}

TEST_CASE("A velocity about a variant is the slope of the warp there", "[library]") {
  const Bore bore({.quality = Quality::Fast});
  const CadModel step10 = cad("bore/step10");
  const Velocity velocity =
      bore.morpher.velocity({cad("bore/step20"), cad("bore/base"), 0.5}, {.present = step10});
  const Points present =
      bore.morpher.morph(step10).positions()(bore.morpher.surface_nodes(), Eigen::all);
  CHECK(largest(bore.morpher.derivative(present).forward(velocity.surface()) -
                RowMatrix(velocity.nodes())) < 1e-12 * largest(velocity.nodes()));
  // The bore turns: its nodes go round, midway by no more than so large a step bends.
  CHECK(velocity.unevenness() < 0.2);
  CHECK(velocity.errors().cols() == 0);
}

TEST_CASE("Two steps give the error of a velocity", "[library]") {
  const Bore bore;
  // One and the same pair as of half the step: its velocity is twice as large, for once.
  const Velocity wide = bore.morpher.velocity({bore.pair.plus, bore.pair.minus, 0.5});
  const Velocity both =
      bore.morpher.velocity({bore.pair.plus, bore.pair.minus, 0.5}, {.half = bore.pair});
  CHECK(largest(both.surface() - 7.0 / 3 * wide.surface()) < 1e-9 * largest(wide.surface()));
  CHECK(largest(both.errors() - wide.nodes().rowwise().norm() / 3) < 1e-9 * largest(wide.nodes()));
  CHECK_THROWS_AS(bore.morpher.velocity(bore.pair, {.half = bore.pair}), InvalidInputError);
}

TEST_CASE("What a derivative can't take is refused", "[library]") {
  const Bore bore;
  const Derivative map = bore.morpher.derivative();
  CHECK_THROWS_AS(map.forward(RowMatrix::Zero(map.surface_count() + 1, 3)), InvalidInputError);
  CHECK_THROWS_AS(map.adjoint(RowMatrix::Zero(map.surface_count(), 3)), InvalidInputError);
  RowMatrix slopes = RowMatrix::Zero(map.node_count(), 3);
  slopes(1, 1) = std::numeric_limits<double>::infinity();
  CHECK_THROWS_AS(map.adjoint(slopes), InvalidInputError);
  CHECK_THROWS_AS(bore.morpher.gradient(slopes, {{"change", bore.pair}}), InvalidInputError);
  CHECK_THROWS_AS(bore.morpher.gradient(RowMatrix::Zero(map.surface_count(), 3), {}),
                  InvalidInputError);
  CHECK_THROWS_AS(bore.morpher.warp(Points::Zero(3, 3)), InvalidInputError);
  CHECK_THROWS_AS(bore.morpher.derivative(Points::Zero(3, 3)), InvalidInputError);
  CHECK_THROWS_AS(bore.morpher.velocity({bore.pair.plus, bore.pair.minus, 0}), InvalidInputError);
  CHECK_THROWS_AS(bore.morpher.velocity({cad("shapes/box"), bore.pair.minus, 1}), TopologyError);
  const Morpher femwarp(cad("shapes/box"), Mesh::read(model("shapes/box.vtu")),
                        {.method = Method::Femwarp});
  CHECK_THROWS_AS(femwarp.derivative(), InvalidInputError);
  const RowMatrix ones = RowMatrix::Ones(map.node_count(), 3);
  CHECK_THROWS_AS(bore.morpher.gradient(ones, {{"change", bore.pair}},
                                        {.progress = [](auto, double) { return false; }}),
                  CancelledError);
  CHECK_THROWS_AS(bore.morpher.gradient(ones, {{"change", bore.pair}},
                                        {.progress =
                                             [&](auto, double) {
                                               bore.morpher.derivative();
                                               return true;
                                             }}),
                  InvalidInputError);
}

}  // namespace cadmorph
