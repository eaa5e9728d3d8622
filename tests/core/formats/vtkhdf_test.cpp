#include <catch2/catch.hpp>
#include <string>

#include "tests/core/formats/format_checks.h"
#include "tests/core/formats/hdf5_writer.h"

namespace fs = std::filesystem;

namespace cadmorph::test {
namespace {

/// A tetrahedron, and in a second part a pyramid with its own points.
struct Contents {
  std::string type = "UnstructuredGrid";
  std::vector<int> nodes{4, 5}, cells{1, 1}, sizes{4, 5};
  std::vector<int> types{10, 14}, offsets{0, 4, 0, 5}, connectivity{0, 1, 2, 3, 0, 1, 2, 3, 4};
  Storage storage{.shape = {9, 3}};
};

fs::path grid_file(const fs::path& path, const Contents& contents = {}) {
  Hdf5Writer out(path);
  out.group("/VTKHDF");
  out.attribute("/VTKHDF", "Version", std::vector{1, 0});
  out.attribute("/VTKHDF", "Type", contents.type);
  out.numbers("/VTKHDF/Points", {0, 0, 0, 1,   0, 0, 0, 1, 0, 0, 0,   1,   2, 0,
                                 0, 3, 0, 0.1, 3, 1, 0, 2, 1, 0, 2.5, 0.5, 1},
              contents.storage);
  out.integers("/VTKHDF/NumberOfPoints", contents.nodes);
  out.integers("/VTKHDF/NumberOfCells", contents.cells);
  out.integers("/VTKHDF/NumberOfConnectivityIds", contents.sizes);
  out.integers("/VTKHDF/Types", contents.types, {.shape = {}, .type = H5T_STD_U8LE});
  out.integers("/VTKHDF/Offsets", contents.offsets);
  out.integers("/VTKHDF/Connectivity", contents.connectivity);
  out.group("/VTKHDF/PointData");
  out.numbers("/VTKHDF/PointData/heat", {1, 2, 3, 4, 5, 6, 7, 8, 9});
  return path;
}

}  // namespace

TEST_CASE("A VTKHDF file gives the cells of all its parts", "[core][formats]") {
  const FormatFolder folder;
  const MeshFile file(grid_file(folder / "grid.vtkhdf"));
  const Mesh& mesh = file.mesh();
  CHECK(file.format() == "VTKHDF");
  CHECK(mesh.types == std::vector{CellType::Tetra, CellType::Pyramid});
  CHECK(mesh.connectivity == std::vector<Index>{0, 1, 2, 3, 4, 5, 6, 7, 8});
  CHECK(mesh.points.row(8) == Eigen::RowVector3d(2.5, 0.5, 1));
}

TEST_CASE("VTKHDF files come back with other coordinates alone", "[core][formats]") {
  const FormatFolder folder;
  require_promise(grid_file(folder / "grid.vtkhdf"), folder, "out.vtkhdf");
  Contents contents;
  contents.storage = {.shape = {9, 3}, .chunk = {4, 3}};
  require_promise(grid_file(folder / "chunks.hdf", contents), folder, "out.hdf");
  contents.storage.is_compressed = true;
  require_promise(grid_file(folder / "deflate.hdf", contents), folder, "out.hdf");
}

TEST_CASE("Bad VTKHDF files are refused by dataset", "[core][formats]") {
  const FormatFolder folder;
  const auto refused = [&](const Contents& contents, std::initializer_list<std::string> parts) {
    require_refused(grid_file(folder / "bad.vtkhdf", contents), parts);
  };
  refused({.type = "ImageData"}, {"bad.vtkhdf", "ImageData", "UnstructuredGrid"});
  refused({.types = {10, 42}}, {"cell 1", "polyhedron"});
  refused({.types = {10, 77}}, {"cell 1", "type 77"});
  refused({.offsets = {0, 5, 0, 5}}, {"Offsets", "cell 0"});
  refused({.connectivity = {0, 1, 2, 4, 0, 1, 2, 3, 4}}, {"cell 0", "point 4 of 4"});
  refused({.cells = {1, 2}}, {"part 1", "larger"});
  refused({.nodes = {4, 4}}, {"point 4 of 4"});
}

TEST_CASE("Damaged VTKHDF files never crash the reader", "[core][formats]") {
  const FormatFolder folder;
  require_robust(grid_file(folder / "grid.vtkhdf"), folder);
}

}  // namespace cadmorph::test
