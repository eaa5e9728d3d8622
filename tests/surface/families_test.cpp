#include <Eigen/Geometry>
#include <algorithm>
#include <catch2/catch.hpp>
#include <set>

#include "cad/step_reader.h"
#include "cad/topology_match.h"
#include "core/kd_tree.h"
#include "core/quality.h"
#include "core/validity.h"
#include "models/bore.h"
#include "models/pipe.h"
#include "morph_case.h"
#include "volume/volume_morph.h"

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

struct Step {
  std::string name;
  TopoDS_Shape shape;
};

/// The variants whose STEP files are kept.
std::vector<Step> kept_steps(const std::string& family) {
  std::vector<Step> steps;
  for (const std::string step : {"step05", "step10", "step20"})
    steps.push_back({step, read_shape(model_file(family + "/" + step + ".step"))});
  return steps;
}

/// All 20 variants, from the generator.
std::vector<Step> all_steps(TopoDS_Shape (*make)(double)) {
  std::vector<Step> steps;
  for (int step = 1; step <= 20; ++step)
    steps.push_back({"step " + std::to_string(step), make(step / 20.0)});
  return steps;
}

void check_family(const std::string& family, const std::string& mesh_name,
                  const std::vector<Step>& steps) {
  const MorphCase c = file_case(family + "/base.step", family + "/" + mesh_name + ".vtu");
  const auto touched = touched_faces(c, FaceOracle(read_shape(model_file(family + "/base.step"))));
  for (const auto& faces : touched) CHECK(!faces.empty());
  const SurfaceMorph surface(c.base, c.mesh, c.boundary);
  for (const Step& step : steps) {
    INFO(family << ' ' << mesh_name << ", " << step.name);
    const CadModel variant = to_model(step.shape);
    const TopologyMatch match = match_topology(*c.base, variant);
    const auto result = surface.morph(variant, match);
    const FaceOracle oracle(step.shape);
    double worst = 0;
    for (std::size_t i = 0; i < touched.size(); ++i)
      for (const int f : touched[i])
        worst = std::max(worst, oracle.distance(match.faces[FaceId(f)],
                                                result.positions.row(static_cast<Index>(i))));
    CHECK(worst <= cad_tolerance(variant));
    CHECK(result.warnings.empty());
    CHECK(result.folded_facets.empty());
    CHECK(result.beyond_wires.isZero(0));
  }
}

void check_no_inversion(const std::string& family, const std::vector<Step>& steps) {
  const MorphCase c = file_case(family + "/base.step", family + "/hex.vtu");
  const Orientation orientation = detect_orientation(c.mesh);
  const SurfaceMorph surface(c.base, c.mesh, c.boundary);
  const VolumeMorph volume(c.mesh, c.boundary.nodes);
  for (const Step& step : steps) {
    INFO(family << ", " << step.name);
    const CadModel variant = to_model(step.shape);
    const Points points =
        volume.morph(surface.morph(variant, match_topology(*c.base, variant)).positions);
    CHECK(measure_quality(c.mesh, points, orientation).inverted == 0);
    CHECK(check_validity(c.mesh, points, orientation).invalid == 0);
  }
}

}  // namespace

TEST_CASE("every surface node of the bore ends on the variant's faces, hex mesh",
          "[surface][families]") {
  check_family("bore", "hex", kept_steps("bore"));
  check_family("bore", "hex", all_steps(models::make_bore));
}

TEST_CASE("every surface node of the bore ends on the variant's faces, tet mesh",
          "[surface][families]") {
  check_family("bore", "tet", kept_steps("bore"));
  check_family("bore", "tet", all_steps(models::make_bore));
}

TEST_CASE("every surface node of the pipe ends on the variant's faces, hex mesh",
          "[surface][families]") {
  check_family("pipe", "hex", kept_steps("pipe"));
  check_family("pipe", "hex", all_steps(models::make_pipe));
}

TEST_CASE("every surface node of the pipe ends on the variant's faces, tet mesh",
          "[surface][families]") {
  check_family("pipe", "tet", kept_steps("pipe"));
  check_family("pipe", "tet", all_steps(models::make_pipe));
}

TEST_CASE("quadratic nodes of bore and pipe end on the variant's faces", "[surface][families]") {
  check_family("bore", "tet_quadratic", kept_steps("bore"));
  check_family("pipe", "tet_quadratic", kept_steps("pipe"));
}

TEST_CASE("the bore's hex model has no inverted element up to step 20", "[surface][families]") {
  check_no_inversion("bore", kept_steps("bore"));
  check_no_inversion("bore", all_steps(models::make_bore));
}

TEST_CASE("the pipe's hex model has no inverted element up to step 20", "[surface][families]") {
  check_no_inversion("pipe", kept_steps("pipe"));
  check_no_inversion("pipe", all_steps(models::make_pipe));
}

TEST_CASE("the pipe's walls stretch evenly in angle and length", "[surface][families][analytic]") {
  // The generator's mesh of a variant is the truth: equal numbers are equal relative places.
  const MorphCase c = file_case("pipe/base.step", "pipe/hex.vtu");
  const SurfaceMorph surface(c.base, c.mesh, c.boundary);
  const Association& a = surface.association();
  const KdTree generated(models::make_pipe_hex(0).points);
  std::vector<Index> number;  // in the generator's order
  for (const Index n : c.boundary.nodes) {
    const auto near = generated.nearest(c.mesh.points.row(n).data(), 1)[0];
    REQUIRE(near.squared_distance < 1e-12);
    number.push_back(near.index);
  }
  for (const double change : {0.25, 1.0}) {
    const CadModel variant = to_model(models::make_pipe(change));
    const auto result = surface.morph(variant, match_topology(*c.base, variant));
    const Points known = models::make_pipe_hex(change).points(number, Eigen::all);
    double worst = 0;
    for (const RowId n : a.dimension.ids()) {
      const bool is_on_end = a.dimension[n] == CadDimension::Face &&
                             c.base->faces()[a.face(n)].type == SurfaceType::Plane;
      if (!is_on_end) worst = std::max(worst, (known.row(n) - result.positions.row(n)).norm());
    }
    CHECK(worst <= 1e-8 * variant.diagonal());
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
    if (c.base->faces()[FaceId(f)].type != SurfaceType::Cylinder) continue;
    for (std::size_t i = 0; i < c.boundary.nodes.size(); ++i) {
      if (!oracle.is_near(f, c.mesh.points.row(c.boundary.nodes[i]), 1e-6)) continue;
      ++on_wall;
      CHECK(variant.distance(match.faces[FaceId(f)], result.positions.row(static_cast<Index>(i))) <
            1e-6);
    }
  }
  CHECK(on_wall > 100);
}
