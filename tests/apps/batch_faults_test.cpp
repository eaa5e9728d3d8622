#include <signal.h>
#include <sys/stat.h>

#include <catch2/catch.hpp>
#include <fstream>
#include <iterator>
#include <map>
#include <memory>
#include <set>
#include <sstream>

#include "background.h"
#include "batch_folder.h"
#include "core/mesh_file.h"

namespace cadmorph {
namespace {

using namespace testing;
using Catch::Matchers::Contains;

// A STEP file that never ends: a pipe that nobody writes into.
void make_hanging(const Workplace& place, const std::string& name) {
  REQUIRE(mkfifo((place.folder() / name).c_str(), 0666) == 0);
}

std::vector<std::string> words_of(const std::string& text) {
  std::istringstream stream(text);
  return {std::istream_iterator<std::string>(stream), {}};
}

std::size_t finished(const Workplace& place, const std::string& folder) {
  return line_count(place.read(folder + "/results.jsonl"));
}

// Nothing but meshes, results, the plan and the lock.
void check_no_leftovers(const Workplace& place, const std::string& folder) {
  for (const auto& entry : std::filesystem::recursive_directory_iterator(place.folder() / folder)) {
    const std::string name = entry.path().filename().string();
    INFO(name);
    CHECK((entry.path().extension() == ".vtu" || name == "results.csv" || name == "results.jsonl" ||
           name == "batch.json" || name == ".results.lock"));
  }
}

void check_same_batch(const Workplace& place, const std::string& a, const std::string& b) {
  CHECK(rows_of(place, a) == rows_of(place, b));
  CHECK(meshes_of(place, a) == meshes_of(place, b));
  check_no_leftovers(place, a);
}

}  // namespace

TEST_CASE("A STEP file that hangs its reader fails alone after the timeout", "[apps][batch]") {
  const Workplace place;
  const std::string boxes = place.make_boxes(3);
  make_hanging(place, "hang.step");
  const RunResult batch =
      place.run("batch box.step box.vtu hang.step " + boxes + " -o out --timeout 2 --threads 2");
  CHECK(batch.exit_code == 8);
  CHECK_THAT(batch.err, Contains("hang (2): hang.step") && Contains("--timeout"));
  CHECK(rows_of(place, "out").at("hang")["exit_code"] == 2);
  CHECK(meshes_of(place, "out").size() == 3);
}

TEST_CASE("A timeout of any length is one", "[apps][batch]") {
  const Workplace place;
  const std::string command = "batch box.step box.vtu box_moved.step --timeout ";
  for (const std::string seconds : {"1e9", "1e10", "1e11", "1e300"}) {
    INFO(seconds);
    CHECK(place.run(command + seconds + " -o " + seconds).exit_code == 0);
  }
  for (const std::string seconds : {"0", "-1", "nan", "inf", "soon"}) {
    const RunResult run = place.run(command + seconds + " -o out");
    INFO(seconds << run.err);
    CHECK(run.exit_code == 1);
    CHECK_THAT(run.err, Contains("--timeout: " + seconds + ": give a number of seconds"));
  }
}

TEST_CASE("A STEP file that crashes its reader fails alone", "[apps][batch]") {
  const Workplace place;
  make_hanging(place, "bad.step");
  Background batch(place.folder(), words_of("batch box.step box.vtu bad.step " +
                                            place.make_boxes(3) + " -o out --threads 1"));
  REQUIRE(wait_for([&] { return batch.readers().size() == 1; }));
  // As a fault of OCCT's would, while the file is open.
  const pid_t reader = batch.readers().front();
  kill(reader, SIGSEGV);
  REQUIRE(wait_for([&] { return parent_of(reader) == 0; }));
  CHECK(batch.wait() == 8);
  const auto rows = rows_of(place, "out");
  CHECK(rows.at("bad")["exit_code"] == 2);
  CHECK_THAT(rows.at("bad")["message"].get<std::string>(),
             Contains("bad.step") && Contains("crashed") && Contains("signal 11"));
  CHECK(meshes_of(place, "out").size() == 3);
}

TEST_CASE("A reader that someone kills is replaced and nothing is lost", "[apps][batch]") {
  const Workplace place;
  make_hanging(place, "last.step");
  const std::string boxes = place.make_boxes(3);
  Background batch(place.folder(),
                   words_of("batch box.step box.vtu last.step " + boxes + " -o out --threads 1"));
  REQUIRE(wait_for([&] { return batch.readers().size() == 1; }));
  const pid_t first = batch.readers().front();
  // The second attempt finds a whole file.
  std::filesystem::remove(place.folder() / "last.step");
  place.write("last.step", place.read("box_moved.step"));
  kill(first, SIGKILL);
  CHECK(batch.wait() == 0);
  CHECK(rows_of(place, "out").at("last")["exit_code"] == 0);
  CHECK(meshes_of(place, "out").size() == 4);
}

#ifndef __SANITIZE_ADDRESS__  // which needs all of the address space
TEST_CASE("A batch that gets no threads for its readers ends", "[apps][batch]") {
  const Workplace place;
  // Stacks so large that there is room for those of the BLAS and of one reader.
  const RunResult batch =
      place.run("batch box.step box.vtu " + place.make_boxes(12) + " -o out --threads 2",
                "ulimit -s 2097152; ulimit -v 6000000; OPENBLAS_NUM_THREADS=2 timeout 60");
  INFO(batch.err);
  CHECK(batch.exit_code == 6);
  CHECK_THAT(batch.err, Contains("can't start a thread that reads STEP files"));
  check_no_leftovers(place, "out");
}
#endif

TEST_CASE("A variant whose reader is killed twice fails, and is tried again on --resume",
          "[apps][batch]") {
  const Workplace place;
  make_hanging(place, "last.step");
  const std::string command = "batch box.step box.vtu last.step " + place.make_boxes(2) + " -o out";
  Background batch(place.folder(), words_of(command + " --threads 1"));
  REQUIRE(wait_for([&] { return batch.readers().size() == 1; }));
  const pid_t first = batch.readers().front();
  kill(first, SIGKILL);
  REQUIRE(wait_for([&] {
    const auto readers = batch.readers();
    return readers.size() == 1 && readers.front() != first;
  }));
  kill(batch.readers().front(), SIGKILL);
  CHECK(batch.wait() == 8);
  const auto row = rows_of(place, "out").at("last");
  CHECK(row["exit_code"] == 6);
  CHECK_THAT(row["message"].get<std::string>(), Contains("last.step") && Contains("killed twice"));
  CHECK(meshes_of(place, "out").size() == 2);
  std::filesystem::remove(place.folder() / "last.step");
  place.write("last.step", place.read("box_moved.step"));
  const RunResult resumed = place.run(command + " --resume");
  CHECK(resumed.exit_code == 0);
  CHECK_THAT(resumed.out, Contains("3 of 3") && Contains("2 kept"));
}

TEST_CASE("Readers end with a batch that is killed", "[apps][batch]") {
  const Workplace place;
  make_hanging(place, "hang.step");
  Background batch(place.folder(), words_of("batch box.step box.vtu hang.step -o out"));
  REQUIRE(wait_for([&] { return batch.readers().size() == 1; }));
  const pid_t reader = batch.readers().front();
  batch.send(SIGKILL);
  CHECK(batch.wait() == -SIGKILL);
  CHECK(wait_for([&] { return kill(reader, 0) != 0 || parent_of(reader) == 0; }));
}

TEST_CASE("Killed at any point and resumed, a batch is as if it had not been", "[apps][batch]") {
  const Workplace place;
  const std::string command = "batch box.step box.vtu " + place.make_boxes(24);
  REQUIRE(place.run(command + " -o whole").exit_code == 0);
  for (const std::size_t kill_after : {0, 1, 5}) {
    Background batch(place.folder(), words_of(command + " -o out --resume"));
    REQUIRE(wait_for([&] { return finished(place, "out") > kill_after; }));
    batch.send(SIGKILL);
    batch.wait();
    CHECK(finished(place, "out") < 24);
  }
  // What a kill in the midst of writing would leave.
  std::ofstream(place.folder() / "out/results.jsonl", std::ios::app) << R"({"id":"v11","step":"v1)";
  std::filesystem::create_directory(place.folder() / "out/.results.partial");
  place.write("out/.results.partial/.cadmorph-1-1.tmp", "half a mesh");
  const std::size_t kept = finished(place, "out");
  REQUIRE(kept > 5);
  const RunResult resumed = place.run(command + " -o out --resume");
  CHECK(resumed.exit_code == 0);
  CHECK_THAT(resumed.out, Contains(std::to_string(kept) + " kept from before"));
  check_same_batch(place, "out", "whole");
}

TEST_CASE("An interrupted batch ends in order and tells how to go on", "[apps][batch]") {
  const Workplace place;
  const std::string command = "batch box.step box.vtu " + place.make_boxes(24);
  REQUIRE(place.run(command + " -o whole").exit_code == 0);
  std::size_t before = 0;
  for (const int signal : {SIGINT, SIGTERM}) {
    Background batch(place.folder(), words_of(command + " -o out --resume --threads 1"));
    REQUIRE(wait_for([&] { return finished(place, "out") > before; }));
    batch.send(signal);
    CHECK(batch.wait() == 128 + signal);
    CHECK_THAT(place.read("background.err"), Contains("interrupted") && Contains("--resume"));
    check_no_leftovers(place, "out");
    CHECK(meshes_of(place, "out").size() == finished(place, "out"));
    before = finished(place, "out");
    CHECK(before < 24);
  }
  CHECK(place.run(command + " -o out --resume").exit_code == 0);
  check_same_batch(place, "out", "whole");
}

TEST_CASE("An interrupt of a batch that has all its variants changes nothing", "[apps][batch]") {
  const Workplace place;
  REQUIRE(place.run("batch box.step box.vtu box_moved.step -o out").exit_code == 0);
  // What an earlier run left takes a while to clear away.
  const std::filesystem::path leftovers = place.folder() / "out/.results.partial";
  std::filesystem::create_directory(leftovers);
  for (int i = 0; i < 20000; ++i) std::ofstream(leftovers / std::to_string(i));
  Background batch(place.folder(), words_of("batch box.step box.vtu box_moved.step -o out "
                                            "--resume"));
  const std::string owner = "process " + std::to_string(batch.id()) + " ";
  REQUIRE(wait_for([&] { return place.read("out/.results.lock").starts_with(owner); }));
  batch.send(SIGTERM);
  CHECK(batch.wait() == 0);
  CHECK(place.read("background.err").empty());
}

TEST_CASE("An interrupt does not wait for a reader that hangs", "[apps][batch]") {
  const Workplace place;
  make_hanging(place, "hang.step");
  Background batch(place.folder(), words_of("batch box.step box.vtu hang.step -o out"));
  REQUIRE(wait_for([&] { return batch.readers().size() == 1; }));
  batch.send(SIGTERM);
  CHECK(batch.wait() == 128 + SIGTERM);
  CHECK(finished(place, "out") == 0);
}

TEST_CASE("An interrupt does not wait for the set-up of the base", "[apps][batch]") {
  const Workplace place;
  write_mesh(place.folder() / "box.vtu", box_mesh(16));  // takes a while
  for (const int signal : {SIGINT, SIGTERM}) {
    Background batch(place.folder(), words_of("batch box.step box.vtu box_moved.step -o out "
                                              "--resume --cache box.cache"));
    REQUIRE(wait_for([&] { return place.has("out/batch.json"); }));
    batch.send(signal);
    CHECK(batch.wait() == 128 + signal);
    CHECK(finished(place, "out") == 0);
    CHECK_FALSE(place.has("box.cache"));  // kept at the end of the set-up
    std::filesystem::remove_all(place.folder() / "out");
  }
}

TEST_CASE("Shards that are started twice do their share once", "[apps][batch]") {
  const Workplace place;
  const std::string command = "batch box.step box.vtu " + place.make_boxes(8);
  REQUIRE(place.run(command + " -o whole").exit_code == 0);
  std::map<std::string, std::vector<std::unique_ptr<Background>>> running;
  for (const std::string shard : {"1/2", "2/2", "1/2", "2/2"})
    running[shard].push_back(std::make_unique<Background>(
        place.folder(), words_of(command + " -o out --resume --threads 1 --shard " + shard)));
  for (const auto& [shard, twins] : running) {
    const std::multiset<int> codes = {twins[0]->wait(), twins[1]->wait()};
    INFO(shard << " " << *codes.begin() << " " << *codes.rbegin());
    CHECK(*codes.begin() == 0);
    // Refused at the lock, or late enough to find all done.
    CHECK((*codes.rbegin() == 0 || *codes.rbegin() == 6));
  }
  CHECK(place.run("batch --collect out").exit_code == 0);
  CHECK(rows_of(place, "out") == rows_of(place, "whole"));
  CHECK(meshes_of(place, "out") == meshes_of(place, "whole"));
}

TEST_CASE("A terminal shows how a batch is getting on, a file does not", "[apps][batch]") {
  const Workplace place;
  make_hanging(place, "hang.step");  // long enough for the bar to appear
  const std::string arguments =
      "batch box.step box.vtu hang.step " + place.make_boxes(3) + " --timeout 1.5 --threads 1";
  const RunResult plain = place.run(arguments + " -o plain");
  CHECK_THAT(plain.out, Contains("3 of 4 variants done"));
  CHECK_THAT(plain.err, !Contains("\x1b") && !Contains("\r"));
  if (std::system("script -qec true /dev/null > /dev/null 2>&1") != 0) {
    WARN("the terminal is skipped: there is no script");
    return;
  }
  for (const int columns : {200, 60}) {
    const std::string name = std::to_string(columns);
    const RunResult shown =
        place.run("", "script -qec 'stty columns " + name + "; " + CADMORPH_PROGRAM + " " +
                          arguments + " -o out" + name + "' /dev/null < /dev/null; true");
    INFO(shown.out);
    CHECK_THAT(shown.out, Contains("3 of 4 variants done"));
    CHECK_THAT(shown.out, Contains("\r\x1b[K"));  // taken away at the end
    std::string lines;
    int count = 0;
    for (std::size_t i = 0; (i = shown.out.find("\r[", i)) != std::string::npos; ++i) {
      const std::string line = shown.out.substr(i + 1, shown.out.find("\x1b[K", i) - i - 1);
      CHECK(line.size() < static_cast<std::size_t>(columns));
      lines += line + "\n";
      ++count;
    }
    CHECK(count >= 2);
    CHECK_THAT(lines, Contains("1 of 4 variants, ") && Contains("/s, "));
    if (columns == 200) CHECK_THAT(lines, Contains(" s left"));
  }
}

TEST_CASE("The same batch can't run twice at a time", "[apps][batch]") {
  const Workplace place;
  make_hanging(place, "hang.step");
  const std::string command = "batch box.step box.vtu hang.step box_moved.step -o out";
  Background batch(place.folder(), words_of(command + " --shard 1/2"));
  REQUIRE(wait_for([&] { return batch.readers().size() == 1; }));
  const RunResult second = place.run(command + " --shard 1/2 --resume");
  CHECK(second.exit_code == 6);
  CHECK_THAT(second.err, Contains("out/.results.1-of-2.lock") &&
                             Contains("process " + std::to_string(batch.id())));
  CHECK(place.run(command + " --shard 2/2").exit_code == 0);
  CHECK(parent_of(batch.id()) != 0);
}

TEST_CASE("A full disk stops a batch, and what was finished is kept", "[apps][batch]") {
  const Workplace place;
  write_mesh(place.folder() / "small.vtu", box_mesh(1));
  const std::string boxes = place.make_boxes(12);
  REQUIRE(place.run("batch box.step small.vtu " + boxes + " -o whole").exit_code == 0);
  // 4 kB hold a mesh, and the rows of some variants.
  const std::string command = "batch box.step small.vtu " + boxes + " -o out";
  const RunResult full = place.run(command, "ulimit -f 8;");
  INFO(full.err);
  CHECK(full.exit_code == 6);
  CHECK_THAT(full.err, Contains("can't write out/results.jsonl") && Contains("--resume"));
  CHECK(line_count(full.err) <= 2);
  CHECK(finished(place, "out") > 2);
  CHECK(finished(place, "out") < 12);
  check_no_leftovers(place, "out");
  CHECK(place.run(command + " --resume").exit_code == 0);
  check_same_batch(place, "out", "whole");
}

TEST_CASE("A disk too full for a mesh stops a batch", "[apps][batch]") {
  const Workplace place;
  const std::string bore = source_file("models/bore/").string();
  const RunResult full =
      place.run("batch " + bore + "base.step " + bore + "hex.vtu " + bore + "step05.step -o out",
                "ulimit -f 100;");
  INFO(full.err);
  CHECK(full.exit_code == 6);
  CHECK_THAT(full.err, Contains("step05.vtu") && Contains("--resume"));
  CHECK(meshes_of(place, "out").empty());
  CHECK(finished(place, "out") == 0);
  check_no_leftovers(place, "out");
}

TEST_CASE("A file system that fills up stops a batch, which goes on when there is room",
          "[apps][batch]") {
  const Workplace place;
  if (std::system("unshare -rm mount -t tmpfs none /mnt 2> /dev/null") != 0) {
    WARN("skipped: no file system can be mounted here");
    return;
  }
  const std::string command = "batch box.step box.vtu " + place.make_boxes(12);
  REQUIRE(place.run(command + " -o whole").exit_code == 0);
  // Room for some of the twelve meshes; a copy of what is there stays when the mount goes.
  const auto mesh = std::filesystem::file_size(place.folder() / "whole/v0.vtu");
  const std::string room = std::to_string(5 * mesh / 4096 * 4 + 32) + "k";
  std::filesystem::create_directory(place.folder() / "out");
  const RunResult run =
      place.run(command + " -o out --resume",
                "unshare -rm sh -c 'mount -t tmpfs -o size=" + room +
                    " none out || exit 99; \"$@\"; echo $? > codes; cp -a out full; "
                    "mount -o remount,size=64m out; \"$@\"; echo $? >> codes; cp -a out done' sh");
  INFO(run.err);
  CHECK(place.read("codes") == "6\n0\n");
  CHECK_THAT(run.err, Contains("can't write out/") && Contains("No space left on device") &&
                          Contains("--resume"));
  CHECK(finished(place, "full") > 0);
  CHECK(finished(place, "full") < 12);
  CHECK(meshes_of(place, "full").size() == finished(place, "full"));
  check_no_leftovers(place, "full");
  check_same_batch(place, "done", "whole");
}

TEST_CASE("A folder that can't be written is refused at once", "[apps][batch]") {
  const Workplace place;
  for (const std::string folder : {"/proc/out", "box.vtu", "box.vtu/out"}) {
    const RunResult batch = place.run("batch box.step box.vtu box_moved.step -o " + folder);
    INFO(folder << batch.err);
    CHECK(batch.exit_code == 6);
    CHECK_THAT(batch.err, Contains(folder));
  }
}

TEST_CASE("A damaged plan is named, and lines that are no rows don't count", "[apps][batch]") {
  const Workplace place;
  const std::string command = "batch box.step box.vtu box_moved.step box.step -o out --resume";
  REQUIRE(place.run(command).exit_code == 0);
  const std::string plan = place.read("out/batch.json"), rows = place.read("out/results.jsonl");
  const std::size_t program = plan.find("\"cadmorph ");
  REQUIRE(program != std::string::npos);
  const std::string number_for_text =
      plan.substr(0, program) + "1" + plan.substr(plan.find(',', program));
  for (const std::string& text :
       {plan.substr(0, plan.size() / 2), std::string("{\"format\":1}"), number_for_text}) {
    place.write("out/batch.json", text);
    for (const std::string& damaged : {command, std::string("batch --collect out")}) {
      const RunResult result = place.run(damaged);
      CHECK(result.exit_code == 2);
      CHECK_THAT(result.err, Contains("out/batch.json") && Contains("damaged"));
    }
  }
  place.write("out/batch.json", plan);
  place.write("out/results.jsonl", "[1]\n{\"id\":\"box\"}\nno JSON\n" + rows);
  const RunResult resumed = place.run(command);
  CHECK(resumed.exit_code == 0);
  CHECK_THAT(resumed.out, Contains("2 kept"));
  CHECK(place.read("out/results.jsonl") == rows);
}

}  // namespace cadmorph
