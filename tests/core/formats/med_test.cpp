#include <array>
#include <catch2/catch.hpp>
#include <string>

#include "tests/core/formats/format_checks.h"
#include "tests/core/formats/hdf5_writer.h"

namespace fs = std::filesystem;

namespace cadmorph::test {
namespace {

const std::string kStep = "-0000000000000000001-0000000000000000001";

/// Makes MED files of one mesh as the library's version 3 and later has them.
class MedWriter {
 public:
  explicit MedWriter(const fs::path& path, int dimensions = 3) : out_(path) {
    out_.group("/ENS_MAA");
    out_.group("/ENS_MAA/part");
    out_.attribute("/ENS_MAA/part", "DIM", std::vector{dimensions});
    out_.attribute("/ENS_MAA/part", "ESP", std::vector{dimensions});
    out_.attribute("/ENS_MAA/part", "TYP", std::vector{0});
    out_.attribute("/ENS_MAA/part", "REP", std::vector{0});
    for (const char* group : {"", "/NOE", "/MAI"}) out_.group(step() + group);
    for (const char* group : {"/FAS", "/FAS/part", "/FAS/part/NOEUD", "/FAS/part/ELEME"})
      out_.group(group);
  }

  Hdf5Writer& file() { return out_; }
  static std::string step() { return "/ENS_MAA/part/" + kStep; }

  /// Rows of points, written a component after the other.
  void points(const std::vector<std::vector<double>>& rows, const std::vector<int>& families,
              const Storage& storage = {}) {
    std::vector<double> all;
    for (std::size_t c = 0; c < rows[0].size(); ++c)
      for (const auto& row : rows) all.push_back(row[c]);
    out_.numbers(step() + "/NOE/COO", all, storage);
    out_.integers(step() + "/NOE/FAM", families);
  }
  void elements(const std::string& type, const std::vector<std::vector<int>>& rows,
                const std::vector<int>& families) {
    std::vector<int> all;
    for (std::size_t i = 0; i < rows[0].size(); ++i)
      for (const auto& row : rows) all.push_back(row[i]);
    lists(type, {{"NOD", all}, {"FAM", families}});
  }
  void lists(const std::string& type,
             const std::vector<std::pair<std::string, std::vector<int>>>& arrays) {
    out_.group(step() + "/MAI/" + type);
    for (const auto& [name, values] : arrays)
      out_.integers(step() + "/MAI/" + type + "/" + name, values);
  }
  void family(const std::string& kind, int number, const std::vector<std::string>& names) {
    const std::string group = "/FAS/part/" + kind + "/FAM_" + std::to_string(number);
    out_.group(group);
    out_.attribute(group, "NUM", std::vector{number});
    out_.group(group + "/GRO");
    constexpr hsize_t kLength = 80;
    std::string all;
    for (std::string name : names) {
      name.resize(kLength);
      all += name;
    }
    // As the library writes it: an array of names, each an array of bytes.
    const hid_t type = H5Tarray_create2(H5T_STD_I8LE, 1, &kLength);
    const hsize_t count = names.size();
    const hid_t space = H5Screate_simple(1, &count, nullptr);
    const hid_t set = H5Dcreate2(out_.file(), (group + "/GRO/NOM").c_str(), type, space,
                                 H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
    REQUIRE(H5Dwrite(set, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, all.data()) >= 0);
    H5Dclose(set);
    H5Sclose(space);
    H5Tclose(type);
  }

 private:
  Hdf5Writer out_;
};

/// Two tetrahedra and a pyramid with a triangle on one of its faces, in two families.
fs::path solid_file(const fs::path& path, const Storage& storage = {}) {
  MedWriter out(path);
  out.points({{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0.5, 0.5, 1}, {2, 0.5, 0.25}, {0, 0, 2}},
             {0, 2, 0, 0, 2, 0, 0}, storage);
  out.elements("TE4", {{2, 6, 3, 5}, {1, 2, 5, 7}}, {-1, -2});
  out.elements("PY5", {{1, 2, 3, 4, 5}}, {-1});
  out.elements("TR3", {{1, 2, 5}}, {-3});
  out.family("NOEUD", 2, {"held"});
  out.family("ELEME", -1, {"steel"});
  out.family("ELEME", -2, {"copper"});
  out.family("ELEME", -3, {"wall", "front"});
  return path;
}

using Nodes = std::vector<Index>;

}  // namespace

TEST_CASE("A MED file gives its cells, groups and families", "[core][formats]") {
  const FormatFolder folder;
  const MeshFile file(solid_file(folder / "solid.med"));
  const Mesh& mesh = file.mesh();
  CHECK(file.format() == "MED");
  CHECK(mesh.types ==
        std::vector{CellType::Tetra, CellType::Tetra, CellType::Pyramid, CellType::Triangle});
  CHECK(mesh.connectivity == Nodes{1, 5, 2, 4, 0, 1, 4, 6, 0, 1, 2, 3, 4, 0, 1, 4});
  CHECK(mesh.points.row(5) == Eigen::RowVector3d(2, 0.5, 0.25));
  CHECK(mesh.regions == std::vector<int>{-1, -2, -1, -3});
  REQUIRE(mesh.groups.size() == 5);
  CHECK(mesh.groups[0].name == "held");
  CHECK(mesh.groups[0].kind == "node group");
  CHECK(mesh.groups[0].nodes == Nodes{1, 4});
  CHECK(mesh.groups[1].name == "steel");
  CHECK(mesh.groups[1].nodes == Nodes{0, 1, 2, 3, 4, 5});
  CHECK(mesh.groups[3].name == "wall");
  CHECK(mesh.groups[3].kind == "element group");
  CHECK(mesh.groups[4].name == "front");
  CHECK(mesh.groups[4].nodes == Nodes{0, 1, 4});
}

TEST_CASE("MED polygons and polyhedra are read", "[core][formats]") {
  const FormatFolder folder;
  const fs::path path = folder / "poly.med";
  {
    MedWriter out(path);
    out.points({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 1, 0}}, {0, 0, 0, 0, 0});
    out.lists("POE", {{"NOD", {1, 3, 2, 1, 2, 4, 2, 3, 4, 3, 1, 4}},
                      {"IFN", {1, 4, 7, 10, 13}},
                      {"INN", {1, 5}}});
    out.lists("POG", {{"NOD", {1, 2, 5, 3, 1, 2, 3}}, {"INN", {1, 5, 8}}});
  }
  const MeshFile file(path);
  const Mesh& mesh = file.mesh();
  CHECK(mesh.types == std::vector{CellType::Polyhedron, CellType::Polygon, CellType::Polygon});
  const auto facets = cell_facets(mesh, 0);
  REQUIRE(facets.size() == 4);
  CHECK(facets[2].nodes == Nodes{1, 2, 3});
  CHECK(mesh.cell(1).size() == 4);
  CHECK(mesh.regions.empty());
  require_promise(path, folder, "out.med");
}

TEST_CASE("MED files come back with other coordinates alone", "[core][formats]") {
  const FormatFolder folder;
  require_promise(solid_file(folder / "solid.med"), folder, "out.med");
  require_promise(
      solid_file(folder / "deflate.med", {.shape = {21}, .chunk = {8}, .is_compressed = true}),
      folder, "out.med");
  {
    MedWriter out(folder / "plane.med", 2);
    out.points({{0, 0}, {1, 0}, {0.25, 1}}, {0, 0, 0});
    out.elements("TR3", {{1, 2, 3}}, {0});
  }
  require_promise(folder / "plane.med", folder, "out.med");
}

TEST_CASE("Bad MED files are refused by object", "[core][formats]") {
  const FormatFolder folder;
  const fs::path path = folder / "bad.med";
  const auto refused = [&](const auto& write, std::initializer_list<std::string> parts) {
    {
      MedWriter out(path);
      out.points({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, {0, 0, 0, 0});
      write(out);
    }
    require_refused(path, parts);
  };
  refused(
      [](MedWriter& out) {
        out.elements("TE4", {{1, 2, 3, 5}}, {0});
      },
      {"bad.med", "TE4/NOD", "node 5", "4 nodes"});
  refused([](MedWriter& out) { out.elements("O12", {{1, 2, 3, 4}}, {0}); }, {"O12", "not known"});
  refused([](MedWriter& out) { out.elements("TE4", {{1, 2, 3}}, {0}); }, {"3 nodes"});
  refused(
      [](MedWriter& out) {
        out.elements("TE4", {{1, 2, 3, 4}}, {0, 0});
      },
      {"TE4/FAM", "2 families"});
  refused([](MedWriter& out) { out.file().group("/ENS_MAA/other"); },
          {"more than one mesh", "part, other"});
  refused([](MedWriter& out) { out.file().group("/ENS_MAA/part/later"); },
          {"more than one time step", "later"});
}

TEST_CASE("Damaged MED files never crash the reader", "[core][formats]") {
  const FormatFolder folder;
  require_robust(solid_file(folder / "solid.med"), folder);
}

}  // namespace cadmorph::test
