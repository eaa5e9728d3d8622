#include <sys/stat.h>

#include <catch2/catch.hpp>
#include <limits>

#include "command_line.h"
#include "core/mesh_file.h"

namespace cadmorph {
namespace {

using namespace testing;

// Runs a command that must fail: checks the exit code, the form of the message, that it names what
// it must, and that no file came or went.
void check_failure(const Workplace& place, const std::string& arguments, int exit_code,
                   const std::vector<std::string>& words, const std::string& setup = "") {
  const auto before = place.files();
  const RunResult result = place.run(arguments, setup);
  INFO("cadmorph " << arguments << "\n" << result.out << result.err);
  CHECK(result.exit_code == exit_code);
  CHECK(result.out.empty());
  CHECK(result.err.rfind("cadmorph: error: ", 0) == 0);
  CHECK(line_count(result.err) <= 2);
  if (exit_code > 1) {
    const std::string section = "Exit code " + std::to_string(exit_code);
    CHECK_THAT(result.err,
               Catch::Matchers::Contains("cadmorph help exit-codes " + std::to_string(exit_code)));
    CHECK_THAT(place.read(source_file("docs/troubleshooting.md")),
               Catch::Matchers::Contains("## " + section + ":"));
  }
  for (const std::string& word : words)
    CHECK_THAT(result.err, Catch::Matchers::Contains(word, Catch::CaseSensitive::No));
  CHECK(place.files() == before);
}

std::string first_half(const std::string& text) { return text.substr(0, text.size() / 2); }

}  // namespace

TEST_CASE("A missing file is refused with 2", "[apps][bad]") {
  const Workplace place;
  check_failure(place, "none.step box_moved.step box.vtu", 2, {"none.step"});
  check_failure(place, "box.step none.step box.vtu", 2, {"none.step"});
  check_failure(place, "box.step box_moved.step none.vtu", 2, {"none.vtu"});
  check_failure(place, "quality none.vtu", 2, {"none.vtu"});
  check_failure(place, "match box.step none.step", 2, {"none.step"});
  check_failure(place, "box.step box_moved.step box.vtu --map none.csv", 2, {"none.csv"});
}

TEST_CASE("A STEP file that hangs its reader is refused with 2 after the timeout", "[apps][bad]") {
  const Workplace place;
  // A STEP file that never ends: a pipe that nobody writes into.
  REQUIRE(mkfifo((place.folder() / "hang.step").c_str(), 0666) == 0);
  check_failure(place, "hang.step box_moved.step box.vtu --timeout 1", 2,
                {"hang.step", "no answer in 1 s", "--timeout"});
  check_failure(place, "box.step hang.step box.vtu --timeout 1", 2,
                {"hang.step", "no answer in 1 s", "--timeout"});
  check_failure(place, "field hang.step box_moved.step box.vtu -o out.cmf --timeout 1", 2,
                {"hang.step", "no answer in 1 s", "--timeout"});
  check_failure(place, "match box.step hang.step --timeout 1", 2,
                {"hang.step", "no answer in 1 s", "--timeout"});
  check_failure(place,
                "velocity box.step box_moved.step hang.step box.vtu --step 1 -o v.vtu --timeout 1",
                2, {"hang.step", "no answer in 1 s", "--timeout"});
  place.write("table.csv", "name,plus,minus,step\np,box_moved.step,hang.step,1\n");
  place.write("dj.csv", "PointID,x,y,z,Sensitivity_x,Sensitivity_y,Sensitivity_z\n0,0,0,0,1,0,0\n");
  check_failure(place, "gradient box.step box.vtu table.csv --sensitivity dj.csv --timeout 1", 2,
                {"hang.step", "no answer in 1 s", "--timeout"});
  check_failure(place, "box.step box_moved.step box.vtu --timeout 0", 1, {"--timeout", "above 0"});
}

TEST_CASE("A STEP file read under a timeout is refused as without", "[apps][bad]") {
  const Workplace place;
  place.write("half.step", first_half(place.read("box.step")));
  check_failure(place, "half.step box_moved.step box.vtu --timeout 1e9", 2,
                {"half.step", "truncated"});
}

TEST_CASE("A damaged STEP file is refused with 2", "[apps][bad]") {
  const Workplace place;
  place.write("half.step", first_half(place.read("box.step")));
  place.write("garbage.step", "\x01\x02garbage\n\xff no STEP here; DATA; ENDSEC;");
  place.write("empty.step", "");
  place.write(
      "no_data.step",
      "ISO-10303-21;\nHEADER;\nFILE_DESCRIPTION((''),'2;1');\nFILE_NAME('','',(''),(''),'','','"
      "');\nFILE_SCHEMA(('AUTOMOTIVE_DESIGN'));\nENDSEC;\nDATA;\nENDSEC;\nEND-ISO-10303-21;\n");
  for (const std::string name : {"half.step", "garbage.step", "empty.step", "no_data.step"}) {
    check_failure(place, name + " box_moved.step box.vtu", 2, {name});
    check_failure(place, "box.step " + name + " box.vtu", 2, {name});
  }
}

TEST_CASE("A damaged mesh is refused with 2", "[apps][bad]") {
  const Workplace place;
  const std::string whole = place.read("box.vtu");
  place.write("half.vtu", first_half(whole));
  place.write("garbage.vtu", "no mesh at all\n");
  place.write("empty.vtu", "");
  place.write("text.txt", "hello");
  place.write("zero_cells.vtu",
              "<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" version=\"0.1\" "
              "byte_order=\"LittleEndian\">\n<UnstructuredGrid><Piece NumberOfPoints=\"0\" "
              "NumberOfCells=\"0\"><Points><DataArray type=\"Float64\" NumberOfComponents=\"3\" "
              "format=\"ascii\"></DataArray></Points><Cells><DataArray type=\"Int64\" "
              "Name=\"connectivity\" format=\"ascii\"></DataArray><DataArray type=\"Int64\" "
              "Name=\"offsets\" format=\"ascii\"></DataArray><DataArray type=\"UInt8\" "
              "Name=\"types\" format=\"ascii\"></DataArray></Cells></Piece></UnstructuredGrid>\n"
              "</VTKFile>\n");
  for (const std::string name : {"half.vtu", "garbage.vtu", "empty.vtu", "zero_cells.vtu"}) {
    check_failure(place, "box.step box_moved.step " + name, 2, {name});
    check_failure(place, "quality " + name, 2, {name});
  }
  check_failure(place, "box.step box_moved.step text.txt", 2, {"text.txt"});
}

TEST_CASE("A mesh with a coordinate that is not finite is refused with 2", "[apps][bad]") {
  const Workplace place;
  for (const double value :
       {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    Mesh mesh = box_mesh(2);
    mesh.points(17, 1) = value;
    write_mesh(place.folder() / "nan.vtu", mesh);
    check_failure(place, "box.step box_moved.step nan.vtu", 2, {"nan.vtu", "17"});
    check_failure(place, "quality nan.vtu", 2, {"nan.vtu", "17"});
  }
}

TEST_CASE("CAD models that do not correspond are refused with 3", "[apps][bad]") {
  const Workplace place;
  check_failure(place, "box.step box_chamfer.step box.vtu", 3, {"box_chamfer.step", "face"});
  check_failure(place, "match box.step box_chamfer.step", 3, {"box_chamfer.step", "face"});
  check_failure(place, "box_chamfer.step box.step box.vtu", 3, {"face"});
}

TEST_CASE("A mesh of another part is refused with 4", "[apps][bad]") {
  const Workplace place;
  Mesh mesh = box_mesh(3);
  for (Index n = 0; n < mesh.node_count(); ++n)
    mesh.points(n, 0) += 0.02 * mesh.points(n, 2) * mesh.points(n, 2);
  write_mesh(place.folder() / "bent.vtu", mesh);
  check_failure(place, "box.step box_moved.step bent.vtu", 4, {"box.step"});
  const std::string sphere = source_file("models/shapes/sphere.vtu").string();
  check_failure(place, "box.step box_moved.step " + sphere + " -o x.vtu", 4, {"box.step"});
}

TEST_CASE("A mesh that does not lie on the base is told where it lies", "[apps][bad]") {
  const Workplace place;
  check_failure(place, "box_moved.step box.step box.vtu", 4, {"box.step, the second", "swap"});
  Mesh mesh = box_mesh(3);
  mesh.points.col(2).array() -= 10;
  write_mesh(place.folder() / "shifted.vtu", mesh);
  check_failure(place, "box.step box_moved.step shifted.vtu", 4,
                {"fits box.step after a shift by (0, 0, 10) mm"});
  CHECK_THAT(place.run("batch box.step shifted.vtu box_moved.step -o out").err,
             Catch::Matchers::Contains("fits box.step after a shift by (0, 0, 10) mm"));
  mesh.points.col(0).array() += 7;
  mesh.points.col(1).array() += 1e-14;
  write_mesh(place.folder() / "rounded.vtu", mesh);
  CHECK_THAT(place.run("box.step box_moved.step rounded.vtu").err,
             !Catch::Matchers::Contains("e-1"));
  check_failure(place, "box.step box_moved.step box.vtu --mesh-unit m", 4,
                {"fits box.step in mm", "--mesh-unit"});
}

TEST_CASE("A hexahedron in a wrong node order is named", "[apps][bad]") {
  const Workplace place;
  Mesh mesh = box_mesh(3);
  std::swap(mesh.connectivity[8 * 13], mesh.connectivity[8 * 13 + 6]);
  write_mesh(place.folder() / "order.vtu", mesh);
  const std::string told = "error: the nodes of cell 13 are in a wrong order";
  check_failure(place, "box.step box_moved.step order.vtu", 4, {told});
  const RunResult batch = place.run("batch box.step order.vtu box_moved.step -o out");
  CHECK(batch.exit_code == 4);
  CHECK_THAT(batch.err, Catch::Matchers::Contains(told));
}

TEST_CASE("A far field is kept, or refused with 4 where that was asked for", "[apps][bad]") {
  const Workplace place;
  const std::string part = source_file("models/shapes/sphere_far_field").string();
  const std::string files = part + ".step " + part + ".step " + part + ".vtu -o x.vtu";
  check_failure(place, files + " --unmatched error", 4,
                {"sphere_far_field.step", "6", "--unmatched"});
  const RunResult kept = place.run(files);
  INFO(kept.err);
  CHECK(kept.exit_code == 0);
  CHECK_THAT(kept.err, Catch::Matchers::Contains("6 patches stay fixed"));
  CHECK(place.has("x.vtu"));
}

TEST_CASE("A mesh off the CAD is refused with 4 beyond the tolerance given", "[apps][bad]") {
  const Workplace place;
  Mesh mesh = box_mesh(3);  // edges of 10 / 3
  for (Index n = 0; n < mesh.node_count(); ++n)
    if (mesh.points(n, 0) > 9.9) mesh.points(n, 0) += 0.2;
  write_mesh(place.folder() / "off.vtu", mesh);
  check_failure(place, "box.step box_moved.step off.vtu --association-tolerance 0.01", 4,
                {"box.step", "node", "mm"});
  CHECK(place.run("box.step box_moved.step off.vtu -o x.vtu").exit_code == 0);
}

TEST_CASE("A face map that contradicts the models is refused", "[apps][bad]") {
  const Workplace place;
  place.write("beyond.csv", "base,variant\n1,99\n");
  check_failure(place, "box.step box_moved.step box.vtu --map beyond.csv", 2, {"1,99"});
  // Opposite faces can't become adjacent ones.
  place.write("torn.csv", "1,1\n2,3\n");
  check_failure(place, "box.step box_moved.step box.vtu --map torn.csv", 3, {"face map", "2,3"});
}

TEST_CASE("Bad usage is refused with 1", "[apps][bad]") {
  const Workplace place;
  check_failure(place, "", 1, {"usage"});
  check_failure(place, "box.step", 1, {"MESH"});
  check_failure(place, "box.step box_moved.step", 1, {"MESH"});
  check_failure(place, "box.step box_moved.step box.vtu another", 1, {"another"});
  check_failure(place, "box.step box_moved.step box.vtu --nonsense", 1, {"--nonsense"});
  check_failure(place, "box.step box_moved.step box.vtu --solver best", 1, {"best", "cholesky"});
  check_failure(place, "box.step box_moved.step box.vtu --kernel r3", 1, {"r3", "triharmonic"});
  check_failure(place, "box.step box_moved.step box.vtu --kernel gaussian", 1, {"--shape"});
  check_failure(place, "box.step box_moved.step box.vtu --shape 2", 1, {"--shape"});
  check_failure(place, "box.step box_moved.step box.vtu --steps 0", 1, {"--steps"});
  check_failure(place, "box.step box_moved.step box.vtu --steps many", 1, {"--steps"});
  check_failure(place, "box.step box_moved.step box.vtu --mesh-unit ell", 1, {"ell"});
  check_failure(place, "box.step box_moved.step box.vtu --threads -2", 1, {"--threads"});
  check_failure(place, "box.step box_moved.step box.vtu --tolerance nought", 1, {"--tolerance"});
  for (const std::string option :
       {"--kernel triharmonic", "--solver auto", "--tolerance 1e-5", "--memory 8GB"})
    check_failure(place, "box.step box_moved.step box.vtu --method femwarp " + option, 1,
                  {"--method rbf"});
  check_failure(place, "quality", 1, {"MESH"});
  check_failure(place, "match box.step", 1, {"VARIANT"});
}

TEST_CASE("An output that is an input is refused with 1", "[apps][bad]") {
  const Workplace place;
  check_failure(place, "box.step box_moved.step box.vtu -o box.vtu", 1, {"box.vtu", "input"});
  check_failure(place, "box.step box_moved.step box.vtu -o ./box.vtu", 1, {"input"});
  check_failure(place, "box.step box_moved.step box.vtu --json box.step", 1, {"input"});
  check_failure(place, "box.step box_moved.step box.vtu -o x.vtu --json x.vtu", 1, {"x.vtu"});
  check_failure(place, "box.step box_moved.step box.vtu -o x.su2", 1, {".vtu", "SU2"});
  std::filesystem::create_symlink("box.vtu", place.folder() / "link.vtu");
  check_failure(place, "box.step box_moved.step box.vtu -o link.vtu", 1, {"input"});
}

TEST_CASE("Every command keeps its outputs from its inputs and from each other", "[apps][bad]") {
  const Workplace place;
  place.write("map.csv", "base,variant\n1,1\n");
  std::filesystem::copy(place.folder() / "box.vtu", place.folder() / "x.failed.vtu");
  const std::string morph = "box.step box_moved.step box.vtu ";
  for (const std::string& call : std::vector<std::string>{
           "box.step box_moved.step x.failed.vtu -o x.vtu", "field " + morph + "-o box.vtu",
           "field " + morph + "-o x.cmf --map map.csv --json map.csv",
           "field " + morph + "-o x.cmf --cache box.step", "apply x.cmf box.vtu -o ./box.vtu",
           "apply x.cmf x.failed.vtu -o x.vtu", "apply x.cmf box.vtu -o y.vtu --json x.cmf",
           "match box.step box_moved.step --json box.step",
           "match box.step box_moved.step --map map.csv --json map.csv",
           "quality box.vtu --json box.vtu", "quality box.vtu --picture box.vtu",
           "compare box.vtu x.failed.vtu --difference box.vtu"})
    check_failure(place, call, 1, {"is one of the inputs"});
  for (const std::string& call : std::vector<std::string>{
           morph + "-o x.vtu --json ./x.vtu", morph + "-o y.vtu --json y.failed.vtu",
           morph + "-o y.vtu --cache y.vtu", "field " + morph + "-o g.cmf --json g.cmf",
           "apply x.cmf box.vtu -o y.vtu --json y.vtu", "quality box.vtu --json q --picture q",
           "compare box.vtu x.failed.vtu --difference d --json d"})
    check_failure(place, call, 1, {"two outputs"});
  check_failure(place, "quality box.vtu --json box.vtu", 1, {"another file with --json"});
  place.write("nodes.csv", "1,2,3\n");
  check_failure(place, "apply box.vtu nodes.csv -o y.vtu", 2, {"cadmorph"});
}

TEST_CASE("An output that can't be written is refused with 6 before any work", "[apps][bad]") {
  const Workplace place;
  std::filesystem::create_directory(place.folder() / "folder.vtu");
  check_failure(place, "box.step box_moved.step box.vtu -o nowhere/x.vtu", 6, {"nowhere"});
  check_failure(place, "box.step box_moved.step box.vtu -o box.step/x.vtu", 6, {"box.step"});
  check_failure(place, "box.step box_moved.step box.vtu -o folder.vtu", 6, {"folder.vtu"});
  check_failure(place, "box.step box_moved.step box.vtu -o /dev/full", 6, {"/dev/full"});
  check_failure(place, "box.step box_moved.step box.vtu --json nowhere/x.json", 6, {"nowhere"});
  check_failure(place, "box.step box_moved.step box.vtu -o /proc/x.vtu", 6, {"/proc/x.vtu"});
}

TEST_CASE("A disk that is full while writing ends with 6 and leaves nothing", "[apps][bad]") {
  const Workplace place;
  // Blocks of 512 bytes: less than the mesh needs.
  check_failure(place, "box.step box_moved.step box.vtu", 6, {"box.morphed.vtu"}, "ulimit -f 4;");
  place.write("old.vtu", "kept");
  check_failure(place, "box.step box_moved.step box.vtu -o old.vtu", 6, {"old.vtu"},
                "ulimit -f 4;");
  CHECK(place.read("old.vtu") == "kept");
  // One block is enough for the message alone.
  check_failure(place, "match box.step box_moved.step --json x.json", 6, {"x.json"},
                "ulimit -f 1;");
  const RunResult result = place.run("match box.step box_moved.step --json - > /dev/full");
  CHECK(result.exit_code == 6);
}

TEST_CASE("An empty value in a face map is refused with 2", "[apps][bad]") {
  const Workplace place;
  place.write("map.csv", "base,variant\n1,x\n");
  check_failure(place, "box.step box_moved.step box.vtu --map map.csv", 2, {"map.csv"});
}

}  // namespace cadmorph
