#include <catch2/catch.hpp>
#include <fstream>
#include <nlohmann/json.hpp>
#include <random>

#include "apps/pipeline/morph_job.h"
#include "background.h"
#include "batch_folder.h"
#include "cad/step_reader.h"

namespace cadmorph {
namespace {

using namespace testing;
using Catch::Matchers::Contains;
namespace fs = std::filesystem;

nlohmann::json cache_of(const Workplace& place, const std::string& report) {
  return nlohmann::json::parse(place.read(report)).at("cache");
}

// The box of the workplace, morphed in this process.
class BoxJob {
 public:
  explicit BoxJob(const Workplace& place)
      : base_(std::make_shared<const CadModel>(read_step(place.folder() / "box.step"))),
        variant_(read_step(place.folder() / "box_moved.step")),
        mesh_(std::make_shared<const MeshFile>(place.folder() / "box.vtu")) {
    options.cache = place.folder() / "box.cache";
  }

  PipelineOptions options;
  CacheReport cache;  // of the last morph

  Index surface_nodes() const { return std::ssize(extract_boundary(mesh_->mesh()).nodes); }

  Points morph() {
    const MorphJob job(base_, mesh_, options);
    cache = job.base().report.run.cache;
    return job.morph(variant_).positions;
  }

  Points morph_without() const { return MorphJob(base_, mesh_).morph(variant_).positions; }

 private:
  std::shared_ptr<const CadModel> base_;
  CadModel variant_;
  std::shared_ptr<const MeshFile> mesh_;
};

}  // namespace

TEST_CASE("With a cache, a morph is what it is without, bit for bit", "[apps][cache]") {
  const Workplace place;
  for (const std::string options :
       {"", "--solver cholesky", "--solver fast --tolerance 1e-3", "--kernel biharmonic",
        "--solver ldlt --steps 2", "--method lbwarp", "--diagnostics --snap"}) {
    INFO(options);
    const std::string job = "box.step box_moved.step box.vtu --json r.json " + options;
    REQUIRE(place.run(job + " -o without.vtu").exit_code == 0);
    for (const std::string use : {"written", "used"}) {
      const RunResult run = place.run(job + " -o with.vtu --cache box.cache");
      INFO(run.err);
      REQUIRE(run.exit_code == 0);
      CHECK(run.err.empty());
      CHECK(cache_of(place, "r.json")["use"] == use);
      CHECK_THAT(run.out, Contains(use == "used" ? "read from box.cache" : "kept in box.cache"));
      CHECK((place.read("with.vtu") == place.read("without.vtu")));
    }
    fs::remove(place.folder() / "box.cache");
  }
}

TEST_CASE("A curved part comes out of its cache, in steps and repaired too", "[apps][cache]") {
  const Workplace place;
  const std::string bore = source_file("models/bore/").string();
  const std::string base = bore + "base.step", variant = bore + "step20.step";
  for (const std::string options : {"--steps 2", "--untangle always --improve 0.5"}) {
    const std::string job = base + " " + variant + " " + bore + "tet.vtu --quiet " + options;
    REQUIRE(place.run(job + " -o without.vtu").exit_code == 0);
    REQUIRE(place.run(job + " -o with.vtu --cache bore.cache --json r.json").exit_code == 0);
    CHECK((place.read("with.vtu") == place.read("without.vtu")));
  }
  CHECK(cache_of(place, "r.json")["use"] == "used");
}

TEST_CASE("Batches, shards and fields share a cache", "[apps][cache][batch]") {
  const Workplace place;
  const std::string command = "batch box.step box.vtu " + place.make_boxes(5);
  REQUIRE(place.run(command + " -o whole").exit_code == 0);
  REQUIRE(place.run("field box.step v1.step box.vtu -o a.cmf --cache box.cache").exit_code == 0);
  for (const std::string shard : {"1/2", "2/2"}) {
    const RunResult run = place.run(command + " -o out --cache box.cache --shard " + shard);
    INFO(run.err);
    CHECK(run.exit_code == 0);
    CHECK_THAT(run.out, Contains("base set-up read from box.cache"));
  }
  REQUIRE(place.run("batch --collect out").exit_code == 0);
  CHECK(rows_of(place, "out") == rows_of(place, "whole"));
  CHECK(meshes_of(place, "out") == meshes_of(place, "whole"));
  // The file is no part of what a batch is.
  CHECK(place.run(command + " -o out --resume").exit_code == 0);
}

TEST_CASE("A cache of anything else is made anew, with a warning", "[apps][cache]") {
  const Workplace place;
  const auto check = [&](const std::string& options, const std::string& what,
                         const std::string& program = "") {
    INFO(what);
    const std::string job =
        program + "box.step box_moved.step box.vtu --quiet --json r.json " + options;
    REQUIRE(place.run(job + " -o without.vtu").exit_code == 0);
    REQUIRE(place.run(job + " -o with.vtu --cache box.cache").exit_code == 0);
    const auto cache = cache_of(place, "r.json");
    CHECK(cache["use"] == "written");
    CHECK_THAT(cache["remark"].get<std::string>(),
               Contains("box.cache can't be used") && Contains("another " + what));
    CHECK((place.read("with.vtu") == place.read("without.vtu")));
    REQUIRE(place.run(job + " -o with.vtu --cache box.cache").exit_code == 0);
    CHECK(cache_of(place, "r.json")["use"] == "used");
  };
  const RunResult first =
      place.run("box.step box_moved.step box.vtu -o x.vtu --cache box.cache --solver lu");
  REQUIRE(first.exit_code == 0);
  check("", "solver");
  check("--tolerance 1e-4", "tolerance");
  check("--memory 1GB", "memory limit");
  check("--mesh-unit mm", "memory limit, mesh unit");
  check("--association-tolerance 0.2", "association tolerance, mesh unit");
  check("--kernel biharmonic", "association tolerance, kernel");
  check("--method femwarp", "kernel, method");
  place.write("box.step", place.read("box.step") + "\n");
  check("--method femwarp", "base CAD");
  write_mesh(place.folder() / "box.vtu", box_mesh(2));
  check("--method femwarp", "mesh");
  const RunResult told =
      place.run("box.step box_moved.step box.vtu -o x.vtu --cache box.cache --solver lu");
  CHECK_THAT(told.err, Contains("cadmorph: warning: box.cache can't be used"));
}

TEST_CASE("Another build of the program makes its own cache", "[apps][cache]") {
  const Workplace place;
  BoxJob job(place);
  // The program's file is part of the key: this test's program is another than cadmorph.
  REQUIRE(place.run("box.step box_moved.step box.vtu -o x.vtu --cache box.cache").exit_code == 0);
  CHECK(job.morph() == job.morph_without());
  CHECK(job.cache.use == CacheUse::Written);
  CHECK_THAT(job.cache.remark, Contains("another") && Contains("program"));
}

TEST_CASE("A cache is of what was read, whatever the files hold by then", "[apps][cache]") {
  const Workplace place;
  place.make_boxes(2);
  const auto check = [&](const std::function<void()>& change) {
    fs::remove(place.folder() / "box.cache");
    BoxJob early(place);
    change();
    early.morph();
    REQUIRE(early.cache.use == CacheUse::Written);
    BoxJob late(place);
    CHECK(late.morph() == late.morph_without());
    CHECK(late.cache.use == CacheUse::Written);
    CHECK(late.morph() == late.morph_without());
    CHECK(late.cache.use == CacheUse::Used);
  };
  check([&] {
    Mesh mesh = box_mesh(3);
    mesh.points.row(mesh.node_count() / 2).array() += 0.1;
    write_mesh(place.folder() / "box.vtu", mesh);
  });
  check([&] { place.write("box.step", place.read("v1.step")); });
}

TEST_CASE("Local lengths of one's own make a cache of one's own", "[apps][cache]") {
  const Workplace place;
  BoxJob job(place);
  job.options.volume.rbf.solver = SolverKind::Fast;
  job.options.volume.rbf.tolerance = 1e-2;
  job.morph();
  REQUIRE(job.cache.use == CacheUse::Written);
  job.options.volume.rbf.local_length = Eigen::VectorXd::Constant(job.surface_nodes(), 0.01);
  job.morph();
  CHECK(job.cache.use == CacheUse::Written);
  CHECK_THAT(job.cache.remark, Contains("another set of local lengths"));
}

TEST_CASE("Other libraries make their own cache", "[apps][cache]") {
  const Workplace place;
  const std::string job =
      "box.step box_moved.step box.vtu -o x.vtu --json r.json --cache box.cache";
  for (const std::string preloaded : {"", "LD_PRELOAD=libutil.so.1"}) {
    REQUIRE(place.run(job, preloaded).exit_code == 0);
    CHECK(cache_of(place, "r.json")["use"] == "written");
    REQUIRE(place.run(job, preloaded).exit_code == 0);
    CHECK(cache_of(place, "r.json")["use"] == "used");
  }
}

TEST_CASE("A damaged cache is made anew, wherever the damage is", "[apps][cache]") {
  const Workplace place;
  write_mesh(place.folder() / "box.vtu", box_mesh(2));
  BoxJob job(place);
  const Points expected = job.morph_without();
  REQUIRE(job.morph() == expected);
  REQUIRE(job.cache.use == CacheUse::Written);
  const std::string sound = place.read("box.cache");
  CHECK(job.morph() == expected);
  CHECK(job.cache.use == CacheUse::Used);
  const auto check = [&](const std::string& damaged, std::size_t at) {
    INFO("byte " << at << " of " << sound.size() << " " << job.cache.remark);
    place.write("box.cache", damaged);
    CHECK(job.morph() == expected);
    CHECK(job.cache.use == CacheUse::Written);
    CHECK_THAT(job.cache.remark, Contains("box.cache"));
    CHECK((place.read("box.cache") == sound));
  };
  std::mt19937 random(7);
  std::vector<std::size_t> places = {0, 1, 5, 18, 19, 20, 24, 30, 35, 40, sound.size() - 1};
  while (places.size() < 60) places.push_back(random() % sound.size());
  for (const std::size_t at : places) {
    std::string damaged = sound;
    damaged[at] = static_cast<char>(damaged[at] ^ (1 << random() % 8));
    check(damaged, at);
    if (at % 2 == 0) check(sound.substr(0, at), at);
  }
  check(sound + "x", sound.size());
}

TEST_CASE("A cache of another format is made anew", "[apps][cache]") {
  const Workplace place;
  BoxJob job(place);
  const Points expected = job.morph();
  std::string other = place.read("box.cache");
  const std::size_t place_of_format = other.find('\n') + 2;  // after that of the byte order
  const char own = other[place_of_format];
  for (const int step : {-1, 1}) {
    other[place_of_format] = static_cast<char>(own + step);
    place.write("box.cache", other);
    CHECK(job.morph() == expected);
    CHECK(job.cache.use == CacheUse::Written);
    CHECK_THAT(job.cache.remark, Contains("format") && Contains(step > 0 ? "newer" : "older"));
  }
}

TEST_CASE("A cache that can't be written stops nothing", "[apps][cache]") {
  const Workplace place;
  const std::string job = "box.step box_moved.step box.vtu --json r.json ";
  REQUIRE(place.run(job + "-o without.vtu").exit_code == 0);
  for (const std::string cache : {"/proc/box.cache", "none/box.cache", "box.vtu/box.cache", "."}) {
    const RunResult run = place.run(job + "-o with.vtu --cache " + cache);
    INFO(cache << run.err);
    CHECK(run.exit_code == 0);
    CHECK_THAT(run.err, Contains("cadmorph: warning: ") && Contains("can't write " + cache));
    CHECK(cache_of(place, "r.json")["use"] == "not written");
    CHECK((place.read("with.vtu") == place.read("without.vtu")));
  }
  // A full disk.
  const RunResult full = place.run(job + "-o with.vtu --cache box.cache --quiet", "ulimit -f 64;");
  CHECK(full.exit_code == 0);
  CHECK(cache_of(place, "r.json")["use"] == "not written");
  CHECK_FALSE(place.has("box.cache"));
  for (const std::string& name : place.files()) CHECK_FALSE(Catch::contains(name, ".tmp"));
}

TEST_CASE("A file that can't be opened is left as it is, with a warning", "[apps][cache]") {
  const Workplace place;
  place.write("box.cache", "secret");
  fs::permissions(place.folder() / "box.cache", fs::perms::none);
  // Root can open it, unless it has lost its capabilities.
  const bool is_root = std::ifstream(place.folder() / "box.cache").is_open();
  const RunResult run =
      place.run("box.step box_moved.step box.vtu -o x.vtu --json r.json --cache box.cache",
                is_root ? "setpriv --inh-caps=-all --bounding-set=-all" : "");
  INFO(run.err);
  CHECK(run.exit_code == 0);
  CHECK_THAT(run.err, Contains("box.cache: can't be read (Permission denied)"));
  CHECK(cache_of(place, "r.json")["use"] == "not written");
  fs::permissions(place.folder() / "box.cache", fs::perms::owner_read);
  CHECK(place.read("box.cache") == "secret");
}

TEST_CASE("A file that is no cache is not overwritten", "[apps][cache]") {
  const Workplace place;
  place.write("thesis.txt", "Ten years of work.\n");
  const RunResult run = place.run("box.step box_moved.step box.vtu -o x.vtu --cache thesis.txt");
  CHECK(run.exit_code == 2);
  CHECK_THAT(run.err, Contains("thesis.txt") && Contains("no cache") && Contains("--cache"));
  CHECK((place.read("thesis.txt") == "Ten years of work.\n"));
  CHECK(
      place.run("batch box.step box.vtu box_moved.step -o out --cache box_moved.step").exit_code ==
      2);
  for (const std::string input : {"box.step", "box.vtu", "x.vtu"})
    CHECK(place.run("box.step box_moved.step box.vtu -o x.vtu --cache " + input).exit_code == 1);
}

TEST_CASE("Programs that share a cache at the same time don't disturb each other",
          "[apps][cache]") {
  const Workplace place;
  const std::string bore = source_file("models/bore/").string();
  const auto arguments = [&](int i) -> std::vector<std::string> {
    return {bore + "base.step",
            bore + "step10.step",
            bore + "hex.vtu",
            "--cache",
            "bore.cache",
            "-o",
            std::to_string(i) + ".vtu",
            "--threads",
            "1"};
  };
  REQUIRE(place.run(bore + "base.step " + bore + "step10.step " + bore + "hex.vtu -o one.vtu")
              .exit_code == 0);
  for (int round = 0; round < 2; ++round) {
    std::vector<std::unique_ptr<Background>> running;
    for (int i = 0; i < 4; ++i)
      running.push_back(std::make_unique<Background>(place.folder(), arguments(i)));
    for (int i = 0; i < 4; ++i) {
      CHECK(running[i]->wait() == 0);
      CHECK(place.read(std::to_string(i) + ".vtu") == place.read("one.vtu"));
    }
  }
  for (const std::string& name : place.files()) CHECK_FALSE(Catch::contains(name, ".tmp"));
}

}  // namespace cadmorph
