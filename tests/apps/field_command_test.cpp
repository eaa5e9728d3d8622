// `cadmorph field` and `cadmorph apply` through the command line.

#include <Eigen/Geometry>
#include <algorithm>
#include <catch2/catch.hpp>
#include <map>
#include <nlohmann/json.hpp>
#include <random>

#include "command_line.h"
#include "core/boundary.h"
#include "core/mesh_file.h"

namespace cadmorph {
namespace {

using namespace testing;
using Catch::Matchers::Contains;
using Json = nlohmann::json;
namespace fs = std::filesystem;

std::string bore(const std::string& name) { return source_file("models/bore/" + name).string(); }

std::string sphere_morph() {
  return source_file("models/shapes/sphere_in_box.step").string() + " sphere_moved.step " +
         source_file("models/shapes/sphere_in_box.vtu").string();
}

// Cells of a mesh with the nodes they use; `nodes` are their ids there.
struct Piece {
  Mesh mesh;
  std::vector<Index> nodes;
};

std::vector<Piece> random_pieces(const Mesh& mesh, int count) {
  std::mt19937 random(11);
  std::vector<Piece> pieces(static_cast<std::size_t>(count));
  std::vector<std::map<Index, Index>> numbers(pieces.size());
  for (Piece& piece : pieces) piece.mesh.offsets.push_back(0);
  for (Index c = 0; c < mesh.cell_count(); ++c) {
    const std::size_t p = random() % pieces.size();
    Piece& piece = pieces[p];
    for (const Index node : mesh.cell(c)) {
      const auto [number, is_new] =
          numbers[p].try_emplace(node, static_cast<Index>(piece.nodes.size()));
      if (is_new) piece.nodes.push_back(node);
      piece.mesh.connectivity.push_back(number->second);
    }
    piece.mesh.types.push_back(mesh.types[c]);
    piece.mesh.offsets.push_back(static_cast<Index>(piece.mesh.connectivity.size()));
  }
  for (Piece& piece : pieces) {
    piece.mesh.points.resize(static_cast<Index>(piece.nodes.size()), 3);
    for (std::size_t i = 0; i < piece.nodes.size(); ++i)
      piece.mesh.points.row(static_cast<Index>(i)) = mesh.points.row(piece.nodes[i]);
  }
  return pieces;
}

Points points_of(const Workplace& place, const std::string& name) {
  return MeshFile(place.folder() / name).mesh().points;
}

Mesh tetrahedron(const Points& points) {
  return {.points = points,
          .types = {CellType::Tetra},
          .offsets = {0, 4},
          .connectivity = {0, 1, 2, 3},
          .polyhedron_offsets = {},
          .polyhedron_faces = {},
          .regions = {},
          .region_array = {}};
}

}  // namespace

TEST_CASE("A field applied to its mesh gives the main job's mesh", "[apps][field]") {
  const Workplace place;
  const std::string files =
      bore("base.step") + " " + bore("step20.step") + " " + bore("hex.vtu") + " -o ";
  REQUIRE(place.run(files + "morphed.vtu --quality fast --quiet").exit_code == 0);
  const RunResult made = place.run("field " + files + "field.cmf --json field.json");
  REQUIRE(made.exit_code == 0);
  CHECK_THAT(made.out, Contains("field.cmf"));
  CHECK(Json::parse(place.read("field.json"))["written"] == "field.cmf");

  const RunResult applied =
      place.run("apply field.cmf " + bore("hex.vtu") + " -o applied.vtu --json -");
  REQUIRE(applied.exit_code == 0);
  CHECK(applied.err.empty());
  const Json report = Json::parse(applied.out);
  CHECK(report["exact_nodes"] == 4566);  // the surface nodes
  CHECK(report["nodes_outside"] == 0);
  // Surface nodes to the last bit; others to the far field's error, here rounding of direct sums.
  const Points a = points_of(place, "applied.vtu"), b = points_of(place, "morphed.vtu");
  Index same = 0;
  for (Index i = 0; i < a.rows(); ++i) same += a.row(i) == b.row(i);
  CHECK(same >= 4566);
  CHECK(place.run("compare morphed.vtu applied.vtu --tolerance 1e-8").exit_code == 0);
}

TEST_CASE("The field of a surface alone moves the volume mesh", "[apps][field]") {
  const Workplace place;
  const Mesh mesh = MeshFile(bore("hex.vtu")).mesh();
  const Boundary boundary = extract_boundary(mesh);
  Mesh surface;
  surface.types = boundary.types;
  surface.offsets = boundary.offsets;
  surface.points.resize(static_cast<Index>(boundary.nodes.size()), 3);
  for (std::size_t i = 0; i < boundary.nodes.size(); ++i)
    surface.points.row(static_cast<Index>(i)) = mesh.points.row(boundary.nodes[i]);
  for (const Index node : boundary.connectivity)
    surface.connectivity.push_back(std::ranges::lower_bound(boundary.nodes, node) -
                                   boundary.nodes.begin());
  write_mesh(place.folder() / "surface.vtu", surface);
  const std::string cad = bore("base.step") + " " + bore("step20.step") + " ";
  REQUIRE(place.run("field " + cad + "surface.vtu -o field.cmf --quiet").exit_code == 0);
  REQUIRE(place.run("apply field.cmf " + bore("hex.vtu") + " -o out.vtu --quiet").exit_code == 0);
  REQUIRE(place.run(cad + bore("hex.vtu") + " -o morphed.vtu --quality fast --quiet").exit_code ==
          0);
  const Points a = points_of(place, "out.vtu"), b = points_of(place, "morphed.vtu");
  for (const Index node : boundary.nodes) REQUIRE(a.row(node) == b.row(node));
  // Inside both are within the solver's tolerance of the interpolant: 1e-5 local edges each, and as
  // much again for what the interpolant makes of it.
  CHECK(place.run("compare morphed.vtu out.vtu --tolerance 4e-5").exit_code == 0);
}

TEST_CASE("Pieces of a mesh moved one by one agree on their common nodes", "[apps][field]") {
  const Workplace place;
  REQUIRE(place
              .run("field " + bore("base.step") + " " + bore("step20.step") + " " +
                   bore("tet.vtu") + " -o field.cmf > summary.txt")
              .exit_code == 0);
  CHECK_THAT(place.read("summary.txt"), Contains("Written") && !Contains("Hint"));
  const Mesh mesh = MeshFile(bore("hex.vtu")).mesh();  // another mesh of the same part
  REQUIRE(place.run("apply field.cmf " + bore("hex.vtu") + " -o whole.vtu --quiet").exit_code == 0);
  const Points whole = points_of(place, "whole.vtu");
  int threads = 0;
  Index shared = -mesh.node_count();
  for (const Piece& piece : random_pieces(mesh, 4)) {
    write_mesh(place.folder() / "piece.vtu", piece.mesh);
    REQUIRE(place.run("apply field.cmf piece.vtu --quiet --threads " + std::to_string(++threads))
                .exit_code == 0);
    const Points moved = points_of(place, "piece.morphed.vtu");
    for (std::size_t i = 0; i < piece.nodes.size(); ++i)
      REQUIRE(moved.row(static_cast<Index>(i)) == whole.row(piece.nodes[i]));
    shared += static_cast<Index>(piece.nodes.size());
  }
  CHECK(shared > 10000);
}

TEST_CASE("A field leads through CAD models on the way", "[apps][field]") {
  const Workplace place;
  const std::string trip = bore("base.step") + " " + bore("step20.step") + " " + bore("hex.vtu") +
                           " --via " + bore("step10.step") + " --quality fast --quiet -o ";
  REQUIRE(place.run(trip + "main.vtu").exit_code == 0);
  const RunResult field = place.run("field " + trip + "field.cmf");
  INFO(field.err);
  REQUIRE(field.exit_code == 0);
  REQUIRE(place.run("apply field.cmf " + bore("hex.vtu") + " -o applied.vtu --quiet").exit_code ==
          0);
  const Mesh mesh = MeshFile(bore("hex.vtu")).mesh();
  const Points expected = points_of(place, "main.vtu"), found = points_of(place, "applied.vtu");
  for (const Index node : extract_boundary(mesh).nodes)
    REQUIRE(found.row(node) == expected.row(node));
  // Direct sums on both sides: rounding alone.
  CHECK((found - expected).cwiseAbs().maxCoeff() < 1e-9);
  CHECK(place.run("field " + trip + "x.cmf --map faces.csv").exit_code != 0);
  CHECK_FALSE(place.has("x.cmf"));
}

TEST_CASE("A field of any solver and kernel is the morph, and its pieces agree", "[apps][field]") {
  const Workplace place;
  const Mesh mesh = MeshFile(place.folder() / "box.vtu").mesh();
  const std::string files = "box.step box_moved.step box.vtu --quiet ";
  for (const std::string options :
       {"--solver cholesky", "--solver ldlt", "--solver fast", "--solver iqr --tolerance 1e-3",
        "--kernel biharmonic", "--kernel quadharmonic", "--kernel wendland-c2 --shape 0.02",
        "--kernel multiquadric --shape 0.1"}) {
    INFO(options);
    REQUIRE(place.run(files + "-o main.vtu " + options).exit_code == 0);
    REQUIRE(place.run("field " + files + "-o field.cmf " + options).exit_code == 0);
    REQUIRE(place.run("apply field.cmf box.vtu -o whole.vtu --quiet").exit_code == 0);
    const Points whole = points_of(place, "whole.vtu");
    CHECK((whole - points_of(place, "main.vtu")).cwiseAbs().maxCoeff() < 1e-9);
    for (const Piece& piece : random_pieces(mesh, 2)) {
      write_mesh(place.folder() / "piece.vtu", piece.mesh);
      REQUIRE(place.run("apply field.cmf piece.vtu --quiet").exit_code == 0);
      const Points moved = points_of(place, "piece.morphed.vtu");
      for (std::size_t i = 0; i < piece.nodes.size(); ++i)
        REQUIRE(moved.row(static_cast<Index>(i)) == whole.row(piece.nodes[i]));
    }
  }
}

TEST_CASE("Bodies that morph one by one have no field, and it is said why", "[apps][field]") {
  const Workplace place;
  const std::string blocks = source_file("models/shapes/two_blocks").string();
  const RunResult run = place.run("field " + blocks + ".step " + blocks + "_variant.step " +
                                  blocks + ".vtu -o x.cmf");
  CHECK(run.exit_code == 2);
  CHECK_THAT(run.err, Contains("two_blocks.vtu") && Contains("components") &&
                          Contains("make a field for the mesh of each"));
  CHECK_FALSE(place.has("x.cmf"));
}

TEST_CASE("Where steps are needed the field holds them, and repair it refuses", "[apps][field]") {
  const Workplace place;
  place.make_moved_sphere(17);
  REQUIRE(place.run(sphere_morph() + " -o morphed.vtu --quiet --untangle never").exit_code == 0);
  REQUIRE(place.run("field " + sphere_morph() + " -o field.cmf --quiet").exit_code == 0);
  const RunResult applied =
      place.run("apply field.cmf " + source_file("models/shapes/sphere_in_box.vtu").string() +
                " -o applied.vtu --json -");
  REQUIRE(applied.exit_code == 0);
  CHECK(Json::parse(applied.out)["field"]["steps"].get<int>() > 1);
  CHECK(place.run("compare morphed.vtu applied.vtu --tolerance 1e-8").exit_code == 0);

  place.make_moved_sphere(17.5);
  auto before = place.files();
  const RunResult refused = place.run("field " + sphere_morph() + " -o no.cmf --steps 1");
  CHECK(refused.exit_code == 5);
  CHECK_THAT(refused.err, Contains("was not written") && Contains("nearest CAD face"));
  CHECK_THAT(refused.err, !Contains("--untangle"));  // which `field` has no use for
  const RunResult poor =
      place.run("field " + sphere_morph() + " -o no.cmf --steps 10 --min-scaled-jacobian 0.5");
  CHECK(poor.exit_code == 5);
  CHECK_THAT(poor.err, Contains("try: ") && !Contains("--improve") && !Contains("--untangle"));
  CHECK(place.files() == before);
  for (const std::string option : {"--untangle always", "--improve 0.2", "--keep-layers"})
    CHECK(place.run("field " + sphere_morph() + " -o no.cmf " + option).exit_code == 1);
  CHECK(place.files() == before);
}

TEST_CASE("Points without a solid cell move by the field", "[apps][field]") {
  const Workplace place;
  REQUIRE(place.run("field box.step box_moved.step box.vtu -o field.cmf --quiet").exit_code == 0);
  Mesh sensors;
  sensors.points.resize(2, 3);
  sensors.points << 1, 2, 3, 4, 5, 60;
  sensors.types = {CellType::Vertex, CellType::Vertex};
  sensors.offsets = {0, 1, 2};
  sensors.connectivity = {0, 1};
  write_mesh(place.folder() / "sensors.vtu", sensors);
  const RunResult applied = place.run("apply field.cmf sensors.vtu");
  REQUIRE(applied.exit_code == 0);
  CHECK_THAT(applied.err, Contains("1 of 2 points lie outside the box of box.vtu") &&
                              Contains("the unit is mm"));
  // box_moved.step is the box stretched from the origin, as its far corner tells.
  REQUIRE(place.run("box.step box_moved.step box.vtu -o moved.vtu --quiet").exit_code == 0);
  const Points corners = points_of(place, "moved.vtu");
  REQUIRE(corners.row(0).norm() < 1e-9);
  const Eigen::RowVector3d far = corners.bottomRows(1);
  const Points moved = points_of(place, "sensors.morphed.vtu");
  for (int i = 0; i < 2; ++i)
    for (int d = 0; d < 3; ++d)
      CHECK(moved(i, d) == Approx(sensors.points(i, d) * far(d) / (10 * (d + 1))).epsilon(1e-9));
}

TEST_CASE("A mesh that the field inverts is refused", "[apps][field]") {
  const Workplace place;
  REQUIRE(place
              .run("field " + bore("base.step") + " " + bore("step20.step") + " " +
                   bore("hex.vtu") + " -o field.cmf --quiet")
              .exit_code == 0);
  // Two flat tetrahedra of opposite height, whose base bends by far more: one of them inverts.
  const Mesh mesh = MeshFile(bore("hex.vtu")).mesh();
  const auto cell = mesh.cell(mesh.cell_count() / 2);
  int inverted = 0;
  for (const double height : {1e-9, -1e-9}) {
    Points corners(4, 3);
    for (int i = 0; i < 3; ++i) corners.row(i) = mesh.points.row(cell[i]);
    const Eigen::Vector3d a = corners.row(1) - corners.row(0), b = corners.row(2) - corners.row(0);
    corners.row(3) = corners.topRows(3).colwise().mean() + height * a.cross(b).transpose();
    if (height < 0) corners.row(0).swap(corners.row(1));
    write_mesh(place.folder() / "flat.vtu", tetrahedron(corners));
    REQUIRE(place.run("quality flat.vtu").exit_code == 0);
    const RunResult applied = place.run("apply field.cmf flat.vtu -o out.vtu");
    if (applied.exit_code == 0) continue;
    ++inverted;
    CHECK(applied.exit_code == 5);
    CHECK_THAT(applied.err, Contains("1 element is inverted, the first is cell 0"));
    CHECK_THAT(place.read("out.failed.vtu"), Contains("Name=\"cadmorph_bad\""));
  }
  CHECK(inverted == 1);
}

TEST_CASE("What can't be applied is refused with its exit code", "[apps][field]") {
  const Workplace place;
  REQUIRE(place.run("field box.step box_moved.step box.vtu -o field.cmf --quiet").exit_code == 0);
  const std::string sound = place.read("field.cmf");
  place.write("short.cmf", sound.substr(0, sound.size() / 2));
  std::string damaged = sound;
  damaged[damaged.size() / 2] ^= 1;
  place.write("damaged.cmf", damaged);
  std::string newer = sound;
  newer[newer.find('\n') + 2] = 99;
  place.write("newer.cmf", newer);
  const auto before = place.files();
  for (const auto& [file, why] :
       std::map<std::string, std::string>{{"short.cmf", "in place of the"},
                                          {"damaged.cmf", "it is damaged"},
                                          {"newer.cmf", "a newer cadmorph wrote it"},
                                          {"box.step", "it is no field file"},
                                          {"none.cmf", "there is no such file"}}) {
    const RunResult result = place.run("apply " + file + " box.vtu -o out.vtu");
    CHECK(result.exit_code == 2);
    CHECK_THAT(result.err, Contains(file) && Contains(why));
    CHECK(line_count(result.err) <= 2);
  }
  CHECK(place.run("apply field.cmf box.step -o out.step").exit_code == 2);
  CHECK(place.run("apply field.cmf box.vtu -o box.vtu").exit_code == 1);
  CHECK(place.run("apply field.cmf box.vtu -o out.su2").exit_code == 1);
  CHECK(place.run("apply field.cmf box.vtu -o none/out.vtu").exit_code == 6);
  CHECK(place.run("field box.step box_moved.step box.vtu").exit_code == 1);
  CHECK(place.run("field box.step box_moved.step box.vtu -o box.vtu").exit_code == 1);
  CHECK(place.run("field box.step box_chamfer.step box.vtu -o x.cmf").exit_code == 3);
  CHECK(place.run("field box.step box_moved.step box.vtu -o x.cmf --method femwarp").exit_code ==
        2);
  CHECK(place.files() == before);
}

TEST_CASE("A field moves a mesh in another unit as in its own", "[apps][field]") {
  const Workplace place;
  Mesh metres = box_mesh(3);
  metres.points /= 1000;
  write_mesh(place.folder() / "metres.vtu", metres);
  REQUIRE(place.run("field box.step box_moved.step box.vtu -o f.cmf").exit_code == 0);
  REQUIRE(place.run("apply f.cmf box.vtu -o mm.vtu").exit_code == 0);
  const RunResult result = place.run("apply f.cmf metres.vtu -o m.vtu");
  REQUIRE(result.exit_code == 0);
  CHECK_THAT(result.out, Catch::Contains("unit m"));
  CHECK((1000 * points_of(place, "m.vtu") - points_of(place, "mm.vtu")).cwiseAbs().maxCoeff() <
        1e-12 * 30);
  REQUIRE(place.run("apply f.cmf metres.vtu -o given.vtu --mesh-unit m").exit_code == 0);
  CHECK(points_of(place, "given.vtu") == points_of(place, "m.vtu"));
  // Taken for millimetres it lies in a corner of the box.
  REQUIRE(place.run("apply f.cmf metres.vtu -o wrong.vtu --mesh-unit mm").exit_code == 0);
  CHECK((points_of(place, "wrong.vtu") - metres.points).cwiseAbs().maxCoeff() < 0.01);
}

}  // namespace cadmorph
