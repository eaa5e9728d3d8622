#include "core/content_hash.h"

#include <unistd.h>

#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>
#include <string>

#include "core/errors.h"

using namespace cadmorph;

TEST_CASE("Content hashes are XXH3's", "[core][hash]") {
  // xxhsum -H2 of nothing and of "cadmorph".
  CHECK(content_hash("") == "99aa06d3014798d86001c324468d497f");
  CHECK(content_hash("cadmorph") == "85b129598fb2ebebf85d36bf88c66d14");
}

TEST_CASE("A file's hash is that of its bytes", "[core][hash]") {
  const auto path =
      std::filesystem::temp_directory_path() / ("cadmorph_hash." + std::to_string(getpid()));
  std::string bytes(700001, 'a');
  for (std::size_t i = 0; i < bytes.size(); ++i) bytes[i] = static_cast<char>(i * i / 7);
  std::ofstream(path, std::ios::binary) << bytes;
  CHECK(file_hash(path) == content_hash(bytes));
  std::filesystem::remove(path);
  CHECK_THROWS_AS(file_hash(path), IoError);
}
TEST_CASE("The hash of a case is that of the files of its mesh", "[core][hash]") {
  namespace fs = std::filesystem;
  const fs::path folder = fs::temp_directory_path() / ("cadmorph_hash_" + std::to_string(getpid()));
  const auto put = [&](const fs::path& name, const std::string& text) {
    fs::create_directories((folder / name).parent_path());
    std::ofstream(folder / name) << text;
  };
  put("constant/polyMesh/points", "0 0 0");
  put("processor0/constant/polyMesh/points", "0 0 0");
  put("0/U", "0");
  const std::string before = mesh_hash(folder);
  put("0/U", "1");
  CHECK(mesh_hash(folder) == before);
  CHECK(mesh_hash(folder / "constant/polyMesh") != before);
  put("processor0/constant/polyMesh/points", "0 0 1");
  CHECK(mesh_hash(folder) != before);
  CHECK(mesh_hash(folder / "0/U") == file_hash(folder / "0/U"));
  fs::remove_all(folder);
}
