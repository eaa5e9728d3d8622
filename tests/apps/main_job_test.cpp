#include <sys/stat.h>

#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>
#include <set>
#include <utility>

#include "command_line.h"
#include "core/mesh_file.h"

namespace cadmorph {
namespace {

using namespace testing;
using Json = nlohmann::json;

// The mesh of box.step (10 wide) is stretched to box_moved.step (12 wide).
double distance_to_stretched(const Points& points) {
  Points expected = box_mesh(3).points;
  expected.col(0) *= 1.2;
  return (points - expected).cwiseAbs().maxCoeff();
}

// Each hexahedron cut into six around the diagonal from its first to its seventh node.
Mesh tetrahedra(const Mesh& hexahedra) {
  Mesh mesh;
  mesh.points = hexahedra.points;
  mesh.offsets.push_back(0);
  constexpr int kRing[] = {1, 2, 3, 7, 4, 5, 1};
  for (Index c = 0; c < hexahedra.cell_count(); ++c) {
    const auto nodes = hexahedra.cell(c);
    for (int i = 0; i < 6; ++i) {
      for (const int corner : {0, kRing[i], kRing[i + 1], 6})
        mesh.connectivity.push_back(nodes[corner]);
      mesh.types.push_back(CellType::Tetra);
      mesh.offsets.push_back(std::ssize(mesh.connectivity));
    }
  }
  return mesh;
}

}  // namespace

TEST_CASE("The main job moves every node as the CAD tells", "[apps][main]") {
  const Workplace place;
  const RunResult result = place.run("box.step box_moved.step box.vtu");
  INFO(result.err);
  REQUIRE(result.exit_code == 0);
  CHECK(result.err.empty());
  CHECK_THAT(result.out, Catch::Matchers::Contains("box.morphed.vtu"));
  const MeshFile file(place.folder() / "box.morphed.vtu");
  // The affine map, to 1e-9 of the diagonal of 37 mm.
  CHECK(distance_to_stretched(file.mesh().points) < 3e-8);
  CHECK(file.mesh().connectivity == box_mesh(3).connectivity);
  CHECK(place.files().size() == 6);
}

TEST_CASE("CAD models read under a timeout give the same mesh", "[apps][main]") {
  const Workplace place;
  REQUIRE(place.run("box.step box_moved.step box.vtu -o here.vtu").exit_code == 0);
  const RunResult result =
      place.run("box.step box_moved.step box.vtu -o apart.vtu --timeout 1e9 --via box.step");
  INFO(result.err);
  REQUIRE(result.exit_code == 0);
  REQUIRE(place.run("box.step box_moved.step box.vtu -o apart.vtu --timeout 1e9").exit_code == 0);
  CHECK(place.read("apart.vtu") == place.read("here.vtu"));
}

TEST_CASE("The identity moves no node", "[apps][main]") {
  const Workplace place;
  REQUIRE(place.run("box.step box.step box.vtu -o same.vtu --quiet").exit_code == 0);
  const MeshFile file(place.folder() / "same.vtu");
  CHECK((file.mesh().points - box_mesh(3).points).cwiseAbs().maxCoeff() < 3.7e-8);
}

TEST_CASE("Quiet prints nothing, and JSON on stdout is all there is", "[apps][main]") {
  const Workplace place;
  const RunResult quiet = place.run("box.step box_moved.step box.vtu --quiet");
  CHECK(quiet.exit_code == 0);
  CHECK(quiet.out.empty());
  CHECK(quiet.err.empty());
  const RunResult json = place.run("box.step box_moved.step box.vtu --json -");
  REQUIRE(json.exit_code == 0);
  const Json report = Json::parse(json.out);
  CHECK(report["exit_code"] == 0);
  CHECK(report["outcome"] == "done");
  CHECK(report["mesh"]["nodes"] == 4 * 7 * 10);
  CHECK(report["nodes"]["vertex"] == 8);
  CHECK(report["nodes"]["edge"] == 4 * (2 + 5 + 8));
  CHECK(report["nodes"]["face"] == 2 * (2 * 5 + 5 * 8 + 2 * 8));
  CHECK(report["nodes"]["interior"] == 2 * 5 * 8);
  CHECK(report["max_displacement_mm"].get<double>() == Approx(2));
  CHECK(report["before"]["min_scaled_jacobian"].get<double>() == Approx(1));
  CHECK(report["after"]["invalid_exact"] == 0);
  CHECK(report["after"]["max_distance_mm"].get<double>() < 1e-7);
  CHECK(report["peak_memory_bytes"].get<double>() > 1e6);
  double sum = 0;
  for (const auto& [name, seconds] : report["seconds"].items())
    if (name != "total") sum += seconds.get<double>();
  CHECK(report["seconds"]["total"].get<double>() == Approx(sum));
}

TEST_CASE("The methods that the RBF warp is compared with do the main job too", "[apps][main]") {
  const Workplace place;
  for (const auto& [option, name] :
       {std::pair("femwarp", "FEMWARP"), std::pair("lbwarp", "LBWARP")}) {
    const RunResult result = place.run("box.step box_moved.step box.vtu -o out.vtu --method " +
                                       std::string(option) + " --json out.json");
    INFO(result.err);
    REQUIRE(result.exit_code == 0);
    CHECK_THAT(result.out, Catch::Matchers::Contains(name));
    CHECK(Json::parse(place.read("out.json"))["method"] == name);
    const MeshFile file(place.folder() / "out.vtu");
    CHECK(distance_to_stretched(file.mesh().points) < 3e-8);
  }
  CHECK(
      place.run("box.step box_moved.step box.vtu --method femwarp --kernel biharmonic").exit_code ==
      1);
  CHECK(place.run("box.step box_moved.step box.vtu --method lbwarp --solver lu").exit_code == 1);
}

TEST_CASE("A report goes to a file beside the summary", "[apps][main]") {
  const Workplace place;
  const RunResult result = place.run("box.step box_moved.step box.vtu --json report.json");
  CHECK(result.exit_code == 0);
  CHECK_FALSE(result.out.empty());
  CHECK(Json::parse(place.read("report.json"))["exit_code"] == 0);
}

TEST_CASE("The summary hints at --improve where the morph made elements poor", "[apps][main]") {
  const Workplace place;
  const std::string bore = source_file("models/bore/");
  const std::string morph = bore + "base.step " + bore + "step20.step " + bore;
  const auto hints = Catch::Matchers::Contains("Hint ");
  const std::string fast = "-o out.vtu --quality fast ";
  CHECK_THAT(place.run(morph + "tet.vtu " + fast).out, hints);  // from 0.149 to 0.046
  CHECK_THAT(Json::parse(place.run(morph + "tet.vtu --json - " + fast).out)["hints"]
                 .at(0)
                 .get<std::string>(),
             Catch::Matchers::Contains("try --improve 0.1"));
  CHECK_THAT(place.run(morph + "tet.vtu --improve 0.1 " + fast).out,
             Catch::Matchers::Contains("improving could not raise it further"));
  CHECK_THAT(place.run(morph + "hex.vtu " + fast).out,  // from 0.658 to 0.200
             Catch::Matchers::Contains("mesh the variant anew"));
  const RunResult best = place.run(morph + "tet.vtu -o out.vtu --json report.json");
  CHECK_THAT(best.out, Catch::Matchers::Contains("Raised ") && !hints);
  const Json raised = Json::parse(place.read("report.json"))["best_mesh"];
  CHECK(raised["attempts"].size() > 0);
  CHECK(raised["best"]["min_scaled_jacobian"].get<double>() >
        2 * raised["plain"]["min_scaled_jacobian"].get<double>());
  CHECK(raised["best"]["worst_twentieth"].get<double>() >
        raised["plain"]["worst_twentieth"].get<double>());
}

TEST_CASE("A mesh that is poor already is hinted at, too", "[apps][main]") {
  const Workplace place;
  Mesh mesh = box_mesh(3);
  mesh.points.row((3 * 7 + 3) * 4 + 1) += Eigen::RowVector3d(1.09, 1.09, 1.09);  // of 1.11
  write_mesh(place.folder() / "poor.vtu", mesh);
  const RunResult result = place.run("box.step box_moved.step poor.vtu -o out.vtu");
  REQUIRE(result.exit_code == 0);
  CHECK_THAT(result.out, Catch::Matchers::Contains("Hint "));
  CHECK_THAT(result.out, Catch::Matchers::Contains(", in the input 0.0") &&
                             Catch::Matchers::Contains("mesh anew") &&
                             !Catch::Matchers::Contains("try --improve"));
}

TEST_CASE("The time told is all that the user waited for", "[apps][main]") {
  const Workplace place;
  const RunResult result =
      place.run("box.step box_moved.step box.vtu -o out.vtu --json - --report page.html");
  REQUIRE(result.exit_code == 0);
  const Json report = Json::parse(result.out);
  CHECK(report["seconds"].contains("start"));
  CHECK(report["seconds"].contains("pictures"));
  CHECK_THAT(place.read("page.html"), Catch::Matchers::Contains("<td>pictures</td>") ||
                                          Catch::Matchers::Contains(">pictures<"));
  const RunResult batch = place.run("batch box.step box.vtu box_moved.step -o many");
  CHECK_THAT(batch.out, Catch::Matchers::Contains("before the first variant"));
}

TEST_CASE("A quality asked for that the input does not have is said to be so", "[apps][main]") {
  const Workplace place;
  Mesh mesh = box_mesh(3);
  mesh.points.row((3 * 7 + 3) * 4 + 1) += Eigen::RowVector3d(1.5, 1, 1);  // an inner node
  write_mesh(place.folder() / "poor.vtu", mesh);
  const RunResult result =
      place.run("box.step box_moved.step poor.vtu -o out.vtu --min-scaled-jacobian 0.9");
  REQUIRE(result.exit_code == 5);
  CHECK_THAT(result.err, Catch::Matchers::Contains("8 of these cells are below in it already"));
  CHECK_THAT(result.err, !Catch::Matchers::Contains("mirror image"));
}

TEST_CASE("A cell in a wrong node order is told at once and left alone", "[apps][main]") {
  const Workplace place;
  Mesh mesh = tetrahedra(box_mesh(3));
  const Index cell = mesh.cell_count() / 2;
  std::swap(mesh.connectivity[mesh.offsets[cell]], mesh.connectivity[mesh.offsets[cell] + 1]);
  write_mesh(place.folder() / "order.vtu", mesh);
  const RunResult result = place.run("box.step box_moved.step order.vtu -o x.vtu --json r.json");
  CHECK(result.exit_code == 5);
  const std::string name = "(cell " + std::to_string(cell) + ")";
  CHECK_THAT(result.err, Catch::Matchers::StartsWith("cadmorph: warning: the input mesh has 1 "));
  CHECK_THAT(result.err, Catch::Matchers::Contains("in a wrong order " + name));
  CHECK_THAT(result.err, Catch::Matchers::Contains("in the order of their type"));
  CHECK_THAT(result.err, !Catch::Matchers::Contains("refine the mesh"));
  CHECK(Json::parse(place.read("r.json"))["diagnosis"]["misordered"] == 1);
  // As if it were in order: no node is moved to make room for it.
  Points expected = mesh.points;
  expected.col(0) *= 1.2;
  const MeshFile file(place.folder() / "x.failed.vtu");
  CHECK((file.mesh().points - expected).cwiseAbs().maxCoeff() < 3e-8);
}

TEST_CASE("An error is told in JSON as well when that was asked for", "[apps][main]") {
  const Workplace place;
  const RunResult result = place.run("box.step none.step box.vtu --json -");
  CHECK(result.exit_code == 2);
  const Json report = Json::parse(result.out);
  CHECK(report["exit_code"] == 2);
  CHECK_THAT(report["error"].get<std::string>(), Catch::Matchers::Contains("none.step"));
  for (const std::string call :
       {"box.step box_moved.step --json -", "box.step box_moved.step box.vtu -o box.vtu --json -",
        "apply x.cmf box.vtu -o x.su2 --json -",
        "field box.step box_moved.step box.vtu -o x.cmf --improve 0.1 --json -"}) {
    const RunResult usage = place.run(call);
    CHECK(usage.exit_code == 1);
    CHECK(Json::parse(usage.out)["exit_code"] == 1);
  }
}

TEST_CASE("Diagnostics add the arrays of the design", "[apps][main]") {
  const Workplace place;
  REQUIRE(place.run("box.step box_moved.step box.vtu --diagnostics").exit_code == 0);
  const std::string text = place.read("box.morphed.vtu");
  for (const char* name : {"cadmorph_displacement", "cadmorph_cad_dimension", "cadmorph_cad_entity",
                           "cadmorph_uv", "cadmorph_scaled_jacobian"})
    CHECK_THAT(text, Catch::Matchers::Contains("Name=\"" + std::string(name) + "\""));
  CHECK_THAT(text, !Catch::Matchers::Contains("cadmorph_bad"));
}

TEST_CASE("Every solver and kernel gives the affine motion", "[apps][main]") {
  const Workplace place;
  for (const std::string options :
       {"--solver lu", "--solver ldlt", "--solver cholesky", "--kernel biharmonic",
        "--kernel quadharmonic", "--kernel multiquadric --shape 0.2", "--steps 3", "--threads 1",
        "--snap", "--mesh-unit mm", "--untangle never"}) {
    const RunResult result =
        place.run("box.step box_moved.step box.vtu -o x.vtu --quiet " + options);
    INFO(options << "\n" << result.err);
    REQUIRE(result.exit_code == 0);
    // Rounding at the condition of r^5, the worst of them.
    CHECK(distance_to_stretched(MeshFile(place.folder() / "x.vtu").mesh().points) < 1e-6);
  }
}

TEST_CASE("A mesh in metres stays in metres, whatever the unit of the STEP file", "[apps][main]") {
  const Workplace place;
  Mesh mesh = box_mesh(3);
  mesh.points *= 1e-3;
  write_mesh(place.folder() / "metres.vtu", mesh);
  for (const std::string unit : {"m", "1000"}) {
    const RunResult result =
        place.run("box_inch.step box_moved.step metres.vtu --json - --mesh-unit " + unit);
    INFO(result.err);
    REQUIRE(result.exit_code == 0);
    CHECK(Json::parse(result.out)["mesh"]["unit"] == "m");
    CHECK(Json::parse(result.out)["mesh"]["is_unit_detected"] == false);
    const MeshFile file(place.folder() / "metres.morphed.vtu");
    CHECK(distance_to_stretched(1e3 * file.mesh().points) < 1e-6);
  }
}

TEST_CASE("The unit of a mesh is detected and told", "[apps][main]") {
  const Workplace place;
  const MeshFile file(source_file("models/shapes/sphere.vtu"));
  Mesh mesh = file.mesh();
  mesh.points /= 25.4;
  write_mesh(place.folder() / "inches.vtu", mesh);
  const std::string sphere = source_file("models/shapes/sphere.step").string();
  const RunResult result = place.run(sphere + " " + sphere + " inches.vtu --json -");
  INFO(result.err);
  REQUIRE(result.exit_code == 0);
  CHECK(Json::parse(result.out)["mesh"]["unit"] == "inch");
  CHECK(Json::parse(result.out)["mesh"]["is_unit_detected"] == true);
  // The corner of the box in the origin is near the CAD in any unit.
  for (const auto& [unit, millimetres] : {std::pair{"m", 1000.0}, {"foot", 304.8}, {"cm", 10.0}}) {
    Mesh box = box_mesh(3);
    box.points /= millimetres;
    write_mesh(place.folder() / "small.vtu", box);
    const RunResult run = place.run("box.step box_moved.step small.vtu --json -");
    INFO(run.err);
    REQUIRE(run.exit_code == 0);
    CHECK(Json::parse(run.out)["mesh"]["unit"] == unit);
    const MeshFile morphed(place.folder() / "small.morphed.vtu");
    CHECK(distance_to_stretched(millimetres * morphed.mesh().points) < 1e-6);
  }
}

TEST_CASE("Poor quality ends with 5, a mesh marked as failed, and a diagnosis", "[apps][main]") {
  const Workplace place;
  Mesh mesh = box_mesh(3);
  mesh.points.row((3 * 7 + 3) * 4 + 1) += Eigen::RowVector3d(1.5, 1, 1);  // an inner node
  write_mesh(place.folder() / "poor.vtu", mesh);
  place.write("out.vtu", "kept");
  const auto before = place.files();
  const RunResult result = place.run(
      "box.step box_moved.step poor.vtu -o out.vtu --min-scaled-jacobian 0.9 --json report.json");
  INFO(result.err);
  CHECK(result.exit_code == 5);
  CHECK_THAT(result.err, Catch::Matchers::Contains("cadmorph: error: 8 elements"));
  CHECK_THAT(result.err, Catch::Matchers::Contains("out.failed.vtu"));
  CHECK(place.read("out.vtu") == "kept");
  CHECK_THAT(place.read("out.failed.vtu"), Catch::Matchers::Contains("Name=\"cadmorph_bad\""));
  auto expected = before;
  expected.insert({"out.failed.vtu", "report.json"});
  CHECK(place.files() == expected);
  const Json report = Json::parse(place.read("report.json"));
  CHECK(report["exit_code"] == 5);
  CHECK(report["diagnosis"]["bad_cells"] == 8);
}

TEST_CASE("A sphere moved far in its box takes steps, then untangling, then is refused",
          "[apps][main]") {
  const Workplace place;
  const std::string files =
      source_file("models/shapes/sphere_in_box.step").string() + " sphere_moved.step " +
      source_file("models/shapes/sphere_in_box.vtu").string() + " -o out.vtu --json report.json ";
  // The wall is 18 mm from the sphere, the elements 8 mm wide.
  place.make_moved_sphere(12);
  REQUIRE(place.run(files).exit_code == 0);
  CHECK(Json::parse(place.read("report.json"))["stepping"]["steps"] == 1);

  place.make_moved_sphere(17);
  CHECK(place.run(files + "--steps 1 --untangle never").exit_code == 5);
  const RunResult stepped = place.run(files + "--untangle never");
  INFO(stepped.err);
  REQUIRE(stepped.exit_code == 0);
  Json report = Json::parse(place.read("report.json"));
  CHECK(report["stepping"]["steps"].get<int>() > 1);
  CHECK(report["after"]["invalid_exact"] == 0);

  place.make_moved_sphere(17.5);
  REQUIRE(place.run(files + "--steps 1").exit_code == 0);
  report = Json::parse(place.read("report.json"));
  CHECK(report["untangling"]["invalid_before"].get<int>() > 0);
  CHECK(report["untangling"]["invalid_after"] == 0);
  CHECK(report["after"]["inverted_corner_jacobian"] == 0);

  std::filesystem::remove(place.folder() / "out.vtu");
  const RunResult refused = place.run(files + "--steps 1 --untangle never");
  CHECK(refused.exit_code == 5);
  CHECK_FALSE(place.has("out.vtu"));
  report = Json::parse(place.read("report.json"))["diagnosis"];
  CHECK(report["bad_cells"].get<int>() > 0);
  const double share = report["first_inversion_share"].get<double>();
  CHECK(share > 0.6);
  CHECK(share < 1);
  // The sphere itself or the wall at x = 60 it comes near to.
  CHECK(report["location"][0].get<double>() > 50);
  CHECK_THAT(refused.err, Catch::Matchers::Contains("nearest CAD face"));
  // Just below the share that the diagnosis names, one step does.
  place.make_moved_sphere(17.5 * (share - 0.02));
  CHECK(place.run(files + "--steps 1 --untangle never").exit_code == 0);
  place.make_moved_sphere(17.5 * (share + 0.01));
  CHECK(place.run(files + "--steps 1 --untangle never").exit_code == 5);
}

TEST_CASE("Poor elements are raised when asked for", "[apps][main]") {
  const Workplace place;
  Mesh mesh = box_mesh(3);
  mesh.points.row((3 * 7 + 3) * 4 + 1) += Eigen::RowVector3d(1.5, 1, 1);  // an inner node
  write_mesh(place.folder() / "poor.vtu", mesh);
  // The base mesh is the shape to stay near to: nothing becomes better than it is there.
  const RunResult same =
      place.run("box.step box_moved.step poor.vtu -o x.vtu --improve 0.9 --json -");
  REQUIRE(same.exit_code == 0);
  CHECK(Json::parse(same.out)["improving"]["poor_before"] == 8);

  const std::string bore = source_file("models/bore/base.step").string() + " " +
                           source_file("models/bore/step20.step").string() + " " +
                           source_file("models/bore/tet.vtu").string() +
                           " -o x.vtu --quality fast --json -";
  const RunResult plain = place.run(bore);
  const RunResult improved = place.run(bore + " --improve 0.1");
  REQUIRE(improved.exit_code == 0);
  const double before = Json::parse(plain.out)["after"]["min_scaled_jacobian"].get<double>();
  const Json report = Json::parse(improved.out);
  REQUIRE(before < 0.1);
  // Twice as good as without.
  CHECK(report["after"]["min_scaled_jacobian"].get<double>() > 2 * before);
  CHECK(report["improving"]["min_before"].get<double>() == Approx(before));
  CHECK(report["improving"]["poor_after"].get<int>() <
        report["improving"]["poor_before"].get<int>());
  CHECK(report["after"]["invalid_exact"] == 0);
}

TEST_CASE("Untangling always takes no further steps", "[apps][main]") {
  const Workplace place;
  place.make_moved_sphere(17);
  const RunResult result =
      place.run(source_file("models/shapes/sphere_in_box.step").string() + " sphere_moved.step " +
                source_file("models/shapes/sphere_in_box.vtu").string() +
                " -o out.vtu --json - --untangle always");
  REQUIRE(result.exit_code == 0);
  const Json report = Json::parse(result.out);
  CHECK(report["stepping"]["attempts"].size() == 1);
  CHECK(report["untangling"]["invalid_after"] == 0);
}

TEST_CASE("An input with an inverted element is repaired, or refused when repair is forbidden",
          "[apps][main]") {
  const Workplace place;
  Mesh mesh = box_mesh(3);
  const Index node = (3 * 7 + 3) * 4 + 1;
  mesh.points.row(node) += Eigen::RowVector3d(4, 4, 4);
  write_mesh(place.folder() / "inverted.vtu", mesh);
  const RunResult refused =
      place.run("box.step box_moved.step inverted.vtu -o x.vtu --untangle never");
  CHECK(refused.exit_code == 5);
  CHECK_THAT(refused.err, Catch::Matchers::Contains("already"));
  CHECK_FALSE(place.has("x.vtu"));
  CHECK(place.has("x.failed.vtu"));
  const RunResult repaired = place.run("box.step box_moved.step inverted.vtu -o x.vtu --json -");
  CHECK(repaired.exit_code == 0);
  const Json report = Json::parse(repaired.out);
  CHECK(report["before"]["invalid_exact"].get<int>() > 0);
  CHECK(report["after"]["invalid_exact"] == 0);
}

TEST_CASE("quality and match print tables and JSON", "[apps][main]") {
  const Workplace place;
  const RunResult quality = place.run("quality box.vtu --json -");
  REQUIRE(quality.exit_code == 0);
  CHECK(Json::parse(quality.out)["min_scaled_jacobian"].get<double>() == Approx(1));
  CHECK(Json::parse(quality.out)["checks"]["max_aspect_ratio"].get<double>() == Approx(1));
  CHECK_THAT(place.run("quality box.vtu").out, Catch::Matchers::Contains("Scaled Jacobian"));
  CHECK(place.run("quality box.vtu --min-scaled-jacobian 0.5").exit_code == 0);
  const RunResult match = place.run("match box.step box_moved.step --json -");
  REQUIRE(match.exit_code == 0);
  const Json pairs = Json::parse(match.out);
  const std::vector<std::pair<const char*, std::size_t>> counts{
      {"faces", 6}, {"edges", 12}, {"vertices", 8}};  // of a box
  for (const auto& [kind, count] : counts) {
    REQUIRE(pairs[kind].size() == count);
    std::set<int> base, variant;
    for (const Json& pair : pairs[kind]) {
      base.insert(pair["base"].get<int>());
      variant.insert(pair["variant"].get<int>());
      CHECK(pair["confidence"].get<double>() > 0.5);
      CHECK(pair["confidence"].get<double>() <= 1);
    }
    CHECK(base.size() == count);
    CHECK(variant == base);
  }
  CHECK(line_count(place.run("match box.step box_moved.step").out) >= 6 + 12 + 8 + 3 + 4);
}

TEST_CASE("match explains what speaks against it", "[apps][main]") {
  const Workplace place;
  const RunResult plain = place.run("match box.step box_moved.step");
  const RunResult explained = place.run("match box.step box_moved.step --explain");
  REQUIRE(explained.exit_code == 0);
  CHECK_THAT(plain.out, !Catch::Matchers::Contains("cost in bits"));
  for (const char* term : {"deformation", "neighbours", "parameters", "turn", "order", "sum"})
    CHECK_THAT(explained.out.substr(plain.out.size()), Catch::Matchers::Contains(term));
  const Json cost = Json::parse(place.run("match box.step box_moved.step --json -").out)["cost"];
  double sum = 0;
  for (const auto& [term, bits] : cost.items())
    if (term != "sum") sum += bits.get<double>();
  CHECK(cost["sum"].get<double>() == Approx(sum));
}

TEST_CASE("quality ends with 5 on an inverted or a poor element", "[apps][main]") {
  const Workplace place;
  Mesh mesh = box_mesh(2);
  mesh.points.row((3 * 5 + 2) * 3 + 1) += Eigen::RowVector3d(6, 6, 6);
  write_mesh(place.folder() / "bad.vtu", mesh);
  const RunResult result = place.run("quality bad.vtu");
  CHECK(result.exit_code == 5);
  CHECK_THAT(result.err, Catch::Matchers::Contains("bad.vtu"));
  const Mesh flat = [] {
    Mesh m = box_mesh(2);
    m.points.col(0) += 2 * m.points.col(1);
    return m;
  }();
  write_mesh(place.folder() / "sheared.vtu", flat);
  CHECK(place.run("quality sheared.vtu").exit_code == 0);
  const RunResult poor = place.run("quality sheared.vtu --min-scaled-jacobian 0.9");
  CHECK(poor.exit_code == 5);
  CHECK_THAT(poor.err, Catch::Matchers::Contains("below the 0.9 asked for"));
}

TEST_CASE("A report of success does not outlive a failure", "[apps][main]") {
  const Workplace place;
  REQUIRE(place.run("box.step box_moved.step box.vtu -o out.vtu --json r.json").exit_code == 0);
  const std::string failing = "box.step none.step box.vtu -o out.vtu --json ";
  CHECK(place.run(failing + "r.json").exit_code == 2);
  const Json report = Json::parse(place.read("r.json"));
  CHECK(report["exit_code"] == 2);
  CHECK_THAT(report["error"].get<std::string>(), Catch::Contains("none.step"));
  CHECK(place.run(failing + "new.json").exit_code == 2);
  CHECK(Json::parse(place.read("new.json"))["outcome"] == "error");
  // What is no report of this program stays.
  place.write("other.json", "{\"exit_code\": 0}");
  const std::string mesh = place.read("box.vtu");
  CHECK(place.run(failing + "other.json").exit_code == 2);
  CHECK(place.run(failing + "box.vtu").exit_code != 0);
  CHECK(place.read("other.json") == "{\"exit_code\": 0}");
  CHECK(place.read("box.vtu") == mesh);
}

TEST_CASE("No limit of quality or of a comparison is no number", "[apps][main]") {
  const Workplace place;
  const std::string morph = "box.step box_moved.step box.vtu -o out.vtu ";
  for (const std::string& command :
       {morph + "--min-scaled-jacobian nan", morph + "--min-scaled-jacobian=-nan",
        morph + "--improve nan", std::string("quality box.vtu --min-scaled-jacobian nan"),
        std::string("compare box.vtu box.vtu --tolerance nan"),
        std::string("compare box.vtu box.vtu --absolute nan"),
        std::string("compare box.vtu box.vtu --tolerance inf")}) {
    INFO(command);
    CHECK(place.run(command).exit_code == 1);
  }
  CHECK(!place.has("out.vtu"));
}

TEST_CASE("A pipe is no mesh, and a stream no output", "[apps][main]") {
  const Workplace place;
  REQUIRE(mkfifo((place.folder() / "pipe.vtu").c_str(), 0600) == 0);
  for (const std::string command : {"quality pipe.vtu", "box.step box_moved.step pipe.vtu"}) {
    const RunResult result = place.run(command);
    CHECK(result.exit_code == 2);
    CHECK_THAT(result.err, Catch::Contains("it is a pipe"));
  }
  CHECK(place.run("box.step box_moved.step box.vtu -o /dev/stdout").exit_code == 6);
}

TEST_CASE("Help and version are on stdout with 0", "[apps][main]") {
  const Workplace place;
  const RunResult help = place.run("--help");
  CHECK(help.exit_code == 0);
  CHECK(help.err.empty());
  for (const char* word : {"Examples", "--kernel", "--snap", "quality", "match", "Exit codes"})
    CHECK_THAT(help.out, Catch::Matchers::Contains(word));
  CHECK_THAT(place.run("--version").out, Catch::Matchers::StartsWith("cadmorph 0."));
  CHECK(place.run("quality --help").exit_code == 0);
}

TEST_CASE("The result does not depend on the number of threads", "[apps][main]") {
  const Workplace place;
  const std::string inputs = source_file("models/bore/base.step").string() + " " +
                             source_file("models/bore/step05.step").string() + " " +
                             source_file("models/bore/hex.vtu").string();
  REQUIRE(place.run(inputs + " -o one.vtu --quiet --threads 1").exit_code == 0);
  REQUIRE(place.run(inputs + " -o two.vtu --quiet --threads 2").exit_code == 0);
  const MeshFile one(place.folder() / "one.vtu"), two(place.folder() / "two.vtu");
  // The factorisation's blocks follow the BLAS's threads: rounding at the system's condition.
  CHECK((one.mesh().points - two.mesh().points).cwiseAbs().maxCoeff() < 1e-7);
}

}  // namespace cadmorph
