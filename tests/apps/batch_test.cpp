#include <catch2/catch.hpp>
#include <sstream>

#include "batch_folder.h"
#include "core/mesh_file.h"

namespace cadmorph {
namespace {

using namespace testing;
using Catch::Matchers::Contains;

// What a command of its own gives for each variant, beside the batch's own row.
void check_as_single(const Workplace& place, const std::string& base, const std::string& mesh,
                     const std::string& step, const std::string& batch_mesh,
                     const std::string& options = "") {
  const RunResult single =
      place.run(base + " " + step + " " + mesh + " -o single.vtu --quiet " + options);
  INFO(step << " " << options << single.err);
  REQUIRE(single.exit_code == 0);
  CHECK(place.read("single.vtu") == place.read(batch_mesh));
}

}  // namespace

TEST_CASE("A batch gives what single commands give, bit for bit", "[apps][batch]") {
  const Workplace place;
  const std::string bore = source_file("models/bore/").string();
  const std::string base = bore + "base.step", mesh = bore + "hex.vtu";
  const std::string steps = bore + "step05.step " + bore + "step10.step " + bore + "step20.step";
  const RunResult batch = place.run("batch " + base + " " + mesh + " " + steps + " -o out");
  INFO(batch.err);
  REQUIRE(batch.exit_code == 0);
  CHECK_THAT(batch.out, Contains("3 of 3 variants done in out"));
  for (const std::string name : {"step05", "step10", "step20"})
    check_as_single(place, base, mesh, bore + name + ".step", "out/" + name + ".vtu");
}

TEST_CASE("Options and solvers reach a batch as they do the single command", "[apps][batch]") {
  const Workplace place;
  const std::string boxes = place.make_boxes(4);
  for (const std::string options :
       {"--solver cholesky", "--solver fast --tolerance 1e-3", "--steps 2 --snap",
        "--diagnostics --threads 3", "--kernel biharmonic --threads 1"}) {
    REQUIRE(place.run("batch box.step box.vtu " + boxes + " -o out " + options).exit_code == 0);
    for (const std::string name : {"v1", "v3"})
      check_as_single(place, "box.step", "box.vtu", name + ".step", "out/" + name + ".vtu",
                      options);
    std::filesystem::remove_all(place.folder() / "out");
  }
}

TEST_CASE("Variants that need steps or repair come out of a batch as alone", "[apps][batch]") {
  const Workplace place;
  const std::string sphere = source_file("models/shapes/sphere_in_box").string();
  std::string steps;
  for (const int shift : {5, 12, 17}) {
    place.make_moved_sphere(shift);
    const std::string name = 's' + std::to_string(shift) + ".step";
    std::filesystem::rename(place.folder() / "sphere_moved.step", place.folder() / name);
    steps += name + " ";
  }
  for (const std::string options : {"--untangle never", "--steps 1 --untangle always"}) {
    INFO(options);
    const RunResult batch = place.run("batch " + sphere + ".step " + sphere + ".vtu " + steps +
                                      "-o out --cache sphere.cache " + options);
    INFO(batch.err);
    REQUIRE(batch.exit_code == 0);
    for (const std::string name : {"s5", "s12", "s17"})
      check_as_single(place, sphere + ".step", sphere + ".vtu", name + ".step",
                      "out/" + name + ".vtu", options);
    std::filesystem::remove_all(place.folder() / "out");
  }
}

TEST_CASE("A bad variant fails alone, with the single command's exit code", "[apps][batch]") {
  const Workplace place;
  const std::string whole = place.read("box.step");
  place.write("half.step", whole.substr(0, whole.size() / 2));
  place.write("list.csv",
              "id,step\ngood,box_moved.step\nmissing,none.step\nhalf,half.step\n"
              "other,box_chamfer.step\nsame,box.step\n");
  const RunResult batch = place.run("batch box.step box.vtu --manifest list.csv -o out");
  CHECK(batch.exit_code == 8);
  CHECK_THAT(batch.out, Contains("2 of 5 variants done"));
  const auto rows = rows_of(place, "out");
  REQUIRE(rows.size() == 5);
  for (const auto& [id, step] : std::map<std::string, std::string>{
           {"missing", "none.step"}, {"half", "half.step"}, {"other", "box_chamfer.step"}}) {
    INFO(id);
    const RunResult single = place.run("box.step " + step + " box.vtu -o x.vtu");
    CHECK(rows.at(id)["status"] == "failed");
    CHECK(rows.at(id)["exit_code"] == single.exit_code);
    CHECK_THAT(single.err, Catch::Matchers::StartsWith("cadmorph: error: " +
                                                       rows.at(id)["message"].get<std::string>()));
    CHECK(rows.at(id)["out"] == "");
    CHECK(rows.at(id)["inverted"].is_null());
    CHECK_THAT(batch.err, Contains(id + " (" + std::to_string(single.exit_code) + "): "));
  }
  CHECK(meshes_of(place, "out").size() == 2);
  CHECK(rows.at("good")["exit_code"] == 0);
  CHECK(rows.at("good")["min_scaled_jacobian_before"].get<double>() == Approx(1));
  CHECK(rows.at("good")["cad_deviation_mm"].get<double>() < 1e-7);
  CHECK(rows.at("good")["inverted"] == 0);
  CHECK(rows.at("good")["worst_twentieth_after"].get<double>() == Approx(1));
  CHECK(rows.at("good")["least_layer_height_ratio"].is_null());
}

TEST_CASE("A batch tells the hints of the single command", "[apps][batch]") {
  const Workplace place;
  const std::string bore = source_file("models/bore/");
  const RunResult batch = place.run("batch " + bore + "base.step " + bore + "tet.vtu " + bore +
                                    "step20.step --quality fast -o out");
  REQUIRE(batch.exit_code == 0);
  CHECK_THAT(rows_of(place, "out").at("step20")["message"].get<std::string>(),
             Contains("try --improve 0.1"));
}

TEST_CASE("A batch has a page of all its variants", "[apps][batch]") {
  const Workplace place;
  place.write(
      "list.csv",
      "id,step,width\nlong,box_moved.step,12\n<odd>,box_chamfer.step,10\nsame,box.step,10\n");
  // Without a display there are no pictures, and all else.
  const RunResult result =
      place.run("batch box.step box.vtu --manifest list.csv -o out --report page.html",
                "unset DISPLAY; PATH=/nonexistent");
  CHECK(result.exit_code == 8);
  CHECK_THAT(result.out, Contains("page.html"));
  CHECK_THAT(result.err, Contains("there is no picture"));
  const std::string page = place.read("page.html");
  CHECK_THAT(page, Contains("2 of 3 done, 1 failed") && Contains("There is no picture"));
  CHECK_THAT(page, Contains("data-variant=\"long\"") && Contains(">width<"));
  CHECK_THAT(page, Contains("&lt;odd&gt;") && !Contains("<odd>"));
  CHECK_THAT(page, Contains("failed (3)") && Contains("faces"));  // and the reason
  CHECK_THAT(page, !Contains("http://") && !Contains("https://"));
  std::filesystem::remove(place.folder() / "page.html");
  CHECK(place.run("batch --collect out --report page.html").exit_code == 8);
  CHECK_THAT(place.read("page.html"), Contains("2 of 3 done, 1 failed"));
}

TEST_CASE("A refused result goes to its own file", "[apps][batch]") {
  const Workplace place;
  const std::string bore = source_file("models/bore/").string();
  const std::string options = " --min-scaled-jacobian 0.9";  // the mesh itself is at 0.66
  const RunResult batch = place.run("batch " + bore + "base.step " + bore + "hex.vtu " + bore +
                                    "step10.step -o out" + options);
  CHECK(batch.exit_code == 8);
  const RunResult single = place.run(bore + "base.step " + bore + "step10.step " + bore +
                                     "hex.vtu -o single.vtu" + options);
  REQUIRE(single.exit_code == 5);
  CHECK(place.read("out/step10.failed.vtu") == place.read("single.failed.vtu"));
  CHECK_FALSE(place.has("out/step10.vtu"));
  const auto row = rows_of(place, "out").at("step10");
  CHECK(row["exit_code"] == 5);
  CHECK(row["out"] == "step10.failed.vtu");
  CHECK_THAT(row["message"].get<std::string>(), Contains("below 0.9"));
}

TEST_CASE("A manifest names outputs and carries columns", "[apps][batch]") {
  const Workplace place;
  place.write("list.csv",
              "\xef\xbb\xbfid,diameter,step,out,note\r\n"
              "a,1.5,box_moved.step,deep/er/a.vtu,\"with, comma and \"\"quotes\"\"\"\r\n\r\n"
              "b , 2 ,box.step,,\"two\nlines\"\r\n");
  const RunResult batch = place.run("batch box.step box.vtu --manifest list.csv -o out");
  INFO(batch.err);
  REQUIRE(batch.exit_code == 0);
  const auto rows = rows_of(place, "out");
  CHECK(rows.at("a")["out"] == "deep/er/a.vtu");
  CHECK(rows.at("a")["diameter"] == "1.5");
  CHECK(rows.at("a")["note"] == "with, comma and \"quotes\"");
  CHECK(rows.at("b")["diameter"] == "2");
  CHECK(rows.at("b")["note"] == "two\nlines");
  CHECK(place.has("out/deep/er/a.vtu"));
  CHECK(place.has("out/b.vtu"));
  const std::string csv = place.read("out/results.csv");
  CHECK(csv.starts_with("id,step,out,status,exit_code,"));
  CHECK_THAT(csv, Contains(",diameter,note\n"));
  CHECK_THAT(csv, Contains(",1.5,\"with, comma and \"\"quotes\"\"\"\n"));
  CHECK_THAT(csv, Contains(",2,\"two\nlines\"\n"));
}

TEST_CASE("Variants of a deck with included nodes have a folder each", "[apps][batch]") {
  const Workplace place;
  const Mesh mesh = MeshFile(place.folder() / "box.vtu").mesh();
  std::ostringstream nodes, cells;
  nodes.precision(17);
  for (Index n = 0; n < mesh.node_count(); ++n)
    nodes << n + 1 << ", " << mesh.points(n, 0) << ", " << mesh.points(n, 1) << ", "
          << mesh.points(n, 2) << "\n";
  for (Index c = 0; c < mesh.cell_count(); ++c) {
    REQUIRE(mesh.types[c] == CellType::Hexahedron);
    cells << c + 1;
    for (const Index node : mesh.cell(c)) cells << ", " << node + 1;
    cells << "\n";
  }
  for (const char* folder : {"deck", "alone"})
    std::filesystem::create_directory(place.folder() / folder);
  place.write("deck/nodes.inc", nodes.str());
  place.write("deck/box.inp", "*NODE, INPUT=nodes.inc\n*ELEMENT, TYPE=C3D8\n" + cells.str());
  const RunResult flat = place.run("batch box.step deck/box.inp box_moved.step box.step -o out");
  CHECK(flat.exit_code == 2);
  CHECK_THAT(flat.err, Contains("a folder of its own") && Contains("box_moved/box.inp"));
  place.write("list.csv", "id,step,out\na,box_moved.step,a/box.inp\nb,box.step,b/box.inp\n");
  const RunResult batch = place.run("batch box.step deck/box.inp --manifest list.csv -o each");
  INFO(batch.err);
  REQUIRE(batch.exit_code == 0);
  CHECK(place.read("each/b/nodes.inc") == nodes.str());
  REQUIRE(place.run("box.step box_moved.step deck/box.inp -o alone/box.inp").exit_code == 0);
  CHECK(place.read("each/a/nodes.inc") == place.read("alone/nodes.inc"));
  CHECK(place.read("each/a/box.inp") == place.read("alone/box.inp"));
}

TEST_CASE("STEP files of a manifest lie beside it", "[apps][batch]") {
  const Workplace place;
  std::filesystem::create_directory(place.folder() / "doe");
  std::filesystem::rename(place.folder() / "box_moved.step", place.folder() / "doe/m.step");
  place.write("doe/list.csv", "id,step\nm,m.step\n");
  CHECK(place.run("batch box.step box.vtu --manifest doe/list.csv -o out").exit_code == 0);
  CHECK(place.has("out/m.vtu"));
}

TEST_CASE("A manifest that makes no sense is refused with 2, and the line named", "[apps][batch]") {
  const Workplace place;
  const auto check = [&](const std::string& text, const std::vector<std::string>& words) {
    place.write("list.csv", text);
    const RunResult batch = place.run("batch box.step box.vtu --manifest list.csv -o out");
    INFO(text << batch.err);
    CHECK(batch.exit_code == 2);
    for (const std::string& word : words) CHECK_THAT(batch.err, Contains(word));
    CHECK_FALSE(place.has("out"));
  };
  check("", {"list.csv:1", "id,step"});
  check("id,step\n", {"no variant"});
  check("id,file\na,b\n", {"list.csv:1", "step"});
  check("id,step,id\n", {"\"id\"", "twice"});
  check("id,step,seconds\na,b,1\n", {"\"seconds\"", "rename"});
  check("id,step\na,box.step\nb\n", {"list.csv:3", "1 fields for 2"});
  check("id,step\na,box.step\nb,box.step\n\na,box_moved.step\n", {"list.csv:5", "\"a\"", "line 2"});
  check("id,step,out\na,box.step,x.vtu\nb,box.step,./x.vtu\n", {"list.csv:3", "x.vtu", "line 2"});
  check("id,step\na,box.step\na.failed,box.step\n", {"list.csv:3", "a.failed.vtu", "line 2"});
  check("id,step,out\na,box.step,x.su2\n", {"x.su2", ".vtu"});
  check("id,step,out\na,box.step,../x.vtu\n", {"../x.vtu", "folder"});
  check("id,step\na/b,box.step\n", {"list.csv:2", "a/b"});
  check("id,step\nresults,box.step\n", {"list.csv:2", "results"});
  check("id,step\na,\n", {"list.csv:2", "no STEP file"});
  check("id,step\na,\"box\n", {"list.csv:2", "quote"});
}

TEST_CASE("A manifest that can't be read is refused with 2, and why", "[apps][batch]") {
  const Workplace place;
  std::filesystem::create_directory(place.folder() / "folder");
  for (const auto& [manifest, why] : std::map<std::string, std::string>{
           {"folder", "Is a directory"}, {"none.csv", "No such file"}}) {
    const RunResult batch = place.run("batch box.step box.vtu --manifest " + manifest + " -o out");
    INFO(batch.err);
    CHECK(batch.exit_code == 2);
    CHECK_THAT(batch.err, Contains(manifest + ": can't be read (" + why));
  }
}

TEST_CASE("Results that can't be read stop a batch with 2, and the file named", "[apps][batch]") {
  const Workplace place;
  std::filesystem::create_directories(place.folder() / "out/results.1-of-9.jsonl");
  const RunResult batch = place.run("batch box.step box.vtu box_moved.step -o out --resume");
  INFO(batch.err);
  CHECK(batch.exit_code == 2);
  CHECK_THAT(batch.err, Contains("out/results.1-of-9.jsonl: can't be read (Is a directory)"));
}

TEST_CASE("Bad usage of batch is refused with 1", "[apps][batch]") {
  const Workplace place;
  std::filesystem::create_directory(place.folder() / "sub");
  std::filesystem::copy(place.folder() / "box.step", place.folder() / "sub/box.step");
  const auto check = [&](const std::string& arguments, const std::string& word) {
    const RunResult result = place.run("batch " + arguments);
    INFO(arguments << result.err);
    CHECK(result.exit_code == 1);
    CHECK_THAT(result.err, Contains(word));
  };
  check("", "BASE.step");
  check("box.step box.vtu box_moved.step", "-o DIR");
  check("box.step box.vtu -o out", "--manifest");
  check("box.step box.vtu box.step sub/box.step -o out", "sub/box.step");
  check("box.step box.vtu box.step -o out --shard 0/2", "--shard");
  check("box.step box.vtu box.step -o out --shard 3/2", "--shard");
  check("box.step box.vtu box.step -o out --shard 1", "--shard");
  CHECK_FALSE(place.has("out"));
}

TEST_CASE("What stops all variants stops the batch", "[apps][batch]") {
  const Workplace place;
  CHECK(place.run("batch none.step box.vtu box_moved.step -o out").exit_code == 2);
  CHECK(place.run("batch box.step none.vtu box_moved.step -o out").exit_code == 2);
  const std::string sphere = source_file("models/shapes/sphere.vtu").string();
  CHECK(place.run("batch box.step " + sphere + " box_moved.step -o out2").exit_code == 4);
}

TEST_CASE("Shards cover a batch, and --collect merges them", "[apps][batch]") {
  const Workplace place;
  const std::string command = "batch box.step box.vtu " + place.make_boxes(5);
  REQUIRE(place.run(command + " -o whole").exit_code == 0);
  REQUIRE(place.run(command + " -o out --shard 1/3").exit_code == 0);
  const RunResult early = place.run("batch --collect out");
  CHECK(early.exit_code == 8);
  CHECK_THAT(early.err, Contains("3 missing") && Contains("  v1\n") && Contains("  v2\n") &&
                            Contains("  v4\n"));
  REQUIRE(place
              .run(command + " -o out",
                   "SLURM_ARRAY_TASK_ID=8 SLURM_ARRAY_TASK_MIN=7 "
                   "SLURM_ARRAY_TASK_COUNT=3 SLURM_ARRAY_TASK_STEP=1")
              .exit_code == 0);
  CHECK(rows_of(place, "out", "results.2-of-3").size() == 2);
  REQUIRE(place
              .run(command + " -o out",
                   "SGE_TASK_ID=3 SGE_TASK_FIRST=1 SGE_TASK_LAST=3 "
                   "SGE_TASK_STEPSIZE=1")
              .exit_code == 0);
  CHECK(place.run("batch --collect out").exit_code == 0);
  CHECK(rows_of(place, "out") == rows_of(place, "whole"));
  CHECK(meshes_of(place, "out") == meshes_of(place, "whole"));
  std::filesystem::remove(place.folder() / "out/v1.vtu");
  place.write("out/v3.vtu", "cut off");
  const RunResult gone = place.run("batch --collect out");
  CHECK(gone.exit_code == 8);
  CHECK_THAT(gone.out, Contains("3 of 5"));
  CHECK_THAT(gone.err, Contains("2 missing") && Contains("  v1\n") && Contains("  v3\n"));
  const RunResult pbs = place.run(command + " -o pbs", "PBS_ARRAY_INDEX=2");
  CHECK(pbs.exit_code == 1);
  CHECK_THAT(pbs.err, Contains("--shards"));
  CHECK(place.run(command + " -o pbs --shards 4", "PBS_ARRAY_INDEX=2").exit_code == 0);
  CHECK(rows_of(place, "pbs", "results.2-of-4").size() == 1);
  CHECK(place.run(command + " -o slurm", "SLURM_ARRAY_TASK_ID=x").exit_code == 1);
  CHECK(place.run("batch --collect out box.step").exit_code == 1);
  CHECK(place.run(command + " -o all --shard 1/1", "PBS_ARRAY_INDEX=2").exit_code == 0);
  CHECK(rows_of(place, "all").size() == 5);
}

}  // namespace cadmorph
