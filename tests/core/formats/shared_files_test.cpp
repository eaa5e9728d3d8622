// Files of others in every format, in a folder outside the project: CADMORPH_FORMATS names it.

#include <catch2/catch.hpp>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

#include "core/errors.h"
#include "tests/core/formats/format_checks.h"

namespace cadmorph::test {
namespace {

namespace fs = std::filesystem;

/// An OpenFOAM case, or a file that is no CAD and no text about the files.
std::vector<fs::path> meshes_in(const fs::path& folder) {
  std::vector<fs::path> result;
  for (const auto& entry : fs::directory_iterator(folder)) {
    const fs::path path = entry.path();
    if (fs::is_directory(path / "constant/polyMesh"))
      result.push_back(path);
    else if (entry.is_directory())
      for (const fs::path& inner : meshes_in(path)) result.push_back(inner);
    else if (path.extension() != ".step" && path.extension() != ".md")
      result.push_back(path);
  }
  return result;
}

/// What an affine map of a file loses to its columns or single precision, of the largest
/// coordinate.
double rounding(const MeshFile& file) {
  if (file.format() == "LS-DYNA") return 1e-9;  // 16 columns
  if (file.format() == "Abaqus") return 1e-13;  // 20 characters
  if (file.format() == "Ansys") return 1e-12;   // as its NBLOCK says
  return 0;
}

}  // namespace

TEST_CASE("Files of others come back with other coordinates alone", "[.][shared-formats]") {
  const char* folder = std::getenv("CADMORPH_FORMATS");
  REQUIRE(folder);
  int count = 0;
  for (const fs::path& path : meshes_in(folder)) {
    INFO(path);
    const MeshFile file(path);
    const FormatFolder scratch;
    require_promise(path, scratch, path.filename().string(), rounding(file));
    ++count;
  }
  CHECK(count >= 10);
}

}  // namespace cadmorph::test
