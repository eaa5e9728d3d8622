#include <Eigen/Geometry>
#include <algorithm>
#include <catch2/catch.hpp>
#include <set>

#include "cad/step_reader.h"
#include "cad/topology_match.h"
#include "core/quality.h"
#include "core/validity.h"
#include "morph_case.h"

using namespace cadmorph;
using namespace cadmorph::testing;
using Eigen::Vector3d;

namespace {

/// Base faces that each surface node lies on, by OCCT's own projection on every base face.
std::vector<std::set<int>> touched_faces(const MorphCase& c, const FaceOracle& oracle) {
  // Nodes lie within 1e-6 of the CAD's size of their faces: other faces are a mesh size away.
  const double near = 1e-6 * c.diagonal;
  std::vector<std::set<int>> touched;
  for (const Index n : c.boundary.nodes) {
    touched.emplace_back();
    for (int f = 0; f < oracle.face_count(); ++f)
      if (oracle.is_near(f, c.mesh.points.row(n), near)) touched.back().insert(f);
  }
  return touched;
}

/// The largest tolerance of any entity of the variant: where OCCT says two entities may part.
double cad_tolerance(const CadModel& model) {
  double tolerance = 1e-7;
  for (const auto& f : model.faces()) tolerance = std::max(tolerance, f.tolerance);
  for (const auto& e : model.edges()) tolerance = std::max(tolerance, e.tolerance);
  for (const auto& v : model.vertices()) tolerance = std::max(tolerance, v.tolerance);
  return tolerance;
}

void check_family(const std::string& family, const std::string& mesh_name) {
  const std::string mesh_file = family + "/" + mesh_name + ".vtu";
  const MorphCase c = file_case(family + "/base.step", mesh_file);
  const FaceOracle base_oracle(read_shape(model_file(family + "/base.step")));
  const auto touched = touched_faces(c, base_oracle);
  const SurfaceMorph surface(c.base, c.mesh, c.boundary);
  for (const std::string step : {"step05", "step10", "step20"}) {
    const auto file = model_file(family + "/" + step + ".step");
    INFO(file.string() << " on " << mesh_file);
    const CadModel variant = read_step(file);
    const TopologyMatch match = match_topology(*c.base, variant);
    const auto result = surface.morph(variant, match);
    const FaceOracle oracle(read_shape(file));
    const double tolerance = cad_tolerance(variant);
    double worst = 0;
    for (std::size_t i = 0; i < touched.size(); ++i) {
      CHECK(!touched[i].empty());
      for (const int f : touched[i])
        worst = std::max(
            worst, oracle.distance(match.faces[f], result.positions.row(static_cast<Index>(i))));
    }
    CHECK(worst <= tolerance);
    CHECK(result.warnings.empty());
  }
}

}  // namespace

TEST_CASE("every surface node of the bore ends on the variant's faces, hex mesh",
          "[surface][families]") {
  check_family("bore", "hex");
}

TEST_CASE("every surface node of the bore ends on the variant's faces, tet mesh",
          "[surface][families]") {
  check_family("bore", "tet");
}

TEST_CASE("every surface node of the pipe ends on the variant's faces, hex mesh",
          "[surface][families]") {
  check_family("pipe", "hex");
}

TEST_CASE("every surface node of the pipe ends on the variant's faces, tet mesh",
          "[surface][families]") {
  check_family("pipe", "tet");
}

TEST_CASE("quadratic nodes of bore and pipe end on the variant's faces", "[surface][families]") {
  check_family("bore", "tet_quadratic");
  check_family("pipe", "tet_quadratic");
}

TEST_CASE("hex models have no inverted element up to step 20", "[surface][families]") {
  for (const std::string family : {"bore", "pipe"})
    for (const std::string step : {"step10", "step20"}) {
      DYNAMIC_SECTION(family << ' ' << step) {
        const MorphCase c = file_case(family + "/base.step", family + "/hex.vtu");
        const Morphed m = morph(c, read_step(model_file(family + "/" + step + ".step")));
        const Orientation orientation = detect_orientation(c.mesh);
        CHECK(measure_quality(c.mesh, m.points, orientation).inverted == 0);
        CHECK(check_validity(c.mesh, m.points, orientation).invalid == 0);
      }
    }
}

TEST_CASE("the bore's wall turns and grows with its parameters", "[surface][families][analytic]") {
  // models/bore/README.md: at step 20 the radius is 19.5 (base 15) about an axis tilted by 8
  // degrees about (-1, -2, 0) through the middle of the base axis.
  const MorphCase c = file_case("bore/base.step", "bore/hex.vtu");
  const auto result = morph_surface(c, read_step(model_file("bore/step20.step")));
  const FaceOracle oracle(read_shape(model_file("bore/base.step")));
  const FaceOracle variant(read_shape(model_file("bore/step20.step")));
  const TopologyMatch match = match_topology(*c.base, read_step(model_file("bore/step20.step")));
  Index on_wall = 0;
  for (int f = 0; f < oracle.face_count(); ++f) {
    if (c.base->faces()[f].type != SurfaceType::Cylinder) continue;
    for (std::size_t i = 0; i < c.boundary.nodes.size(); ++i) {
      if (!oracle.is_near(f, c.mesh.points.row(c.boundary.nodes[i]), 1e-6)) continue;
      ++on_wall;
      CHECK(variant.distance(match.faces[f], result.positions.row(static_cast<Index>(i))) < 1e-6);
    }
  }
  CHECK(on_wall > 100);
}
