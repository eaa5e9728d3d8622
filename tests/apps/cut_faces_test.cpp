#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>

#include "cad_variants.h"
#include "command_line.h"
#include "core/mesh_file.h"
#include "known_parts.h"
#include "triangulation.h"

using namespace cadmorph;
using namespace cadmorph::testing;
using Catch::Matchers::Contains;

namespace {

constexpr double kSame = 1e-4;  // mm: a cut curve is sampled at other places

const std::string kBore = source_file("models/bore/").string();

// The bore's base and its last step as they are and with closed faces cut, and what the morph from
// the one to the other gives.
class CutBore {
 public:
  CutBore() {
    for (const std::string name : {"base", "step20"})
      write_step(place.folder() / (name + "_cut.step"),
                 with_cut_faces(read_shape(kBore + name + ".step")));
    REQUIRE(place.run(kBore + "base.step " + variant + morphed + "-o plain.vtu").exit_code == 0);
  }

  // Of the nodes of a result to those of the morph between whole faces, millimetres.
  double distance(const std::string& file) const {
    return (positions(file) - positions("plain.vtu")).rowwise().norm().maxCoeff();
  }

  const Workplace place;
  const std::string base = kBore + "base.step ", variant = kBore + "step20.step ",
                    mesh = kBore + "hex.vtu ",
                    morphed = mesh + "--quality fast ";  // where it ends depends on rounding else

 private:
  Points positions(const std::string& file) const {
    return MeshFile(place.folder() / file).mesh().points;
  }
};

}  // namespace

TEST_CASE("Faces that one exporter cut are merged, with a warning", "[apps][cut]") {
  const CutBore bore;
  const auto morph = [&](const std::string& models, const std::string& merged) {
    const RunResult run = bore.place.run(models + bore.morphed +
                                         "-o out.vtu --diagnostics --report out.html --json -");
    INFO(run.err);
    REQUIRE(run.exit_code == 0);
    const auto warnings = nlohmann::json::parse(run.out)["warnings"].dump();
    CHECK_THAT(warnings,
               Contains(merged + ": ") && Contains(" merged with others of the same surface"));
    CHECK(bore.distance("out.vtu") < kSame);
    const RunResult match = bore.place.run("match " + models);
    CHECK(match.exit_code == 0);
    CHECK_THAT(match.out, Contains("with others of the same surface"));
  };
  morph(bore.base + "step20_cut.step ", "step20_cut.step");
  morph("base_cut.step " + bore.variant, "base_cut.step");
}

TEST_CASE("Faces that both models cut, each elsewhere, are told of without a warning",
          "[apps][cut]") {
  const KnownPart& hub = known_part("keyed_hub");
  Sizes wider = hub.sizes;  // its seam cuts the bore beside the key
  wider["bore"] *= 1.15;
  wider["seam"] = 1;
  const TopoDS_Shape base = hub.make(hub.sizes).shape;
  const Workplace place;
  write_step(place.folder() / "base.step", base);
  write_step(place.folder() / "wider.step", hub.make(wider).shape);
  write_mesh(place.folder() / "mesh.vtu", triangulate(base, 0.3));
  const RunResult run = place.run("base.step wider.step mesh.vtu -o out.vtu --json -");
  INFO(run.err);
  REQUIRE(run.exit_code == 0);
  const auto report = nlohmann::json::parse(run.out);
  CHECK(report["warnings"].empty());
  CHECK_THAT(report["notes"].dump(), Contains("of both models count"));
}

TEST_CASE("A batch serves variants with cut faces beside others", "[apps][batch][cut]") {
  const CutBore bore;
  for (const std::string& base : {bore.base, std::string("base_cut.step ")}) {
    const RunResult batch = bore.place.run("batch " + base + bore.morphed + bore.variant +
                                           "step20_cut.step --diagnostics -o out");
    INFO(batch.err);
    REQUIRE(batch.exit_code == 0);
    for (const std::string name : {"step20", "step20_cut"})
      CHECK(bore.distance("out/" + name + ".vtu") < kSame);
    std::filesystem::remove_all(bore.place.folder() / "out");
  }
}

TEST_CASE("A series goes through models with cut faces, and so does a field", "[apps][cut]") {
  const CutBore bore;
  const std::string via = bore.base + bore.variant + bore.morphed + "--via step20_cut.step ";
  REQUIRE(bore.place.run(via + "-o out.vtu").exit_code == 0);
  CHECK(bore.distance("out.vtu") < kSame);
  REQUIRE(
      bore.place.run("field base_cut.step " + bore.variant + bore.mesh + "-o out.cmf").exit_code ==
      0);
  REQUIRE(bore.place.run("apply out.cmf " + bore.mesh + "-o applied.vtu").exit_code == 0);
  CHECK(bore.distance("applied.vtu") < kSame);
}
