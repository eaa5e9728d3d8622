// Design velocities and gradients, in the library and by the command line.

#include <catch2/catch.hpp>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "apps/pipeline/design_velocity.h"
#include "cad/step_reader.h"
#include "command_line.h"
#include "core/errors.h"
#include "core/mesh_file.h"

namespace cadmorph {
namespace {

using namespace testing;
using Catch::Matchers::Contains;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Json = nlohmann::json;
namespace fs = std::filesystem;

constexpr double kLength = 60, kWidth = 40, kHeight = 20, kBoreX = 28, kBoreRadius = 9;
constexpr double kTubeRadius = 10, kTubeOuter = 15, kTubeLength = 50;

using Section = std::function<Vector2d(int around, double outward)>;

// Hexahedra between an inner and an outer closed line, extruded along z.
Mesh extruded(int around, int layers, int slices, double height, const Section& section) {
  Mesh mesh;
  mesh.points.resize(static_cast<Index>(around) * (layers + 1) * (slices + 1), 3);
  mesh.offsets = {0};
  const auto id = [&](int j, int l, int k) {
    return (static_cast<Index>(k) * (layers + 1) + l) * around + j % around;
  };
  for (int k = 0; k <= slices; ++k)
    for (int l = 0; l <= layers; ++l)
      for (int j = 0; j < around; ++j) {
        const Vector2d x = section(j, static_cast<double>(l) / layers);
        mesh.points.row(id(j, l, k)) << x[0], x[1], height * k / slices;
      }
  for (int k = 0; k < slices; ++k)
    for (int l = 0; l < layers; ++l)
      for (int j = 0; j < around; ++j)
        add_cell(mesh, CellType::Hexahedron,
                 std::array<Index, 8>{id(j, l, k), id(j, l + 1, k), id(j + 1, l + 1, k),
                                      id(j + 1, l, k), id(j, l, k + 1), id(j, l + 1, k + 1),
                                      id(j + 1, l + 1, k + 1), id(j + 1, l, k + 1)});
  return mesh;
}

Vector2d on_circle(const Vector2d& centre, double radius, double angle) {
  return centre + radius * Vector2d(std::cos(angle), std::sin(angle));
}

// Of the block with its bore; corners are nodes.
Mesh block_mesh() {
  constexpr int side = 8;
  const auto outside = [](int j) -> Vector2d {
    const double t = static_cast<double>(j % side) / side;
    switch (j / side) {
      case 0:
        return {kLength, kWidth * t};
      case 1:
        return {kLength * (1 - t), kWidth};
      case 2:
        return {0, kWidth * (1 - t)};
      default:
        return {kLength * t, 0};
    }
  };
  return extruded(4 * side, 4, 5, kHeight, [&](int j, double outward) -> Vector2d {
    const double angle = std::numbers::pi * (2.0 * j / (4 * side) - 0.25);
    return (1 - outward) * on_circle({kBoreX, kWidth / 2}, kBoreRadius, angle) +
           outward * outside(j);
  });
}

Mesh tube_mesh() {
  return extruded(24, 3, 10, kTubeLength, [](int j, double outward) {
    return on_circle({0, 0}, std::lerp(kTubeRadius, kTubeOuter, outward),
                     2 * std::numbers::pi * j / 24);
  });
}

void make_step(const Workplace& place, const std::string& arguments) {
  const std::string command = std::string(CADMORPH_STEP_FIXTURES) + " " + place.folder().string() +
                              " " + arguments + " > /dev/null";
  REQUIRE(std::system(command.c_str()) == 0);
}

std::string numbers(std::initializer_list<double> values) {
  std::string text;
  for (const double value : values) {
    char buffer[40];
    std::snprintf(buffer, sizeof buffer, " %.17g", value);
    text += buffer;
  }
  return text;
}

CadModel block(const Workplace& place, const std::string& name, double length, double x,
               double radius) {
  make_step(place, "block " + name + numbers({length, x, radius}));
  return read_step(place.folder() / name);
}

CadModel tube(const Workplace& place, const std::string& name, double length, double radius) {
  make_step(place, "tube " + name + numbers({length, radius}));
  return read_step(place.folder() / name);
}

MorphJob job_of(const Workplace& place, CadModel base, const Mesh& mesh) {
  write_mesh(place.folder() / "mesh.vtu", mesh);
  return {std::make_shared<const CadModel>(std::move(base)),
          std::make_shared<const MeshFile>(place.folder() / "mesh.vtu")};
}

// The largest miss of a velocity at nodes where `expected` knows it.
double miss(const MorphJob& job, const SurfaceVelocity& velocity,
            const std::function<std::optional<Vector3d>(const Vector3d& x)>& expected) {
  double worst = 0;
  Index known = 0;
  const auto& nodes = job.base().volume->surface_nodes();
  for (std::size_t i = 0; i < nodes.size(); ++i)
    if (const auto v = expected(job.base().mesh().points.row(nodes[i]))) {
      worst =
          std::max(worst, (velocity.velocity.row(static_cast<Index>(i)).transpose() - *v).norm());
      ++known;
    }
  CHECK(known > 50);
  return worst;
}

constexpr double kStep = 0.01;

}  // namespace

TEST_CASE("Velocities are those of the closed forms", "[apps][derivative]") {
  const Workplace place;
  const MorphJob job =
      job_of(place, block(place, "b.step", kLength, kBoreX, kBoreRadius), block_mesh());
  const auto from_bore = [](const Vector3d& x) {
    return Vector2d(x[0] - kBoreX, x[1] - kWidth / 2);
  };
  const auto is_bore = [&](const Vector3d& x) {
    return std::abs(from_bore(x).norm() - kBoreRadius) < 1e-6;
  };
  const auto is_side = [](const Vector3d& x) {
    return std::min({x[0], kLength - x[0], x[1], kWidth - x[1]}) < 1e-6;
  };
  const auto velocity = [&](Vector3d d) {
    d *= kStep;
    return surface_velocity(
        job, {block(place, "p.step", kLength + d[0], kBoreX + d[1], kBoreRadius + d[2]),
              block(place, "m.step", kLength - d[0], kBoreX - d[1], kBoreRadius - d[2]), kStep});
  };
  SECTION("bore radius") {
    const SurfaceVelocity radius = velocity({0, 0, 1});
    CHECK(radius.warnings.empty());
    CHECK(radius.motion == Approx(kStep).epsilon(1e-6));
    CHECK(radius.unevenness < 1e-6);
    CHECK(miss(job, radius, [&](const Vector3d& x) -> std::optional<Vector3d> {
            const Vector2d out = from_bore(x).normalized();
            if (is_bore(x)) return Vector3d(out[0], out[1], 0);
            if (is_side(x)) return Vector3d::Zero();
            return {};
          }) < 1e-7);
  }
  SECTION("bore position") {
    CHECK(miss(job, velocity({0, 1, 0}), [&](const Vector3d& x) -> std::optional<Vector3d> {
            if (is_bore(x)) return Vector3d::UnitX();
            if (is_side(x)) return Vector3d::Zero();
            return {};
          }) < 1e-7);
  }
  SECTION("block length") {
    CHECK(miss(job, velocity({1, 0, 0}), [&](const Vector3d& x) -> std::optional<Vector3d> {
            if (is_bore(x)) return Vector3d::Zero();
            if (is_side(x)) return Vector3d(x[0] / kLength, 0, 0);
            return {};
          }) < 1e-7);
  }
}

TEST_CASE("Velocities of a tube are those of the closed forms", "[apps][derivative]") {
  const Workplace place;
  const MorphJob job = job_of(place, tube(place, "b.step", kTubeLength, kTubeRadius), tube_mesh());
  const SurfaceVelocity radius =
      surface_velocity(job, {tube(place, "p.step", kTubeLength, kTubeRadius + kStep),
                             tube(place, "m.step", kTubeLength, kTubeRadius - kStep), kStep});
  CHECK(miss(job, radius, [](const Vector3d& x) -> std::optional<Vector3d> {
          const double r = x.head<2>().norm();
          if (std::abs(r - kTubeRadius) < 1e-6) return Vector3d(x[0] / r, x[1] / r, 0);
          if (std::abs(r - kTubeOuter) < 1e-6) return Vector3d::Zero();
          return {};
        }) < 1e-7);
  const SurfaceVelocity length =
      surface_velocity(job, {tube(place, "p.step", kTubeLength + kStep, kTubeRadius),
                             tube(place, "m.step", kTubeLength - kStep, kTubeRadius), kStep});
  CHECK(miss(job, length, [](const Vector3d& x) -> std::optional<Vector3d> {
          return Vector3d(0, 0, x[2] / kTubeLength);
        }) < 1e-7);
  // Stretched evenly, also inside.
  const NodeVelocity inside = carry_inside(job, length);
  for (Index n = 0; n < job.base().mesh().node_count(); ++n)
    CHECK((inside.velocity.row(n) -
           Eigen::RowVector3d(0, 0, job.base().mesh().points(n, 2) / kTubeLength))
              .norm() < 1e-7);
}

TEST_CASE("The error of a velocity falls with the square of the step, and is told",
          "[apps][derivative]") {
  const Workplace place;
  // The length by a parameter p that it is not linear in: 50 exp(p).
  const auto at = [&](double p) {
    return tube(place, "t.step", kTubeLength * std::exp(p), kTubeRadius);
  };
  const MorphJob job = job_of(place, at(0), tube_mesh());
  const auto pair = [&](double h) { return ParameterModels{at(h), at(-h), h}; };
  const auto error = [&](const SurfaceVelocity& velocity) {
    return miss(job, velocity, [](const Vector3d& x) { return Vector3d(0, 0, x[2]); });
  };
  const double wide = error(surface_velocity(job, pair(0.1)));
  const double half = error(surface_velocity(job, pair(0.05)));
  CHECK(wide / half == Approx(4).epsilon(0.01));
  const SurfaceVelocity both = surface_velocity(job, pair(0.1), pair(0.05));
  CHECK(both.error.rowwise().norm().maxCoeff() == Approx(half).epsilon(0.01));
  CHECK(error(both) < 0.002 * half);
  CHECK(carry_inside(job, both).error.maxCoeff() == Approx(half).epsilon(0.01));
  CHECK_THROWS_AS(surface_velocity(job, pair(0.1), pair(0.04)), InvalidInputError);
}

TEST_CASE("A gradient is the sum of dJ/dX times the velocity of all nodes", "[apps][derivative]") {
  const Workplace place;
  const MorphJob job =
      job_of(place, block(place, "b.step", kLength, kBoreX, kBoreRadius), block_mesh());
  const SurfaceVelocity velocity = surface_velocity(
      job, {block(place, "p.step", kLength, kBoreX + kStep, kBoreRadius + kStep),
            block(place, "m.step", kLength, kBoreX - kStep, kBoreRadius - kStep), kStep});
  RowMatrix slopes(job.base().mesh().node_count(), 3);
  for (Index i = 0; i < slopes.size(); ++i)
    slopes.data()[i] = std::sin(static_cast<double>(i * i % 1009));
  const double expected = slopes.cwiseProduct(carry_inside(job, velocity).velocity).sum();
  const double found = Gradient(job, slopes)(velocity);
  CHECK(std::abs(found - expected) <
        1e-12 * slopes.norm() * carry_inside(job, velocity).velocity.norm());
}

TEST_CASE("A step is judged by the CAD's tolerance", "[apps][derivative]") {
  const Workplace place;
  const MorphJob job = job_of(place, tube(place, "b.step", kTubeLength, kTubeRadius), tube_mesh());
  const auto velocity = [&](double h) {
    return surface_velocity(job, {tube(place, "p.step", kTubeLength + h, kTubeRadius),
                                  tube(place, "m.step", kTubeLength - h, kTubeRadius), h});
  };
  CHECK_THROWS_WITH(velocity(1e-9), Contains("take a larger step") && Contains("tolerance"));
  const SurfaceVelocity poor = velocity(1e-6);
  REQUIRE(poor.warnings.size() == 1);
  CHECK_THAT(poor.warnings[0], Contains("may be off by up to"));
  const SurfaceVelocity uneven =
      surface_velocity(job, {tube(place, "p.step", kTubeLength + 0.1, kTubeRadius),
                             tube(place, "m.step", kTubeLength, kTubeRadius), 0.05});
  REQUIRE(uneven.warnings.size() == 1);
  CHECK_THAT(uneven.warnings[0], Contains("not midway"));
  CHECK(uneven.unevenness == Approx(1).epsilon(1e-6));
}

namespace {

// A block with models of two parameters, and its mesh.
struct BlockModels {
  BlockModels() {
    block(place, "base.step", kLength, kBoreX, kBoreRadius);
    block(place, "x_plus.step", kLength, kBoreX + 0.1, kBoreRadius);
    block(place, "x_minus.step", kLength, kBoreX - 0.1, kBoreRadius);
    block(place, "r_plus.step", kLength, kBoreX, kBoreRadius + 0.1);
    block(place, "r_minus.step", kLength, kBoreX, kBoreRadius - 0.1);
    write_mesh(place.folder() / "block.vtu", block_mesh());
    place.write("parameters.csv",
                "name,plus,minus,step\n"
                "x,x_plus.step,x_minus.step,0.1\n"
                "\"radius, bore\",r_plus.step,r_minus.step,0.1\n");
  }
  Workplace place;
};

const RowMatrix& array_of(const std::vector<DataArray>& arrays, const std::string& name) {
  for (const DataArray& array : arrays)
    if (array.name == name) return array.values;
  FAIL("no array " + name);
  throw;
}

}  // namespace

TEST_CASE("cadmorph velocity writes dX/dp of all nodes, cadmorph gradient its transpose",
          "[apps][derivative]") {
  const BlockModels given;
  const Workplace& place = given.place;
  const RunResult written = place.run(
      "velocity base.step x_plus.step x_minus.step block.vtu --step 0.1 -o x.vtu --json x.json");
  CHECK(written.err.empty());
  REQUIRE(written.exit_code == 0);
  CHECK_THAT(written.out, Contains("Largest speed") && Contains("cadmorph_velocity"));
  const MeshFile file(place.folder() / "x.vtu");
  CHECK(file.mesh().points == block_mesh().points);
  const auto arrays = file.arrays();
  const RowMatrix& velocity = array_of(arrays, "cadmorph_velocity");
  const Json json = Json::parse(place.read("x.json"));
  CHECK(json["max_speed"].get<double>() == Approx(velocity.rowwise().norm().maxCoeff()));
  CHECK(json["max_error"].is_null());

  const RunResult gradient = place.run(
      "gradient base.step block.vtu parameters.csv --sensitivity x.vtu "
      "-o gradient.csv --json gradient.json");
  CHECK(gradient.err.empty());
  REQUIRE(gradient.exit_code == 0);
  CHECK_THAT(gradient.out, Contains("radius, bore"));
  const Json result = Json::parse(place.read("gradient.json"));
  REQUIRE(result["gradient"].size() == 2);
  CHECK(result["gradient"][0]["name"] == "x");
  CHECK(result["gradient"][0]["value"].get<double>() ==
        Approx(velocity.squaredNorm()).epsilon(1e-12));
  CHECK(line_count(place.read("gradient.csv")) == 3);
  CHECK_THAT(place.read("gradient.csv"), Contains("\"radius, bore\","));
}

TEST_CASE("Two steps give a better velocity and its error", "[apps][derivative]") {
  const BlockModels given;
  block(given.place, "x2_plus.step", kLength, kBoreX + 0.05, kBoreRadius);
  block(given.place, "x2_minus.step", kLength, kBoreX - 0.05, kBoreRadius);
  const RunResult run = given.place.run(
      "velocity base.step x_plus.step x_minus.step block.vtu --step 0.1 "
      "--half x2_plus.step x2_minus.step -o x.vtu --json -");
  REQUIRE(run.exit_code == 0);
  const Json json = Json::parse(run.out);
  CHECK(json["step"] == 0.05);
  CHECK(json["max_error"].get<double>() < 1e-3);
  CHECK(array_of(MeshFile(given.place.folder() / "x.vtu").arrays(), "cadmorph_velocity_error")
            .rows() == block_mesh().node_count());
}

TEST_CASE("SU2's surface sensitivity gives the gradient of the surface alone",
          "[apps][derivative]") {
  const BlockModels given;
  const Mesh mesh = block_mesh();
  // J: the x of the bore's nodes. Each moves by 1 with the bore's position.
  std::string table =
      "\"PointID\",\"x\",\"y\",\"z\",\"Sensitivity_x\",\"Sensitivity_y\",\"Sensitivity_z\"\n";
  int count = 0;
  for (Index n = 0; n < mesh.node_count(); ++n) {
    const Vector3d x = mesh.points.row(n);
    if (std::abs(std::hypot(x[0] - kBoreX, x[1] - kWidth / 2) - kBoreRadius) > 1e-6) continue;
    char line[200];
    std::snprintf(line, sizeof line, "%lld, %.10e, %.10e, %.10e, 1.0, 0.0, 0.0\n",
                  static_cast<long long>(n), x[0], x[1], x[2]);
    table += line;
    ++count;
  }
  given.place.write("sens.csv", table);
  const std::string command = "gradient base.step block.vtu parameters.csv --sensitivity sens.csv";
  const RunResult run = given.place.run(command + " --json -");
  REQUIRE(run.exit_code == 0);
  const Json json = Json::parse(run.out);
  CHECK(json["gradient"][0]["value"].get<double>() == Approx(count).epsilon(1e-7));
  CHECK(std::abs(json["gradient"][1]["value"].get<double>()) < 1e-5);
  // Nodes of the faces round the bore's ends move, too.
  REQUIRE(json["warnings"].size() == 1);
  CHECK_THAT(json["warnings"][0].get<std::string>(), Contains("of which 192 are not in the table"));

  // A node may stand twice, as in tables of several markers, but with the same values.
  const std::string last = table.substr(table.rfind('\n', table.size() - 2) + 1);
  given.place.write("sens.csv", table + last);
  const RunResult doubled = given.place.run(command + " --json -");
  REQUIRE(doubled.exit_code == 0);
  CHECK(Json::parse(doubled.out)["gradient"] == json["gradient"]);
  given.place.write("sens.csv", table + last.substr(0, last.rfind("1.0")) + "2.0, 0.0, 0.0\n");
  const RunResult twice = given.place.run(command);
  CHECK(twice.exit_code == 2);
  CHECK_THAT(twice.err, Contains("stands twice, with other values"));

  given.place.write("sens.csv",
                    "PointID,x,y,z,Sensitivity_x,Sensitivity_y,Sensitivity_z\n"
                    "0,1,2,3,0,0,0\n");
  const RunResult other = given.place.run(command);
  CHECK(other.exit_code == 2);
  CHECK_THAT(other.err, Contains("sens.csv:2") && Contains("another mesh"));
  given.place.write("sens.csv", "PointID,x,y,z\n0,1,2,3\n");
  CHECK_THAT(given.place.run(command).err, Contains("no column \"Sensitivity_x\""));
  given.place.write("sens.csv", "PointID,x,y,z,Sensitivity_x,Sensitivity_y,Sensitivity_z\n");
  const RunResult empty = given.place.run(command);
  CHECK(empty.exit_code == 2);
  CHECK_THAT(empty.err, Contains("no node stands below the columns"));
}

TEST_CASE("What can't be differentiated is refused with its reason", "[apps][derivative]") {
  const BlockModels given;
  const Workplace& place = given.place;
  const std::string base = "velocity base.step x_plus.step x_minus.step block.vtu ";
  const auto expect = [&](const std::string& arguments, int code, const std::string& text) {
    INFO(arguments);
    const RunResult run = place.run(arguments);
    CHECK(run.exit_code == code);
    CHECK_THAT(run.err, Contains(text));
  };
  expect(base + "-o x.vtu", 1, "--step");
  expect(base + "--step 0 -o x.vtu", 1, "--step");
  expect(base + "--step 0.1 -o x.su2", 1, "x.vtu");
  expect(base + "--step 0.1 --solver iqr -o x.vtu", 1, "iqr");
  expect(base + "--step 0.1 -o block.vtu", 1, "one of the inputs");
  expect("velocity base.step box.step x_minus.step block.vtu --step 0.1 -o x.vtu", 3, "box.step");
  expect("velocity base.step x_plus.step x_minus.step box.vtu --step 0.1 -o x.vtu", 4,
         "does not lie");
  expect("velocity base.step none.step x_minus.step block.vtu --step 0.1 -o x.vtu", 2, "none.step");
  CHECK(!place.has("x.vtu"));

  const std::string gradient = "gradient base.step block.vtu bad.csv --sensitivity ";
  write_mesh(place.folder() / "s.vtu", block_mesh(),
             {.point_arrays = {{"a", RowMatrix::Ones(block_mesh().node_count(), 3)},
                               {"b", RowMatrix::Ones(block_mesh().node_count(), 3)}},
              .cell_arrays = {},
              .point_integers = {},
              .cell_integers = {}});
  place.write("bad.csv", "name,plus,minus,step\nx,x_plus.step,x_minus.step,fast\n");
  expect(gradient + "s.vtu --array a", 2, "bad.csv:2: \"fast\"");
  place.write("bad.csv", "name,plus,minus\nx,x_plus.step,x_minus.step\n");
  expect(gradient + "s.vtu --array a", 2, "no column \"step\"");
  place.write("bad.csv", "name,plus,minus,step\nx,x_plus.step,x_minus.step,-1\n");
  expect(gradient + "s.vtu --array a", 2, "not positive");
  place.write("bad.csv", "name,plus,minus,step\nx,x_plus.step,x_minus.step,1e-310\n");
  expect(gradient + "s.vtu --array a", 2, "too small to divide by");
  place.write("bad.csv", "name,plus,minus,step\n");
  expect(gradient + "s.vtu --array a", 2, "no parameter");
  expect("gradient base.step block.vtu parameters.csv --sensitivity s.vtu", 2, "a, b");
  expect("gradient base.step block.vtu parameters.csv --sensitivity s.vtu --array c", 2,
         "no array c");
  expect("gradient base.step block.vtu parameters.csv --sensitivity box.vtu --array c", 2, "none");
}

}  // namespace cadmorph
