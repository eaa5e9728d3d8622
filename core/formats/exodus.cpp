#include <algorithm>
#include <cctype>
#include <map>
#include <optional>

#include "core/cell_topology.h"
#include "core/formats/formats.h"
#include "core/formats/hdf5_file.h"
#include "core/formats/netcdf_file.h"

namespace fs = std::filesystem;

namespace cadmorph {
namespace {

using enum CellType;

enum class Shape { Point, Bar, Triangle, Quad, Tetra, Pyramid, Wedge, Hexahedron };

/// The shape of an element type by the beginning of its name; nothing for one that is not known.
std::optional<Shape> shape_of(const std::string& type, Index nodes) {
  const std::pair<const char*, Shape> shapes[] = {
      {"HEX", Shape::Hexahedron}, {"TET", Shape::Tetra},    {"WEDGE", Shape::Wedge},
      {"PYR", Shape::Pyramid},    {"TRI", Shape::Triangle}, {"QUAD", Shape::Quad},
      {"BAR", Shape::Bar},        {"BEAM", Shape::Bar},     {"TRUSS", Shape::Bar},
      {"ROD", Shape::Bar},        {"EDGE", Shape::Bar},     {"SPRING", Shape::Bar},
      {"SPHERE", Shape::Point},   {"CIRCLE", Shape::Point}, {"POINT", Shape::Point}};
  for (const auto& [name, shape] : shapes)
    if (type.starts_with(name)) return shape;
  if (type.starts_with("SHELL"))
    return nodes == 3 || nodes == 6 || nodes == 7 ? Shape::Triangle : Shape::Quad;
  return {};
}

/// An element of a number of nodes.
struct Element {
  CellType type;
  /// Position in the file of each of VTK's nodes; empty: the same order.
  std::vector<int> order = {};
};

std::optional<Element> element(Shape shape, Index nodes) {
  struct Row {
    Shape shape;
    Index nodes;
    Element element;
  };
  static const std::vector<Row> rows = {
      {Shape::Point, 1, {Vertex}},
      {Shape::Bar, 2, {Line}},
      {Shape::Bar, 3, {QuadraticEdge}},
      {Shape::Triangle, 3, {Triangle}},
      {Shape::Triangle, 6, {QuadraticTriangle}},
      {Shape::Triangle, 7, {BiquadraticTriangle}},
      {Shape::Quad, 4, {Quad}},
      {Shape::Quad, 8, {QuadraticQuad}},
      {Shape::Quad, 9, {BiquadraticQuad}},
      {Shape::Tetra, 4, {Tetra}},
      {Shape::Tetra, 10, {QuadraticTetra}},
      {Shape::Pyramid, 5, {Pyramid}},
      {Shape::Pyramid, 13, {QuadraticPyramid}},
      {Shape::Pyramid, 14, {BiquadraticQuadraticPyramid}},
      {Shape::Wedge, 6, {Wedge}},
      {Shape::Wedge, 15, {QuadraticWedge, {0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 13, 14, 9, 10, 11}}},
      {Shape::Wedge,
       18,
       {BiquadraticQuadraticWedge, {0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 13, 14, 9, 10, 11, 15, 16, 17}}},
      {Shape::Hexahedron, 8, {Hexahedron}},
      {Shape::Hexahedron, 20, {QuadraticHexahedron, {0,  1,  2,  3,  4,  5,  6,  7,  8,  9,
                                                     10, 11, 16, 17, 18, 19, 12, 13, 14, 15}}},
      {Shape::Hexahedron, 27, {TriquadraticHexahedron, {0,  1,  2,  3,  4,  5,  6,  7,  8,
                                                        9,  10, 11, 16, 17, 18, 19, 12, 13,
                                                        14, 15, 23, 24, 25, 26, 21, 22, 20}}},
  };
  for (const Row& row : rows)
    if (row.shape == shape && row.nodes == nodes) return row.element;
  return {};
}

/// Corners of the sides of a shape, by Exodus's numbers of the sides.
const std::vector<std::vector<int>>& sides(Shape shape, bool is_shell) {
  static const std::map<Shape, std::vector<std::vector<int>>> solids = {
      {Shape::Hexahedron,
       {{0, 1, 5, 4}, {1, 2, 6, 5}, {2, 3, 7, 6}, {0, 4, 7, 3}, {0, 3, 2, 1}, {4, 5, 6, 7}}},
      {Shape::Tetra, {{0, 1, 3}, {1, 2, 3}, {0, 3, 2}, {0, 2, 1}}},
      {Shape::Wedge, {{0, 1, 4, 3}, {1, 2, 5, 4}, {0, 3, 5, 2}, {0, 2, 1}, {3, 4, 5}}},
      {Shape::Pyramid, {{0, 1, 4}, {1, 2, 4}, {2, 3, 4}, {0, 4, 3}, {0, 3, 2, 1}}},
      {Shape::Triangle, {{0, 1}, {1, 2}, {2, 0}}},
      {Shape::Quad, {{0, 1}, {1, 2}, {2, 3}, {3, 0}}},
      {Shape::Bar, {{0}, {1}}},
      {Shape::Point, {{0}}}};
  // Those of shells in space begin with their two faces.
  static const std::map<Shape, std::vector<std::vector<int>>> shells = {
      {Shape::Triangle, {{0, 1, 2}, {0, 2, 1}, {0, 1}, {1, 2}, {2, 0}}},
      {Shape::Quad, {{0, 1, 2, 3}, {0, 3, 2, 1}, {0, 1}, {1, 2}, {2, 3}, {3, 0}}}};
  const auto found = shells.find(shape);
  return is_shell && found != shells.end() ? found->second : solids.at(shape);
}

class Reader {
 public:
  explicit Reader(const NetcdfFile& file) : file_(file) {}

  ReadMesh run() {
    read_points();
    read_blocks();
    read_node_sets();
    read_side_sets();
    if (file_.has("frame_coordinates"))
      result_.remarks.push_back("the coordinate frames in the file are those of the base");
    tidy_groups(result_.mesh);
    return std::move(result_);
  }

 private:
  struct Block {
    std::optional<Shape> shape;  ///< none of what was left out
    Index first_element = 0, count = 0, first_cell = 0;
  };

  void read_points() {
    std::vector<NetcdfRun> runs;
    Index nodes = -1;
    if (file_.has("coord")) {
      const std::vector<Index> shape = file_.shape("coord");
      if (shape.size() != 2 || shape[0] < 1 || shape[0] > 3)
        file_.fail("coord", "expected two dimensions, the first of 1 to 3");
      nodes = shape[1];
      dimensions_ = int(shape[0]);
      for (int c = 0; c < dimensions_; ++c)
        runs.push_back({.variable = "coord", .first = nodes * c, .count = nodes, .component = c});
    } else {
      for (const char* name : {"coordx", "coordy", "coordz"}) {
        if (!file_.has(name)) break;
        const std::vector<Index> shape = file_.shape(name);
        if (shape.size() != 1 || (nodes >= 0 && shape[0] != nodes))
          file_.fail(name, "its size is not that of coordx");
        nodes = shape[0];
        runs.push_back({.variable = name, .count = nodes, .component = dimensions_++});
      }
      if (nodes < 0) file_.fail("coordx", "it is missing: this is no mesh of Exodus II");
    }
    result_.mesh.points = Points::Zero(nodes, 3);
    result_.copier = file_.read_coordinates(runs, result_.mesh.points);
  }

  /// Numbers and names of a kind of things; a thing without a name is called by its number.
  struct Names {
    std::vector<Index> numbers;
    std::vector<std::string> names;
  };
  Names names_of(const std::string& prefix, const std::string& what) const {
    Names result;
    if (file_.has(prefix + "_prop1")) result.numbers = file_.integers(prefix + "_prop1");
    if (file_.has(prefix + "_names")) result.names = file_.texts(prefix + "_names");
    result.names.resize(result.numbers.size());
    for (std::size_t i = 0; i < result.numbers.size(); ++i)
      if (result.names[i].empty()) result.names[i] = what + " " + std::to_string(result.numbers[i]);
    return result;
  }

  void read_blocks() {
    const Names blocks = names_of("eb", "block");
    if (blocks.numbers.empty()) file_.fail("eb_prop1", "there are no element blocks");
    for (std::size_t i = 0; i < blocks.numbers.size(); ++i)
      read_block("connect" + std::to_string(i + 1), int(blocks.numbers[i]), blocks.names[i]);
    Mesh& mesh = result_.mesh;
    if (blocks.numbers.size() > 1)
      mesh.region_array = "block";
    else
      mesh.regions.clear();
  }

  void read_block(const std::string& variable, int number, const std::string& name) {
    Block block{.shape = {}, .first_element = elements_, .first_cell = result_.mesh.cell_count()};
    if (!file_.has(variable)) {  // one without elements
      blocks_.push_back(block);
      return;
    }
    const std::vector<Index> shape = file_.shape(variable);
    std::string type = file_.text_attribute(variable, "elem_type");
    std::ranges::transform(type, type.begin(),
                           [](unsigned char c) { return char(std::toupper(c)); });
    if (type == "NSIDED" || type == "NFACED")
      file_.fail(variable, "elements of type " + type + " (polygons, polyhedra) are not read");
    if (shape.size() != 2)
      file_.fail(variable, "expected two dimensions, elements and their nodes");
    block.count = shape[0];
    block.shape = shape_of(type, shape[1]);
    elements_ += block.count;
    std::vector<Index> connectivity = file_.integers(variable);
    check_nodes(variable, connectivity);
    if (block.shape)
      add_block(*block.shape, shape[1], std::move(connectivity), variable, type, number);
    else
      result_.remarks.push_back(std::to_string(block.count) + " elements of type '" + type +
                                "' in " + name + " are no cells; their nodes follow the others");
    blocks_.push_back(block);
  }

  void add_block(Shape shape, Index size, std::vector<Index> nodes, const std::string& variable,
                 const std::string& type, int number) {
    const std::optional<Element> kind = element(shape, size);
    if (!kind)
      file_.fail(variable, "elements of type " + type + " with " + std::to_string(size) +
                               " nodes are not known");
    for (Index& node : nodes) --node;
    if (!kind->order.empty()) {
      std::vector<Index> ordered;
      ordered.reserve(nodes.size());
      for (std::size_t cell = 0; cell < nodes.size(); cell += std::size_t(size))
        for (const int i : kind->order) ordered.push_back(nodes[cell + std::size_t(i)]);
      nodes.swap(ordered);
    }
    add_cells(result_.mesh, kind->type, std::move(nodes));
    result_.mesh.regions.resize(result_.mesh.types.size(), number);
  }

  void check_nodes(const std::string& variable, const std::vector<Index>& nodes) const {
    for (const Index node : nodes)
      if (node < 1 || node > result_.mesh.node_count())
        file_.fail(variable, "node " + std::to_string(node) + " is used, but there are " +
                                 std::to_string(result_.mesh.node_count()) + " nodes");
  }

  void read_node_sets() {
    const Names sets = names_of("ns", "node set");
    for (std::size_t i = 0; i < sets.numbers.size(); ++i) {
      NodeGroup group{.name = sets.names[i], .kind = "node set", .nodes = {}};
      const std::string variable = "node_ns" + std::to_string(i + 1);
      if (file_.has(variable)) group.nodes = file_.integers(variable);
      check_nodes(variable, group.nodes);
      for (Index& node : group.nodes) --node;
      result_.mesh.groups.push_back(std::move(group));
    }
  }

  void read_side_sets() {
    const Names sets = names_of("ss", "side set");
    for (std::size_t i = 0; i < sets.numbers.size(); ++i) {
      NodeGroup group{.name = sets.names[i], .kind = "side set", .nodes = {}};
      const std::string variable = "elem_ss" + std::to_string(i + 1);
      if (file_.has(variable)) {
        const std::vector<Index> elements = file_.integers(variable);
        const std::vector<Index> numbers = file_.integers("side_ss" + std::to_string(i + 1));
        if (elements.size() != numbers.size())
          file_.fail(variable, "it has " + std::to_string(elements.size()) + " elements and " +
                                   std::to_string(numbers.size()) + " sides");
        for (std::size_t k = 0; k < elements.size(); ++k)
          add_side(variable, elements[k], numbers[k], group.nodes);
      }
      result_.mesh.groups.push_back(std::move(group));
    }
  }

  void add_side(const std::string& variable, Index number, Index side,
                std::vector<Index>& nodes) const {
    if (number < 1 || number > elements_)
      file_.fail(variable, "there is no element " + std::to_string(number));
    const Block& block =
        *std::prev(std::ranges::upper_bound(blocks_, number - 1, {}, &Block::first_element));
    if (!block.shape) return;
    const Index c = block.first_cell + number - 1 - block.first_element;
    const CellType type = result_.mesh.types[std::size_t(c)];
    const auto& corners = sides(*block.shape, dimensions_ == 3);
    if (side < 1 || side > std::ssize(corners))
      file_.fail(variable,
                 "element " + std::to_string(number) + " has no side " + std::to_string(side));
    const auto cell = result_.mesh.cell(c);
    const std::vector<int>& side_corners = corners[std::size_t(side - 1)];
    for (const int corner : side_corners) nodes.push_back(cell[std::size_t(corner)]);
    // The other nodes of the face, or of the edge of a shell.
    for (const LocalFace& face : local_faces(type))
      if (holds(face, side_corners))
        for (int i = 0; i < face.count; ++i) nodes.push_back(cell[std::size_t(face.nodes[i])]);
    if (dimension(type) != 2) return;
    const int count = int(corners.size()) - (dimensions_ == 3 ? 2 : 0);  // of edges
    if (side_corners.size() > 2)
      nodes.insert(nodes.end(), cell.begin(), cell.end());
    else if (std::ssize(cell) >= 2 * count)
      nodes.push_back(cell[std::size_t(count + side_corners[0])]);
  }

  static bool holds(const LocalFace& face, const std::vector<int>& corners) {
    const auto own = std::span(face.nodes).first(corners.size());
    return corner_count(face.type, face.count) == int(corners.size()) &&
           std::ranges::all_of(
               corners, [&](int corner) { return std::ranges::find(own, corner) != own.end(); });
  }

  const NetcdfFile& file_;
  ReadMesh result_;
  std::vector<Block> blocks_;
  int dimensions_ = 0;
  Index elements_ = 0;
};

Recognition recognise(const FileStart& start) {
  if (!is_classic_netcdf(start)) return recognise_hdf5(start, "/eb_prop1", "num_el_blk");
  return start.bytes.find("num_el_blk") != std::string::npos ? Recognition::Sure
                                                             : Recognition::Possible;
}

ReadMesh read(const fs::path& path) { return Reader(*open_netcdf(path)).run(); }

}  // namespace

const MeshFormat& exodus_format() {
  static const MeshFormat format{.name = "Exodus II",
                                 .extensions = {".exo", ".e", ".ex2", ".exii", ".g", ".gen"},
                                 .recognise = recognise,
                                 .read = read};
  return format;
}

}  // namespace cadmorph
