#include <cadmorph/cadmorph.h>

#include <catch2/catch.hpp>
#include <stdexcept>
#include <thread>

#include "workplace.h"

namespace cadmorph {
namespace {

using namespace testing;
using Catch::Matchers::Contains;

CadModel cad(const std::string& name) { return CadModel::from_step(model(name + ".step")); }
Mesh mesh(const std::string& name) { return Mesh::read(model(name + ".vtu")); }

Morpher box_morpher(const MorphOptions& options = {}) {
  return Morpher(cad("shapes/box"), mesh("shapes/box"), options);
}

// Models and a mesh, without extensions.
struct Family {
  const char *base, *variant, *mesh;
};

}  // namespace

TEST_CASE("Files and positions are the program's, to the last bit", "[library]") {
  const auto family =
      GENERATE(Family{"bore/base", "bore/step20", "bore/hex"},
               Family{"shapes/bracket", "shapes/bracket_variant", "shapes/bracket"},
               Family{"shapes/cylinder_quadratic", "shapes/cylinder_quadratic_variant",
                      "shapes/cylinder_quadratic"});
  const Workplace place;
  const auto quoted = [](const std::string& name) { return "'" + model(name).string() + "' "; };
  REQUIRE(place.run(quoted(family.base + std::string(".step")) +
                    quoted(family.variant + std::string(".step")) +
                    quoted(family.mesh + std::string(".vtu")) + "-o program.vtu --quiet") == 0);
  const Morpher morpher(cad(family.base), mesh(family.mesh));
  const MorphResult result = morpher.morph(cad(family.variant));
  CHECK(result.write(place / "library.vtu").path == place / "library.vtu");
  CHECK(read_file(place / "library.vtu") == read_file(place / "program.vtu"));
  CHECK(Mesh::read(place / "program.vtu").points() == result.positions());

  SECTION("by arrays and bytes, too") {
    const Mesh file = mesh(family.mesh);
    const Mesh arrays({.points = file.points(),
                       .types = file.types(),
                       .offsets = file.offsets(),
                       .connectivity = file.connectivity(),
                       .regions = file.regions()});
    const auto bytes = [](const std::string& name) {
      return CadModel::from_step_bytes(read_file(model(name + ".step")));
    };
    const Morpher in_memory(bytes(family.base), arrays);
    CHECK(in_memory.morph(bytes(family.variant)).positions() == result.positions());
  }
}

TEST_CASE("A report tells what was done, with units", "[library]") {
  const Morpher morpher = box_morpher({.quality = Quality::Fast});
  CHECK(morpher.report().nodes.vertex == 8);
  CHECK(morpher.report().mesh_unit_mm == 1);
  CHECK(morpher.report().base_cad.faces == 6);
  CHECK(morpher.report().before.min_scaled_jacobian > 0);
  const MorphResult result = morpher.morph(cad("shapes/box_variant"));
  const Report& report = result.report();
  CHECK(report.outcome == Outcome::Done);
  CHECK(report.is_plain);
  CHECK(report.steps == 1);
  CHECK(report.max_displacement_mm ==
        Approx((result.positions() - morpher.mesh().points()).rowwise().norm().maxCoeff()));
  CHECK(report.node_count == result.positions().rows());
  CHECK(report.seconds > 0);
  CHECK_THAT(result.summary(), Contains("Largest move"));
  CHECK_THAT(result.json(), Contains("\"max_displacement_mm\""));
  const Index on_surface = report.nodes.vertex + report.nodes.edge + report.nodes.face;
  CHECK(std::ssize(morpher.surface_nodes()) == on_surface);
}

TEST_CASE("A report tells whether positions are a linear function of the surface's", "[library]") {
  const auto morph = [](Quality quality) {
    const Morpher morpher(cad("bore/base"), mesh("bore/hex"), {.quality = quality});
    return morpher.morph(cad("bore/step20"));
  };
  const MorphResult fast = morph(Quality::Fast), best = morph(Quality::Best);
  CHECK(fast.report().is_plain);
  CHECK(!fast.report().is_raised);
  CHECK(best.report().is_raised);
  CHECK(!best.report().is_plain);
  CHECK(best.report().after.min_scaled_jacobian > fast.report().after.min_scaled_jacobian);
}

TEST_CASE("A morph goes on from the positions of another", "[library]") {
  const MorphOptions fast{.quality = Quality::Fast};
  const MorphResult first = box_morpher(fast).morph(cad("shapes/box_variant"));
  const Morpher back(cad("shapes/box_variant"), mesh("shapes/box").at(first.positions()), fast);
  const MorphResult second = back.morph(cad("shapes/box"));
  const Points base = mesh("shapes/box").points();
  // There and back: an affine change, which a morph carries to 1e-9 of the diagonal.
  CHECK((second.positions() - base).cwiseAbs().maxCoeff() < 1e-9 * cad("shapes/box").diagonal_mm());
}

TEST_CASE("A callback that returns false cancels, one that throws is heard", "[library]") {
  int calls = 0;
  const auto count = [&](std::string_view, double fraction) {
    CHECK(fraction >= 0);
    CHECK(fraction <= 1);
    return ++calls > 0;
  };
  const Morpher morpher(cad("shapes/box"), mesh("shapes/box"), {}, count);
  CHECK(calls > 0);
  const CadModel variant = cad("shapes/box_variant");
  calls = 0;
  const Points positions = morpher.morph(variant, {.progress = count}).positions();
  const int all = calls;
  REQUIRE(all > 1);
  for (int last = 1; last <= all; ++last) {
    calls = 0;
    const auto stop = [&](std::string_view, double) { return ++calls < last; };
    CHECK_THROWS_AS(morpher.morph(variant, {.progress = stop}), CancelledError);
    CHECK(calls == last);
  }
  const auto fault = [](std::string_view, double) -> bool { throw std::logic_error("mine"); };
  CHECK_THROWS_AS(morpher.morph(variant, {.progress = fault}), std::logic_error);
  CHECK_THROWS_AS(Morpher(cad("shapes/box"), mesh("shapes/box"), {}, fault), std::logic_error);
  CHECK(morpher.morph(variant).positions() == positions);  // as if nothing had been
}

TEST_CASE("A morpher serves one call at a time", "[library]") {
  const Morpher morpher = box_morpher();
  const CadModel variant = cad("shapes/box_variant");
  int refused = 0, served = 0;
  const auto again = [&](std::string_view, double) {
    CHECK_THROWS_WITH(morpher.morph(variant), Contains("at work for another call"));
    ++refused;
    std::thread([&] {
      CHECK_THROWS_AS(morpher.morph(variant), InvalidInputError);
      ++refused;
      served += box_morpher().morph(variant).positions().rows() > 0;  // others are free
    }).join();
    return true;
  };
  const MorphResult result = morpher.morph(variant, {.progress = again});
  CHECK(refused >= 2);
  CHECK(2 * served == refused);
  CHECK(result.positions() == morpher.morph(variant).positions());
}

TEST_CASE("A refused result is thrown, or kept and marked", "[library]") {
  const Workplace place;
  const Morpher morpher(cad("bore/base"), mesh("bore/hex"), {.min_scaled_jacobian = 0.9});
  const CadModel variant = cad("bore/step20");
  CHECK_THROWS_WITH(morpher.morph(variant), Contains("scaled Jacobian below 0.9") &&
                                                Contains("improve_below") && !Contains("--"));
  CHECK_THROWS_AS(morpher.morph(variant), QualityError);
  const MorphResult kept = morpher.morph(variant, {.keep_refused = true});
  CHECK(kept.report().outcome == Outcome::PoorQuality);
  REQUIRE(kept.report().diagnosis);
  CHECK(kept.report().diagnosis->bad_cells > 0);
  CHECK(kept.write(place / "out.vtu").path == place / "out.failed.vtu");
  CHECK(!std::filesystem::exists(place / "out.vtu"));
}

TEST_CASE("What does not belong together is refused by its kind", "[library]") {
  CHECK_THROWS_AS(box_morpher().morph(cad("shapes/cylinder")), TopologyError);
  CHECK_THROWS_AS(Morpher(cad("shapes/cylinder"), mesh("shapes/box")), AssociationError);
  CHECK_THROWS_WITH(box_morpher({.association_tolerance = -1}), Contains("association_tolerance"));
  CHECK_THROWS_AS(box_morpher({.mesh_unit_mm = 0}), InvalidInputError);
  CHECK_THROWS_AS(box_morpher({.steps = -1}), InvalidInputError);
  CHECK_THROWS_AS(box_morpher({.max_steps = 0}), InvalidInputError);
  CHECK_THROWS_AS(box_morpher({.improve_below = 2}), InvalidInputError);
  CHECK_THROWS_AS(box_morpher({.min_scaled_jacobian = -2}), InvalidInputError);
  CHECK_THROWS_AS(box_morpher({.hold = {"nothing"}}), InvalidInputError);
  CHECK_THROWS_AS(box_morpher({.periodic = {{"nothing", "floor"}}}), InvalidInputError);
  CHECK_THROWS_AS(set_thread_count(-1), InvalidInputError);
}

TEST_CASE("Periodic sides are named by pairs", "[library]") {
  // The box of 40 x 30 x 20 in hexahedra of 10, its ends in x named.
  constexpr std::uint8_t kHexahedron = 12;
  MeshArrays arrays;
  arrays.offsets = {0};
  arrays.groups = {{"low", {}}, {"high", {}}};
  arrays.points.resize(5 * 4 * 3, 3);
  const auto node = [](Index i, Index j, Index k) { return (i * 4 + j) * 3 + k; };
  for (Index i = 0; i < 5; ++i)
    for (Index j = 0; j < 4; ++j)
      for (Index k = 0; k < 3; ++k) {
        arrays.points.row(node(i, j, k)) << 10.0 * double(i), 10.0 * double(j), 10.0 * double(k);
        if (i == 0) arrays.groups[0].nodes.push_back(node(i, j, k));
        if (i == 4) arrays.groups[1].nodes.push_back(node(i, j, k));
        if (i == 4 || j == 3 || k == 2) continue;
        for (const Index up : {0, 1})
          for (const Index corner : {node(i, j, k + up), node(i + 1, j, k + up),
                                     node(i + 1, j + 1, k + up), node(i, j + 1, k + up)})
            arrays.connectivity.push_back(corner);
        arrays.types.push_back(kHexahedron);
        arrays.offsets.push_back(static_cast<Index>(arrays.connectivity.size()));
      }
  const Morpher morpher(cad("shapes/box"), Mesh(arrays), {.periodic = {{"high", "low"}}});
  const MorphResult result = morpher.morph(cad("shapes/box_variant"));
  REQUIRE(result.report().notes.size() == 1);
  CHECK_THAT(result.report().notes.front(), Contains("periodic sides high, low: 12 nodes shifted"));
  for (std::size_t i = 0; i < 12; ++i) {
    const Eigen::RowVector3d low = result.positions().row(arrays.groups[0].nodes[i]),
                             high = result.positions().row(arrays.groups[1].nodes[i]);
    CHECK((high - low - Eigen::RowVector3d(46, 0, 0)).norm() <= 1e-12 * 60);
  }
}

TEST_CASE("A result outlives its morpher", "[library]") {
  const Workplace place;
  const MorphResult result = box_morpher().morph(cad("shapes/box_variant"));
  result.write(place / "box.vtu", true);
  CHECK(Mesh::read(place / "box.vtu").points() == result.positions());
}

}  // namespace cadmorph
