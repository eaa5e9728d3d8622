#include <netcdf.h>

#include <catch2/catch.hpp>
#include <numeric>
#include <string>

#include "tests/core/formats/format_checks.h"

namespace fs = std::filesystem;

namespace cadmorph::test {
namespace {

/// Makes netCDF files with netCDF's own library.
class NetcdfWriter {
 public:
  NetcdfWriter(const fs::path& path, int mode) {
    require(nc_create(path.c_str(), NC_CLOBBER | mode, &file_));
    int old = 0;
    nc_set_fill(file_, NC_NOFILL, &old);
  }
  ~NetcdfWriter() { nc_close(file_); }
  NetcdfWriter(const NetcdfWriter&) = delete;
  NetcdfWriter& operator=(const NetcdfWriter&) = delete;

  int dimension(const std::string& name, std::size_t length) {
    int id = 0;
    if (nc_inq_dimid(file_, name.c_str(), &id) != NC_NOERR) {
      define();
      require(nc_def_dim(file_, name.c_str(), length, &id));
    }
    return id;
  }
  void numbers(const std::string& name, const std::vector<int>& dimensions,
               const std::vector<double>& values, nc_type type = NC_DOUBLE, int deflate = 0) {
    const int id = variable(name, dimensions, type);
    if (deflate > 0) require(nc_def_var_deflate(file_, id, 1, 1, deflate));
    require_data();
    require(nc_put_var_double(file_, id, values.data()));
  }
  int integers(const std::string& name, const std::vector<int>& dimensions,
               const std::vector<int>& values) {
    const int id = variable(name, dimensions, NC_INT);
    require_data();
    require(nc_put_var_int(file_, id, values.data()));
    return id;
  }
  void texts(const std::string& name, const std::vector<int>& dimensions,
             const std::vector<std::string>& rows, std::size_t length) {
    const int id = variable(name, dimensions, NC_CHAR);
    std::string all;
    for (std::string row : rows) {
      row.resize(length);
      all += row;
    }
    require_data();
    require(nc_put_var_text(file_, id, all.data()));
  }
  void attribute(int variable, const std::string& name, const std::string& text) {
    define();
    require(nc_put_att_text(file_, variable, name.c_str(), text.size(), text.data()));
  }
  void block(int number, const std::string& type, int size, const std::vector<int>& connectivity) {
    const std::string n = std::to_string(number);
    const int elements = dimension("num_el_in_blk" + n, connectivity.size() / std::size_t(size));
    const int id =
        integers("connect" + n, {elements, dimension("num_nod_per_el" + n, std::size_t(size))},
                 connectivity);
    attribute(id, "elem_type", type);
  }

 private:
  int variable(const std::string& name, const std::vector<int>& dimensions, nc_type type) {
    define();
    int id = 0;
    require(nc_def_var(file_, name.c_str(), type, int(dimensions.size()), dimensions.data(), &id));
    return id;
  }
  void define() { nc_redef(file_); }  // an error where it is in that mode already
  void require_data() { require(nc_enddef(file_)); }
  static void require(int code) {
    INFO(nc_strerror(code));
    REQUIRE(code == NC_NOERR);
  }

  int file_ = 0;
};

struct Form {
  int mode = 0;
  nc_type type = NC_DOUBLE;
  int deflate = 0;
  bool is_one_array = false;  ///< "coord" instead of "coordx", ...
};

const std::vector<double> kX = {0, 1, 2, 0, 1, 2, 0, 1, 2, 0, 1, 2, 0.5};
const std::vector<double> kY = {0, 0, 0, 1, 1, 1, 0, 0, 0, 1, 1, 1, 0.5};
const std::vector<double> kZ = {0, 0, 0, 0, 0, 0, 1, 1, 1, 1, 1, 1, 1.75};

/// A hexahedron with a pyramid on top, a wedge, a shell and a bar; sets of nodes and sides.
fs::path solid_file(const fs::path& path, const Form& form = {}) {
  NetcdfWriter out(path, form.mode);
  const int nodes = out.dimension("num_nodes", 13), blocks = out.dimension("num_el_blk", 5),
            length = out.dimension("len_name", 33);
  if (form.is_one_array) {
    std::vector<double> all = kX;
    all.insert(all.end(), kY.begin(), kY.end());
    all.insert(all.end(), kZ.begin(), kZ.end());
    out.numbers("coord", {out.dimension("num_dim", 3), nodes}, all, form.type, form.deflate);
  } else {
    out.numbers("coordx", {nodes}, kX, form.type, form.deflate);
    out.numbers("coordy", {nodes}, kY, form.type, form.deflate);
    out.numbers("coordz", {nodes}, kZ, form.type, form.deflate);
  }
  out.integers("eb_prop1", {blocks}, {10, 20, 30, 40, 50});
  out.texts("eb_names", {blocks, length}, {"cube", "", "wedges", "", ""}, 33);
  out.block(1, "HEX8", 8, {1, 2, 5, 4, 7, 8, 11, 10});
  out.block(2, "PYRAMID5", 5, {7, 8, 11, 10, 13});
  out.block(3, "wedge", 6, {2, 3, 5, 8, 9, 11});
  out.block(4, "SHELL4", 4, {2, 3, 9, 8});
  out.block(5, "TRUSS", 2, {3, 6});
  const int sets = out.dimension("num_node_sets", 2), sides = out.dimension("num_side_sets", 2);
  out.integers("ns_prop1", {sets}, {3, 4});
  out.texts("ns_names", {sets, length}, {"corner", ""}, 33);
  out.integers("node_ns1", {out.dimension("num_nod_ns1", 1)}, {1});
  out.integers("node_ns2", {out.dimension("num_nod_ns2", 2)}, {5, 2});
  out.integers("ss_prop1", {sides}, {1, 2});
  out.texts("ss_names", {sides, length}, {"floor", "skin"}, 33);
  const int two = out.dimension("num_side_ss1", 2);
  out.integers("elem_ss1", {two}, {1, 3});
  out.integers("side_ss1", {two}, {5, 4});
  out.integers("elem_ss2", {two}, {4, 2});
  out.integers("side_ss2", {two}, {3, 1});
  return path;
}

const std::vector<Form> kForms = {
    {},
    {.is_one_array = true},
    {.mode = NC_64BIT_OFFSET},
    {.mode = NC_64BIT_DATA},
    {.mode = NC_NETCDF4},
    {.mode = NC_NETCDF4, .is_one_array = true},
    {.mode = NC_NETCDF4, .deflate = 5},
    {.mode = NC_NETCDF4 | NC_CLASSIC_MODEL},
};

using Nodes = std::vector<Index>;

}  // namespace

TEST_CASE("An Exodus file gives its blocks and sets", "[core][formats]") {
  const FormatFolder folder;
  const std::size_t form = GENERATE(range(std::size_t{0}, kForms.size()));
  INFO("form " << form);
  const MeshFile file(solid_file(folder / "solid.exo", kForms[form]));
  const Mesh& mesh = file.mesh();
  CHECK(file.format() == "Exodus II");
  CHECK(mesh.types == std::vector{CellType::Hexahedron, CellType::Pyramid, CellType::Wedge,
                                  CellType::Quad, CellType::Line});
  CHECK(mesh.connectivity ==
        Nodes{0, 1, 4, 3, 6, 7, 10, 9, 6, 7, 10, 9, 12, 1, 2, 4, 7, 8, 10, 1, 2, 8, 7, 2, 5});
  CHECK(mesh.regions == std::vector<int>{10, 20, 30, 40, 50});
  for (Index n = 0; n < 13; ++n)
    CHECK(mesh.points.row(n) ==
          Eigen::RowVector3d(kX[std::size_t(n)], kY[std::size_t(n)], kZ[std::size_t(n)]));
  REQUIRE(mesh.groups.size() == 4);
  CHECK(mesh.groups[0].name == "corner");
  CHECK(mesh.groups[0].kind == "node set");
  CHECK(mesh.groups[1].name == "node set 4");
  CHECK(mesh.groups[1].nodes == Nodes{1, 4});
  CHECK(mesh.groups[2].name == "floor");
  CHECK(mesh.groups[2].kind == "side set");
  CHECK(mesh.groups[2].nodes == Nodes{0, 1, 2, 3, 4});
  CHECK(mesh.groups[3].nodes == Nodes{1, 2, 6, 7, 12});  // an edge of the shell, a face
}

TEST_CASE("Exodus files come back with other coordinates alone", "[core][formats]") {
  const FormatFolder folder;
  for (const Form& form : kForms)
    require_promise(solid_file(folder / "solid.exo", form), folder, "out.exo");
  constexpr double kSingle = 1e-7;  // float32 keeps 24 bits
  for (const int mode : {0, NC_NETCDF4})
    require_promise(solid_file(folder / "single.exo", {.mode = mode, .type = NC_FLOAT}), folder,
                    "out.exo", kSingle);
}

TEST_CASE("Sides of Exodus elements of second order have their middle nodes", "[core][formats]") {
  const FormatFolder folder;
  {
    NetcdfWriter out(folder / "tet.exo", 0);
    const int nodes = out.dimension("num_nodes", 10), one = out.dimension("num_el_blk", 1);
    // Corners and the middles of the edges 12, 23, 31, 14, 24, 34.
    out.numbers("coordx", {nodes}, {0, 1, 0, 0, .5, .5, 0, 0, .5, 0});
    out.numbers("coordy", {nodes}, {0, 0, 1, 0, 0, .5, .5, 0, 0, .5});
    out.numbers("coordz", {nodes}, {0, 0, 0, 1, 0, 0, 0, .5, .5, .5});
    out.integers("eb_prop1", {one}, {1});
    out.block(1, "TETRA10", 10, {1, 2, 3, 4, 5, 6, 7, 8, 9, 10});
    out.integers("ss_prop1", {one}, {1});
    out.integers("elem_ss1", {one}, {1});
    out.integers("side_ss1", {one}, {3});
  }
  const MeshFile file(folder / "tet.exo");
  const Mesh& mesh = file.mesh();
  REQUIRE(mesh.groups.size() == 1);
  CHECK(mesh.groups[0].nodes.size() == 6);
  for (const Index node : mesh.groups[0].nodes) CHECK(mesh.points(node, 0) == 0);
  CHECK(mesh.regions.empty());
}

TEST_CASE("A pyramid of 14 nodes of Exodus has the last in the middle of its base",
          "[core][formats]") {
  const FormatFolder folder;
  constexpr int kNodes = 28;  // of two pyramids
  std::vector<int> nodes(kNodes);
  std::iota(nodes.begin(), nodes.end(), 1);
  {
    NetcdfWriter out(folder / "pyramids.exo", 0);
    const int count = out.dimension("num_nodes", kNodes);
    for (const char* name : {"coordx", "coordy", "coordz"})
      out.numbers(name, {count}, std::vector<double>(kNodes, .5));
    out.integers("eb_prop1", {out.dimension("num_el_blk", 1)}, {1});
    out.block(1, "PYRAMID14", 14, nodes);
  }
  const MeshFile file(folder / "pyramids.exo");
  Nodes expected(kNodes);
  std::iota(expected.begin(), expected.end(), 0);
  CHECK(file.mesh().connectivity == expected);
  CHECK(file.mesh().types == std::vector(2, CellType::BiquadraticQuadraticPyramid));
}

TEST_CASE("Bad Exodus files are refused by variable", "[core][formats]") {
  const FormatFolder folder;
  const fs::path path = folder / "bad.exo";
  const auto refused = [&](const std::string& type, int size, const std::vector<int>& nodes,
                           std::initializer_list<std::string> parts) {
    {
      NetcdfWriter out(path, 0);
      const int count = out.dimension("num_nodes", 4);
      for (const char* name : {"coordx", "coordy", "coordz"})
        out.numbers(name, {count}, {0, 1, 2, 3});
      out.integers("eb_prop1", {out.dimension("num_el_blk", 1)}, {1});
      out.block(1, type, size, nodes);
    }
    require_refused(path, parts);
  };
  refused("TETRA4", 4, {1, 2, 3, 5}, {"bad.exo", "connect1", "node 5", "4 nodes"});
  refused("TETRA4", 3, {1, 2, 3}, {"connect1", "TETRA4", "3 nodes"});
  refused("NFACED", 4, {1, 2, 3, 4}, {"connect1", "NFACED"});
  refused("SUPER", 4, {1, 2, 3, 4}, {"bad.exo", "no cells"});
  require_refused(folder.put("other.exo", std::string("CDF\1\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0"
                                                      "\0\0\0\0\0\0\0\0\0\0",
                                                      32)),
                  {"other.exo", "coordx", "missing"});
}

TEST_CASE("Damaged Exodus files never crash the reader", "[core][formats]") {
  const FormatFolder folder;
  require_robust(solid_file(folder / "classic.exo"), folder);
  require_robust(solid_file(folder / "large.exo", {.mode = NC_64BIT_DATA}), folder);
  require_robust(solid_file(folder / "netcdf4.exo", {.mode = NC_NETCDF4, .deflate = 5}), folder);
}

}  // namespace cadmorph::test
