#include "core/temporary_file.h"

#include <sys/wait.h>
#include <unistd.h>

#include <catch2/catch.hpp>
#include <csignal>
#include <fstream>

#include "core/errors.h"
#include "core/interrupt.h"
#include "tests/core/formats/format_checks.h"

namespace fs = std::filesystem;

namespace cadmorph::test {
namespace {

Index count_entries(const fs::path& folder) {
  return std::distance(fs::directory_iterator(folder), fs::directory_iterator());
}

}  // namespace

TEST_CASE("A temporary folder appears whole or not at all", "[core]") {
  const FormatFolder folder;
  {
    const TemporaryFolder dropped(folder / "new");
    std::ofstream(dropped.path() / "file") << "text";
  }
  CHECK(count_entries(folder / "") == 0);
  TemporaryFolder kept(folder / "new/");
  std::ofstream(kept.path() / "file") << "text";
  CHECK(!fs::exists(folder / "new"));
  kept.commit();
  CHECK(bytes_of(folder / "new/file") == "text");
  CHECK(count_entries(folder / "") == 1);
}

TEST_CASE("A temporary folder takes the place of one that is there", "[core]") {
  const FormatFolder folder;
  folder.put("real/old", "old");
  fs::create_directory_symlink("real", folder / "link");
  TemporaryFolder next(folder / "link");
  std::ofstream(next.path() / "new") << "new";
  next.commit();
  CHECK(fs::is_symlink(folder / "link"));
  CHECK(bytes_of(folder / "real/new") == "new");
  CHECK(!fs::exists(folder / "real/old"));
  CHECK(count_entries(folder / "") == 2);
}

TEST_CASE("A temporary folder does not take the place of a file", "[core]") {
  const FormatFolder folder;
  folder.put("file", "text");
  REQUIRE_THROWS_AS(TemporaryFolder(folder / "file"), IoError);
  REQUIRE_THROWS_AS(TemporaryFolder(folder / "none/new"), IoError);
  CHECK(count_entries(folder / "") == 1);
}

TEST_CASE("An interrupt takes temporary files and folders along", "[core]") {
  const FormatFolder folder;
  const int signal = GENERATE(SIGINT, SIGTERM, SIGHUP);
  const pid_t child = fork();
  if (child == 0) {
    std::signal(signal, SIG_DFL);
    remove_temporaries_at_interrupt();
    const TemporaryFolder unfinished(folder / "new");
    std::ofstream(unfinished.path() / "file") << "text";
    const TemporaryFile file(folder / "file");
    kill(getpid(), signal);
    pause();
    _exit(0);
  }
  int status = 0;
  REQUIRE(waitpid(child, &status, 0) == child);
  CHECK(WIFSIGNALED(status));
  CHECK(WTERMSIG(status) == signal);
  CHECK(count_entries(folder / "") == 0);
}

}  // namespace cadmorph::test
