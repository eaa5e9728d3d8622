#include <cadmorph/cadmorph.h>

#include <catch2/catch.hpp>

#include "workplace.h"

namespace cadmorph {
namespace {

using namespace testing;
using Catch::Matchers::Contains;

// Cut short after its first lines.
constexpr const char* kNotBrep = "CASCADE Topology V1, (c) Matra-Datavision\nLocations 0\n";

}  // namespace

TEST_CASE("A model from bytes is the model from the file", "[library][cad]") {
  const CadModel file = CadModel::from_step(model("bore/base.step"));
  const CadModel bytes = CadModel::from_step_bytes(read_file(model("bore/base.step")), "bore");
  CHECK(file.face_count() == 13);
  CHECK(bytes.face_count() == 13);
  CHECK(bytes.edge_count() == file.edge_count());
  CHECK(bytes.vertex_count() == file.vertex_count());
  CHECK(bytes.solid_count() == 1);
  CHECK(bytes.lower_mm() == file.lower_mm());  // to the bit
  CHECK(bytes.upper_mm() == file.upper_mm());
  CHECK(bytes.unit() == file.unit());
  CHECK(bytes.name() == "bore");
  CHECK(file.diagonal_mm() == Approx((file.upper_mm() - file.lower_mm()).norm()));
}

TEST_CASE("What is no CAD model says so, and how to mend it", "[library][cad]") {
  CHECK_THROWS_AS(CadModel::from_step("missing.step"), IoError);
  CHECK_THROWS_WITH(CadModel::from_step_bytes("solid", "part"),
                    Contains("part: not a STEP file") && Contains("Export"));
  const std::string step = read_file(model("shapes/box.step"));
  CHECK_THROWS_WITH(CadModel::from_step_bytes(std::string_view(step).substr(0, step.size() / 2)),
                    Contains("truncated"));
  CHECK_THROWS_AS(CadModel::from_brep_bytes(""), CadError);
  CHECK_THROWS_WITH(CadModel::from_brep_bytes(step, "part"), Contains("part: no BREP data"));
  CHECK_THROWS_AS(CadModel::from_brep_bytes(kNotBrep), CadError);
}

TEST_CASE("Errors tell the exit code of the program", "[library]") {
  CHECK(exit_code(InvalidInputError("")) == 2);
  CHECK(exit_code(IoError("")) == 2);
  CHECK(exit_code(CadError("")) == 2);
  CHECK(exit_code(TopologyError("")) == 3);
  CHECK(exit_code(AssociationError("")) == 4);
  CHECK(exit_code(QualityError("")) == 5);
  CHECK(exit_code(SolverError("")) == 6);
  CHECK(exit_code(OutputError("")) == 6);
}

}  // namespace cadmorph
