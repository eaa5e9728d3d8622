#include "core/mesh_comparison.h"

#include <unistd.h>

#include <catch2/catch.hpp>
#include <fstream>
#include <string>

namespace fs = std::filesystem;

namespace cadmorph {
namespace {

// A vertex with one integer value.
MeshFile vertex_with(const std::string& type, const std::string& value) {
  const fs::path path =
      fs::temp_directory_path() / ("cadmorph-" + std::to_string(getpid()) + ".vtu");
  std::ofstream(path) << R"(<VTKFile type="UnstructuredGrid"><UnstructuredGrid>
<Piece NumberOfPoints="1" NumberOfCells="1"><PointData><DataArray type=")"
                      << type << R"(" Name="id" format="ascii">)" << value << R"(</DataArray>
</PointData><Points>
<DataArray type="Float64" NumberOfComponents="3" format="ascii">0 0 0</DataArray></Points><Cells>
<DataArray type="Int64" Name="connectivity" format="ascii">0</DataArray>
<DataArray type="Int64" Name="offsets" format="ascii">1</DataArray>
<DataArray type="UInt8" Name="types" format="ascii">1</DataArray></Cells></Piece>
</UnstructuredGrid></VTKFile>)";
  MeshFile file(path);
  fs::remove(path);
  return file;
}

}  // namespace

TEST_CASE("Integers of 64 bits are compared exactly", "[core][compare]") {
  for (const std::string type : {"Int64", "UInt64"}) {
    // 2^53 and the number after it are one double.
    const MeshFile reference = vertex_with(type, "9007199254740992");
    CHECK(compare_meshes(reference, vertex_with(type, "9007199254740992")).is_same());
    CompareOptions loose;
    loose.tolerance = 1;
    const MeshComparison result =
        compare_meshes(reference, vertex_with(type, "9007199254740993"), loose);
    REQUIRE(result.arrays.size() == 1);
    CHECK(result.arrays[0].differing == 1);
    CHECK(result.arrays[0].worst_row == 0);
    CHECK(result.arrays[0].largest == 1);
  }
}

}  // namespace cadmorph
